from .menu import TARGETS as TARGETS
from .target import HandOver as HandOver
from .target import Target as Target
from .write import Exported as Exported
from .write import export_table as export_table
from .write import hand_over as hand_over
