"""The population balance in event form: grid, encounters, daughters, right-hand side."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
