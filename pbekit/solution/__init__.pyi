from .finite_population import population_course as population_course
from .solve import integrate as integrate
from .steady import NotReachedError as NotReachedError
from .steady import SteadyState as SteadyState
from .steady import steady_state as steady_state
