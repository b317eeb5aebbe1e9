from .counts import count_interval as count_interval
from .counts import share_interval as share_interval
from .kernel_table import AGGREGATION as AGGREGATION
from .kernel_table import OUTCOMES as OUTCOMES
from .kernel_table import SHAPES as SHAPES
from .kernel_table import SOURCES as SOURCES
from .kernel_table import KernelTable as KernelTable
from .kernel_table import Records as Records
