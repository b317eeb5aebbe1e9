"""What datasets say: statistics, breakup, the paper's numbers beside ours, accuracy against cost, sensitivity, groups."""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
