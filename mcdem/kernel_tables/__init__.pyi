from .atlas import into_atlas as into_atlas
from .design import steady_shares as steady_shares
from .runs import with_runs as with_runs
from .tabulation import tabulate as tabulate
