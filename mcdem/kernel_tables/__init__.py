"""Tables of encounters for the population balance: the one crossing from mcdem to pbekit.

Two sources, one table.  A run's event log is re-used as it is.  Designed encounters fill what the run met seldom: pairs of
classes are chosen by what they contribute to the error of the steady mean size (`pbekit.study.uncertainty`), per unit of
work; two aggregates that the run produced are drawn from the classes in proportion to their flux (R_i + R_j)^3, and meet
under the uniform flux of `mcdem.encounter.simulate`.  So within a pair of classes all encounters follow one law.  A steady state
says little about how growth begins, so encounters of two primaries can be asked for apart.

The table is a function of scene, run, seed and number of encounters, whatever the workers and however often it was
interrupted: designed encounter k has its own random stream, and rounds of ROUND encounters are planned from what was
known at their start.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
