"""Tables handed over to the solvers that people use: one target a file, `export_table` writes it.

Every target gets the same plain files (`plain_files`); its own file adds what that solver reads, and says what it cannot
represent and how to check it.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
