"""Rigid aggregates: statics at any orientation, with and without contact torques, and their passage as bodies."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
