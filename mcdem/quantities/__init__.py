"""Quantities with units, tables of a scene file, linear flows."""
