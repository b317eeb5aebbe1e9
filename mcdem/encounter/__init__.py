"""One encounter of two aggregates, from upstream to its outcome."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
