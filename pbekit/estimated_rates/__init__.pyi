from .estimated_rates import EstimatedRates as EstimatedRates
from .estimated_rates import grid_for as grid_for
from .estimated_rates import start_of as start_of
from .logistic_law import LogisticLaw as LogisticLaw
from .stress_interpolation import InterpolatedRates as InterpolatedRates
from .stress_interpolation import interpolate as interpolate
