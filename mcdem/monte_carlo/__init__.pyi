from .comparison import differences as differences
from .comparison import identical as identical
from .compress import compress as compress
from .population import SamplePopulation as SamplePopulation
from .run_control import RunProgress as RunProgress
from .run_control import RunSummary as RunSummary
from .run_control import run as run
from .sweep import sweep as sweep
