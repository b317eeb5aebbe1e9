"""The paper's figures and a few it lacks, each from its numbers, which are saved beside it.

One file for each group of figures: `forces` (5), `growth` and `early_growth` (6, 7, the course of a run), `size_distribution`
(8), `mass_size` (9), `clusters` (10, Table 2), `shape` (11, 12), `bonds` (13, isostaticity), `encounter` (14), `breakup` (15,
16), `outcomes` (offset, first bond loss, tension), `strength` (static load), `cost` and `sensitivity` (of the commands). What
Frungieri & Vanni print (`mcdem.analysis.paper`) is marked where the run is of their suspension. `album` lists all; a figure that
would show nothing raises `NothingToShowError`. How all look is in `style`: no text lies over data, to which a test holds them.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
