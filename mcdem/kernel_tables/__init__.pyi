from .atlas import into_atlas as into_atlas
from .design import steady_shares as steady_shares
from .runs import with_runs as with_runs
from .tabulation import tabulate as tabulate
from .until_error import SoughtSummary as SoughtSummary
from .until_error import tabulate_until as tabulate_until
