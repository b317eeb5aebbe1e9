"""Tables of encounters: the hand-over between simulation and balance."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
