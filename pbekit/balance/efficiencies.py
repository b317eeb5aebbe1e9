"""Probabilities that an encounter ends in contact, from theory; each multiplies `ShearEncounter`.

Every law says from where it comes and warns (`RangeWarning`) when it is used outside the range its source or our
own trajectories support.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from pbekit import arguments
from pbekit.balance.grid import Cells
from pbekit.balance.kernels import Kernel
from pbekit.errors import KernelError, RangeWarning


def _warn(message: str) -> None:
    warnings.warn(message, RangeWarning, stacklevel=4)


def attraction_number(hamaker_constant: float, viscosity: float, shear_rate: float, radius: float) -> float:
    """C_A = A_H / (36 pi mu g a^3): van der Waals attraction against shear [-].

    Parameters
    ----------
    hamaker_constant : float
        A_H [J].
    viscosity : float
        mu [Pa s].
    shear_rate : float
        g [1/s].
    radius : float
        a [m].

    Returns
    -------
    float
        C_A [-].

    Examples
    --------
    >>> from pbekit.balance import attraction_number
    >>> f"{attraction_number(0.97e-20, 0.1, 1e4, 500e-9):.2e}"
    '6.86e-07'
    """
    return hamaker_constant / (36 * np.pi * viscosity * shear_rate * radius**3)


@dataclass(frozen=True)
class VanDeVenMason(Kernel):
    """eta = f C_A^0.18, two equal spheres in simple shear (van de Ven & Mason 1977; the paper's Eq. 23).

    prefactor f : 0.95 for polymer spheres of 500 nm (retardation of the attraction)
    Made for two primaries; used for aggregates it is a rough guess that takes every contact as one of two primaries.
    Exact trajectories follow it for C_A from 1e-4 to 1e-1; below, the slope is steeper (0.26 near 1e-6).

    Examples
    --------
    >>> from pbekit.balance import VanDeVenMason, attraction_number

    Latex of 1 um in water at 100 1/s:

    >>> attraction = attraction_number(9.7e-21, viscosity=1e-3, shear_rate=100.0, radius=0.5e-6)
    >>> round(attraction, 5), round(VanDeVenMason(attraction).value, 3)
    (0.00686, 0.388)
    """

    attraction: float  # C_A [-]
    prefactor: float = 0.95

    def __post_init__(self) -> None:
        arguments.law(self, positive=("attraction", "prefactor"))
        if not 1e-4 <= self.attraction <= 1e-1:
            _warn(
                f"VanDeVenMason: C_A = {self.attraction:.3g} is outside 1e-4 ... 1e-1, where the 0.18 power holds"
            )

    @property
    def value(self) -> float:
        return min(1.0, self.prefactor * self.attraction**0.18)

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        return np.full(np.broadcast_shapes(i.mass.shape, j.mass.shape), self.value)


EXTENSION = np.array(
    [
        [1e-9, 0.05670],
        [1e-8, 0.07573],
        [1e-7, 0.10164],
        [1e-6, 0.13739],
        [1e-5, 0.18781],
        [10**-4.5, 0.22105],
        [1e-4, 0.26189],
        [10**-3.5, 0.31312],
        [1e-3, 0.37904],
        [10**-2.5, 0.46653],
        [1e-2, 0.58658],
        [10**-1.5, 0.75677],
        [1e-1, 1.00506],
    ]
)
"""(C_A, eta): limiting trajectories of two equal spheres in uniaxial extension with exact two-sphere mobilities and
unretarded attraction; tests/pbekit/test_pbe_extension.py computes them again."""


@dataclass(frozen=True)
class ZeichnerSchowalter(Kernel):
    """Two equal spheres in uniaxial extension, by trajectory analysis (Zeichner & Schowalter 1977).

    To be multiplied with `ExtensionEncounter`.  C_A is formed with the extension rate.  The trajectories are computed, not
    read from their figures: smooth spheres, full lubrication, unretarded attraction.  Local powers of C_A: 0.13 at 1e-7,
    0.15 at 1e-4, 0.22 at 1e-2.  Above C_A = 0.1 attraction draws in pairs from outside the sphere of contact.

    Examples
    --------
    >>> from pbekit.balance import ZeichnerSchowalter
    >>> [round(ZeichnerSchowalter(attraction).value, 3) for attraction in (1e-4, 1e-2)]
    [0.262, 0.587]
    """

    attraction: float  # A_H/(36 pi mu e a^3) [-]

    def __post_init__(self) -> None:
        arguments.law(self, positive=("attraction",))
        if not EXTENSION[0, 0] <= self.attraction <= EXTENSION[-1, 0]:
            _warn(
                f"ZeichnerSchowalter: C_A = {self.attraction:.3g} is outside 1e-9 ... 1e-1, where trajectories were computed"
            )

    @property
    def value(self) -> float:
        known = CubicSpline(*np.log(EXTENSION.T))
        return float(np.exp(known(np.log(np.clip(self.attraction, *EXTENSION[[0, -1], 0])))))

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        return np.full(np.broadcast_shapes(i.mass.shape, j.mass.shape), self.value)


@dataclass(frozen=True)
class Kusters(Kernel):
    """eta = eta_max exp(-x (1 - m_i/m_j)^2) / (m_i m_j)^y, m_i <= m_j in primaries.

    The form Selomulya, Bushell, Amal & Waite (2003) give to the trajectories of shielded porous aggregates of Kusters,
    Wijers & Thoenes (1997): unlike sizes and large aggregates collide less well.  x = y = 0.1 there; fitted values of
    y in the literature stay below about 1.1.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit import Cells
    >>> from pbekit.balance import Kusters
    >>> small, large = Cells(np.ones(1), np.ones(1), None), Cells(np.array([50.0]), np.ones(1), None)
    >>> law = Kusters()
    >>> float(law(small, small)[0]), round(float(law(small, large)[0]), 3), round(float(law(large, large)[0]), 3)
    (1.0, 0.614, 0.457)
    """

    largest: float = 1.0  # eta_max
    x: float = 0.1
    y: float = 0.1

    def __post_init__(self) -> None:
        arguments.law(self, finite=("largest", "x", "y"))
        if not (0 < self.largest <= 1):
            raise KernelError(f"Kusters: eta_max must be in (0, 1], got {self.largest:g}")
        if not (0 <= self.x <= 1.1 and 0 <= self.y <= 1.1):
            _warn(f"Kusters: x = {self.x:g}, y = {self.y:g}; fits in the literature lie in 0 ... 1.1")

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        ratio = np.minimum(i.mass, j.mass) / np.maximum(i.mass, j.mass)
        return self.largest * np.exp(-self.x * (1 - ratio) ** 2) / (i.mass * j.mass) ** self.y


def happel_permeability(solid_fraction: ArrayLike, radius: float) -> np.ndarray:
    """kappa [m^2] of a swarm of spheres of this radius (Happel 1958)."""
    s = np.asarray(solid_fraction, float)
    cell = 3 - 4.5 * s ** (1 / 3) + 4.5 * s ** (5 / 3) - 3 * s**2
    return 2 * radius**2 / (9 * s) * cell / (3 + 2 * s ** (5 / 3))


def fluid_collection(permeability_ratio: ArrayLike) -> np.ndarray:
    """Share of the approaching flow that passes through a porous sphere, xi = R/sqrt(kappa) (Adler 1981).

    1 for a fully permeable sphere, 0 for a solid one.
    """
    xi = np.asarray(permeability_ratio, float)
    x = np.maximum(xi, 0.05)
    t = np.tanh(x) / x
    j = 2 * x**2 + 3 - 3 * t
    d = 3 / j * x**3 * (1 - t)
    c = -1 / j * (x**5 + 6 * x**3 - t * (3 * x**5 + 6 * x**3))
    # Below 0.05 the closed form loses its digits to cancellation.
    return np.where(xi < 0.05, 1 - 4 / 15 * xi**2, 1 - d / x - c / x**3)


@dataclass(frozen=True)
class VeerapaneniWiesner(Kernel):
    """eta = ((sqrt(e_i) R_i + sqrt(e_j) R_j)/(R_i + R_j))^3, porous aggregates (Veerapaneni & Wiesner 1996).

    e is the share of the approaching flow that passes through an aggregate, with a uniform permeability after Happel
    from its solid fraction P (a/R)^3.  Only flow that enters brings a partner: for solid spheres it is zero, as no
    lubrication gap and no attraction are in it.  Warns above a solid fraction of 0.6, where aggregates are no swarm.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit import Cells
    >>> from pbekit.balance import VeerapaneniWiesner

    Of 1000 primaries, in a compact aggregate of 7 um and a loose one of 50 um:

    >>> law = VeerapaneniWiesner(0.5e-6)
    >>> for radius in (7e-6, 50e-6):
    ...     floc = Cells(np.array([1e3]), np.ones(1), np.array([radius]))
    ...     print(f"{float(law(floc, floc)[0]):.0e}")
    3e-05
    2e-02
    """

    radius: float  # a [m]

    def __post_init__(self) -> None:
        arguments.law(self, positive=("radius",))

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        if np.any(np.isnan(i.outer_radius)):
            raise KernelError(
                "VeerapaneniWiesner: the grid has no outer radii; use grid.with_outer_radius(...)"
            )
        reach = sum(np.sqrt(self._collection(c)) * c.outer_radius for c in (i, j))
        return (reach / (i.outer_radius + j.outer_radius)) ** 3

    def _collection(self, cells: Cells) -> np.ndarray:
        solid = cells.mass * (self.radius / cells.outer_radius) ** 3
        if np.any(solid > 1 + 1e-9):
            raise KernelError(
                "VeerapaneniWiesner: an aggregate's outer sphere is smaller than its primaries together"
            )
        dense = solid > 0.6
        if np.any(dense & (cells.mass > 1)):
            _warn(
                "VeerapaneniWiesner: aggregates denser than a solid fraction of 0.6 are treated as a swarm of spheres"
            )
        permeability = happel_permeability(np.minimum(solid, 0.999), self.radius)
        return np.where(cells.mass > 1, fluid_collection(cells.outer_radius / np.sqrt(permeability)), 0.0)
