"""Population balances in size and shape, fed by analytic kernels or by tabulated encounters.

    table = pbekit.open_table("kernels.nc")
    course = pbekit.solve_table(table, until=300.0, draws=40)

Names are imported when they are first used, so that a command answers, and can be interrupted, before all is loaded.
"""

import lazy_loader as lazy

from pbekit.version import __version__ as __version__

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
