"""Figures of balances, each from a dataset that is saved beside it."""

from pbekit.figures.comparison import draw_ablation as draw_ablation
from pbekit.figures.comparison import draw_comparison as draw_comparison
from pbekit.figures.comparison import draw_course as draw_course
from pbekit.figures.comparison import draw_distribution as draw_distribution
from pbekit.figures.comparison import draw_volume_fractions as draw_volume_fractions
from pbekit.figures.stresses import draw_efficiencies as draw_efficiencies
from pbekit.figures.stresses import draw_stress_law as draw_stress_law
from pbekit.figures.table import draw_table as draw_table
