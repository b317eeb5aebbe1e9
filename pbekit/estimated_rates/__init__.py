"""Rates of aggregation, breakup and restructuring estimated from tables of encounters."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
