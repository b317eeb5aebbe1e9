from .compress import compress as compress
from .population import SamplePopulation as SamplePopulation
from .process import RunProgress as RunProgress
from .process import RunSummary as RunSummary
from .process import run as run
from .sweep import sweep as sweep
