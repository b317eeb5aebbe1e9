from .aggregate import Aggregate as Aggregate
from .morphology import aspect_ratio as aspect_ratio
from .morphology import isostatic_bonds as isostatic_bonds
from .morphology import morphology as morphology
from .morphology import population_morphology as population_morphology
from .morphology import semi_axes as semi_axes
from .rigidity import count_modes as count_modes
from .rigidity import rigidity_matrix as rigidity_matrix
