"""Datasets on disk: whole at every moment, and compared bit by bit."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
