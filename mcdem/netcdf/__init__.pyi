from .comparison import differences as differences
from .comparison import identical as identical
