"""Rigid aggregates: statics at any orientation, with and without contact torques, and their passage as bodies."""
