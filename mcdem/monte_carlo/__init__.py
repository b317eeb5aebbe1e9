"""The event-driven Monte Carlo: which aggregates meet next, and what the population becomes."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
