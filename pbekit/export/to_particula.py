"""particula: a coagulation strategy that looks its kernel up in the table; particula knows no breakup."""

from __future__ import annotations

from pbekit.export.arrays import arrays_of, packed
from pbekit.export.target import MARK, HandOver, Target

MODULE = f'''"""{MARK}: a coagulation strategy of particula with the aggregation rates of a table.

    from kernels_particula import TabulatedAggregation
    strategy = TabulatedAggregation("particle_resolved")
    particle = strategy.step(particle, temperature, pressure, time_step)

The radius of a particle is that of the sphere of its solid volume, a P^(1/3).  Between classes ln K is interpolated in ln P;
outside the classes a ValueError says so.
"""

from pathlib import Path

import numpy as np
from particula.dynamics.coagulation.coagulation_strategy.coagulation_strategy_abc import CoagulationStrategyABC
from scipy.interpolate import RegularGridInterpolator

DATA = np.load(Path(__file__).with_name("kernels.npz"))
RADIUS, SIZES, KERNEL = float(DATA["a"]), DATA["P"], DATA["K"]


class TabulatedAggregation(CoagulationStrategyABC):
    """K(P_i, P_j) [m^3/s] of the table."""

    def __init__(self, distribution_type="particle_resolved"):
        # particula looks kernels up by bins of radius: one for each class.
        super().__init__(distribution_type, particle_resolved_kernel_radius=RADIUS * np.cbrt(SIZES))
        self._kernel = RegularGridInterpolator((np.log(SIZES),) * 2, np.log(KERNEL))

    def kernel(self, particle, temperature=None, pressure=None):
        """(N, N) rates [m^3/s] between the radii of `particle`."""
        size = (particle.get_radius() / RADIUS) ** 3
        if np.any(size < SIZES[0] * (1 - 1e-6)) or np.any(size > SIZES[-1] * (1 + 1e-6)):
            asked, known = f"{{size.min():.3g}} to {{size.max():.3g}}", f"{{SIZES[0]:g}} to {{SIZES[-1]:g}}"
            raise ValueError(f"particles of {{asked}} primaries: the table has {{known}}")
        log = np.log(np.clip(size, SIZES[0], SIZES[-1]))
        return np.exp(self._kernel(tuple(np.meshgrid(log, log, indexing="ij"))))

    def dimensionless_kernel(self, diffusive_knudsen, coulomb_potential_ratio):
        """Shear aggregation has none of these groups."""
        raise NotImplementedError("a table gives dimensional rates alone")
'''


def files(given: HandOver) -> dict[str, str | bytes]:
    """The module and its arrays."""
    kept = {name: value for name, value in arrays_of(given).items() if name in ("P", "K", "a", "g", "n0")}
    return {"kernels_particula.py": MODULE, "kernels.npz": packed(kept)}


TARGET = Target(
    title="particula",
    files=files,
    notes={
        "kernels_particula.py": "TabulatedAggregation, a CoagulationStrategyABC; keep it beside kernels.npz",
        "kernels.npz": "its arrays: P, K [m^3/s], a [m]",
    },
    cannot=(
        "Breakup: particula has none, so that sizes grow without end; compare with a balance without breakup only.",
        "Classes: its bins interpolate in radius, which smears sizes of a few primaries; particle-resolved keeps them.",
        "Shapes.",
    ),
    check="Step particles of one primary radius over a time in which the mean size grows to a few: it must follow a balance of K "
    "alone, B = 0.",
)
