"""The paper's figures and a few it lacks, each from its numbers, which are saved beside it.

One file for each group of figures: `growth` (6, 7), `size_distribution` (8), `shape` (9, 11, 12, 13, isostaticity),
`clusters` (10, Table 2), `forces` (5), `encounter` (14), `breakup` (15, 16), `outcomes` (offset, first bond loss,
tension), `strength` (static load). `paper` holds what Frungieri & Vanni print, to be marked in them.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
