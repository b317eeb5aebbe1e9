"""Aggregation kernels K(i, j) [volume / time], with their exact solutions beside them where one is known.

Effects multiply: an encounter kernel times an efficiency is a kernel.  `dn_k/dt = 1/2 sum K_ij n_i n_j ...` over
ordered pairs, so K_ij is the rate at which one i meets one j in unit volume.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from pbekit import arguments
from pbekit.arguments import shown
from pbekit.balance.grid import Cells
from pbekit.errors import KernelError, PBEError, RangeWarning
from pbekit.moments import Below


class Kernel:
    """A rate (or a probability) for two aggregates; `kernel(i, j)` with `Cells` that broadcast.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit import Cells
    >>> from pbekit.balance import Constant, Kernel

    An efficiency that falls with the larger partner, times a constant rate of encounters:

    >>> class FallsWithSize(Kernel):
    ...     def __call__(self, i, j):
    ...         return 1.0 / np.maximum(i.mass, j.mass)
    >>> rate = Constant(1e-16) * FallsWithSize()
    >>> one, ten = Cells(np.ones(1), np.ones(1), None), Cells(np.full(1, 10.0), np.ones(1), None)
    >>> float(rate(one, one)[0]), float(rate(one, ten)[0])
    (1e-16, 1e-17)
    """

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        raise NotImplementedError

    def __mul__(self, other: object) -> Kernel:
        return Times(self, as_kernel(other))

    __rmul__ = __mul__

    @property
    def name(self) -> str:
        return type(self).__name__


@dataclass(frozen=True)
class Times(Kernel):
    """The product of two: encounter rate times efficiency."""

    first: Kernel
    second: Kernel

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        return self.first(i, j) * self.second(i, j)

    @property
    def name(self) -> str:
        return f"{self.first.name} * {self.second.name}"


@dataclass(frozen=True)
class FromFunction(Kernel):
    """A user's plain function of two masses, or of two masses and two shapes, arrays that broadcast.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit import Cells
    >>> from pbekit.balance import FromFunction
    >>> sum_kernel = FromFunction(lambda m, n: 1e-18 * (m + n))
    >>> cells = Cells(np.array([1.0, 2.0]), np.ones(2), None)
    >>> sum_kernel(cells, cells).tolist()
    [2e-18, 4e-18]
    """

    function: Callable[..., Any]

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        wanted = len(inspect.signature(self.function).parameters)
        if wanted == 2:
            return self.function(i.mass, j.mass)
        if wanted == 4:
            return self.function(i.mass, j.mass, i.shape, j.shape)
        raise KernelError(
            f"kernel {self.name}: takes {wanted} arguments, expected (mass_i, mass_j) or "
            "(mass_i, mass_j, shape_i, shape_j)"
        )

    @property
    def name(self) -> str:
        return getattr(self.function, "__name__", repr(self.function))


@dataclass(frozen=True, eq=False)
class FromArray(Kernel):
    """A user's table, one row and one column per cell of the grid.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit import Cells
    >>> from pbekit.balance import FromArray
    >>> measured = FromArray(1e-18 * np.array([[1.0, 1.5], [1.5, 3.0]]))
    >>> mass = np.array([1.0, 2.0])
    >>> measured(Cells(mass[:, None], mass[:, None], None), Cells(mass[None, :], mass[None, :], None)).tolist()
    [[1e-18, 1.5000000000000001e-18], [1.5000000000000001e-18, 3.0000000000000002e-18]]
    """

    values: np.ndarray  # (K, K)
    name: str = "array"

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        values = np.asarray(self.values, float)
        shape = np.broadcast_shapes(i.mass.shape, j.mass.shape)
        if values.shape != shape:
            raise KernelError(
                f"kernel {self.name}: array is {values.shape}, but the grid has {shape[0]} cells"
            )
        return values


def as_kernel(kernel: object) -> Kernel:
    """What a user brings (a Kernel, a number, a function, an array) as a Kernel."""
    if isinstance(kernel, Kernel):
        return kernel
    if isinstance(kernel, Real) and not isinstance(kernel, bool):
        return Constant(float(kernel))
    if callable(kernel):
        return FromFunction(kernel)
    try:
        values = np.asarray(kernel, float)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.ndim != 2 or values.shape[0] != values.shape[1]:
        raise KernelError(
            f"kernel: got {shown(kernel)}, expected a Kernel, a number, a function of two masses, or an array (K, K)"
        )
    return FromArray(values)


def evaluate(kernel: Kernel, cells: Cells) -> np.ndarray:
    """(K, K) kernel over all pairs of cells, refused if negative, not finite or not symmetric."""
    column = Cells(*(c[:, None] for c in cells))
    row = Cells(*(c[None, :] for c in cells))
    wanted = (cells.mass.size,) * 2
    try:
        found = np.asarray(kernel(column, row), float)
        values = np.broadcast_to(found, wanted)
    except PBEError:
        raise
    except (TypeError, ValueError) as problem:
        raise KernelError(
            f"kernel {kernel.name}: expected numbers that broadcast to {wanted} from masses (K, 1) and (1, K): {problem}"
        ) from None

    def refuse(bad: np.ndarray, what: str) -> NoReturn:
        a, b = np.argwhere(bad)[0]
        pair = f"masses {cells.mass[a]:g} and {cells.mass[b]:g} (cells {a}, {b})"
        raise KernelError(f"kernel {kernel.name}: {what} for {pair}: {values[a, b]:g}")

    if np.any(~np.isfinite(values)):
        refuse(~np.isfinite(values), "not finite")
    if np.any(values < 0):
        refuse(values < 0, "negative")
    skew = np.abs(values - values.T) > 1e-10 * np.maximum(values, values.T)
    if np.any(skew):
        a, b = np.argwhere(skew)[0]
        refuse(skew, f"not symmetric (the other way round {values[b, a]:g})")
    return 0.5 * (values + values.T)


# -- kernels with exact solutions ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Constant(Kernel):
    """K(i, j) = K (Smoluchowski 1917).

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.balance import Constant
    >>> grid = pbekit.Grid.primaries(64)
    >>> balance = pbekit.PopulationBalance(grid, [pbekit.Aggregation(Constant(1.0))])
    >>> number = pbekit.solve(balance, grid.monodisperse(1.0), [0.0, 2.0], rtol=1e-10).number.values[-1]
    >>> exact = Constant(1.0).exact_discrete(grid.pivots[:20], 2.0, 1.0)
    >>> bool(abs(number[:20] - exact).max() < 1e-8)
    True
    """

    rate: float

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        return np.full(np.broadcast_shapes(i.mass.shape, j.mass.shape), self.rate)

    def exact_discrete(self, size: ArrayLike, time: float, number: float) -> np.ndarray:
        """n_k from `number` monomers (Smoluchowski 1917): N0 T^(k-1)/(1+T)^(k+1), T = K N0 t/2."""
        k, t = np.asarray(size, float), 0.5 * self.rate * number * time
        return number * np.exp((k - 1) * np.log(t) - (k + 1) * np.log1p(t)) if t > 0 else number * (k == 1)

    def exact_cumulative(self, time: float, number: float, mean: float) -> tuple[Below, Below]:
        """(number below v, mass below v) from number/mean exp(-v/mean) (Schumann 1940): an exponential for ever."""
        now = number / (1 + 0.5 * self.rate * number * time)
        return exponential_below(now, number * mean / now)


@dataclass(frozen=True)
class Sum(Kernel):
    """K(i, j) = b (m_i + m_j) (Golovin 1963).

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.balance import Sum
    >>> grid = pbekit.Grid.primaries(64)
    >>> balance = pbekit.PopulationBalance(grid, [pbekit.Aggregation(Sum(1.0))])
    >>> number = pbekit.solve(balance, grid.monodisperse(1.0), [0.0, 0.3], rtol=1e-10).number.values[-1]
    >>> exact = Sum(1.0).exact_discrete(grid.pivots[:20], 0.3, 1.0)
    >>> bool(abs(number[:20] - exact).max() < 1e-8)
    True
    """

    rate: float

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        return self.rate * (i.mass + j.mass)

    def exact_discrete(self, size: ArrayLike, time: float, number: float) -> np.ndarray:
        """n_k from monomers of mass 1: N0 (1-phi) (k phi)^(k-1) exp(-k phi)/k!, phi = 1 - exp(-b N0 t) (Golovin)."""
        k, phi = np.asarray(size, float), -np.expm1(-self.rate * number * time)
        if phi == 0:
            return number * (k == 1)
        return number * (1 - phi) * np.exp((k - 1) * np.log(k * phi) - k * phi - special.gammaln(k + 1))

    def exact_density(self, volume: ArrayLike, time: float, number: float, mean: float) -> np.ndarray:
        """n(v) from number/mean exp(-v/mean) (Golovin 1963, Scott 1968)."""
        v, tau = np.asarray(volume, float), -np.expm1(-self.rate * number * mean * time)
        z = 2 * v * np.sqrt(tau) / mean
        return number * (1 - tau) / (v * np.sqrt(tau)) * special.ive(1, z) * np.exp(z - (1 + tau) * v / mean)

    def exact_moments(self, time: float, number: float, mean: float) -> tuple[float, float, float]:
        """(M0, M1, M2) from the exponential."""
        grown = np.exp(self.rate * number * mean * time)
        return number / grown, number * mean, 2 * number * mean**2 * grown**2


@dataclass(frozen=True)
class Product(Kernel):
    """K(i, j) = c m_i m_j (Flory 1941, Stockmayer 1943): gels when c M2(0) t = 1.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.balance import Product
    >>> grid = pbekit.Grid.primaries(64)
    >>> balance = pbekit.PopulationBalance(grid, [pbekit.Aggregation(Product(1.0))])
    >>> number = pbekit.solve(balance, grid.monodisperse(1.0), [0.0, 0.2], rtol=1e-10).number.values[-1]
    >>> exact = Product(1.0).exact_discrete(grid.pivots[:20], 0.2, 1.0)
    >>> bool(abs(number[:20] - exact).max() < 1e-8)
    True
    """

    rate: float

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        return self.rate * i.mass * j.mass

    def exact_discrete(self, size: ArrayLike, time: float, number: float) -> np.ndarray:
        """n_k from monomers of mass 1, before the gel point s = K N0 t < 1 (McLeod 1962)."""
        k, s = np.asarray(size, float), self.rate * number * time
        if s >= 1:
            raise KernelError(f"Product: exact solution asked at s = {s:g}, past the gel point s = 1")
        if s == 0:
            return number * (k == 1)
        return number * np.exp((k - 2) * np.log(k) + (k - 1) * np.log(s) - k * s - special.gammaln(k + 1))


def exponential_below(number: float, mean: float) -> tuple[Below, Below]:
    """Cumulative number and mass of number/mean exp(-v/mean), as functions of v."""

    def number_below(v: ArrayLike) -> np.ndarray:
        return -number * np.expm1(-np.asarray(v, float) / mean)

    def mass_below(v: ArrayLike) -> np.ndarray:
        x = np.asarray(v, float) / mean
        return number * mean * special.gammainc(2, x)

    return number_below, mass_below


# -- shear ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ShearEncounter(Kernel):
    """f_ij = (4/3) g (R_i + R_j)^3: rate of encounters in simple shear (Smoluchowski 1917; the paper's Eq. 1).

    Times the probability that an encounter ends in aggregation it is an aggregation kernel; alone it is Smoluchowski's,
    where every encounter of straight trajectories sticks.  Needs a grid with outer radii.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit import Cells
    >>> from pbekit.balance import ShearEncounter
    >>> primary = Cells(np.ones(1), np.ones(1), np.array([0.5e-6]))

    Times the number of primaries, 1.9e14 per m^3 at a volume fraction of 1e-4, a primary meets 2.5 others a second:

    >>> f"{float(ShearEncounter(1e4)(primary, primary)[0]):.2e} m^3/s"
    '1.33e-14 m^3/s'
    """

    shear_rate: float  # g [1/s]

    def __post_init__(self) -> None:
        arguments.law(self, positive=("shear_rate",))

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        if np.any(np.isnan(i.outer_radius)):
            raise KernelError("ShearEncounter: the grid has no outer radii; use grid.with_outer_radius(...)")
        return 4 / 3 * self.shear_rate * (i.outer_radius + j.outer_radius) ** 3


@dataclass(frozen=True)
class ExtensionEncounter(Kernel):
    """4 pi/(3 sqrt 3) e (R_i + R_j)^3: flux into the sphere of contact in uniaxial extension (Zeichner & Schowalter 1977).

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit import Cells
    >>> from pbekit.balance import ExtensionEncounter
    >>> primary = Cells(np.ones(1), np.ones(1), np.array([0.5e-6]))
    >>> f"{float(ExtensionEncounter(1e4)(primary, primary)[0]):.2e} m^3/s"
    '2.42e-14 m^3/s'
    """

    extension_rate: float  # e [1/s]

    def __post_init__(self) -> None:
        arguments.law(self, positive=("extension_rate",))

    def __call__(self, i: Cells, j: Cells) -> np.ndarray:
        if np.any(np.isnan(i.outer_radius)):
            raise KernelError(
                "ExtensionEncounter: the grid has no outer radii; use grid.with_outer_radius(...)"
            )
        return 4 * np.pi / (3 * np.sqrt(3)) * self.extension_rate * (i.outer_radius + j.outer_radius) ** 3


@dataclass(frozen=True)
class FractalRadius:
    """R = a (P / k)^(1/d), never below the sphere (P = 1) and the touching pair (P = 2, R = 2a).

    prefactor, dimension : k_o and d_o of P = k_o (R/a)^d_o; dimensions outside 1 ... 3 are of no body and warned of

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit.balance import FractalRadius
    >>> radius = FractalRadius(0.5e-6, prefactor=0.9, dimension=2.0)
    >>> (radius(np.array([1.0, 2.0, 90.0])) * 1e6).round(2).tolist()
    [0.5, 1.0, 5.0]
    """

    radius: float  # a [m]
    prefactor: float = 1.0
    dimension: float = 2.0

    def __post_init__(self) -> None:
        arguments.law(self, positive=("radius", "prefactor", "dimension"))
        if not 1 <= self.dimension <= 3:
            warnings.warn(
                f"FractalRadius: dimension = {self.dimension:g} is outside 1 ... 3",
                RangeWarning,
                stacklevel=3,
            )

    def __call__(self, mass: ArrayLike) -> np.ndarray:
        p = np.asarray(mass, float)
        law = (p / self.prefactor) ** (1 / self.dimension)
        return self.radius * np.where(p == 1, 1.0, np.where(p == 2, 2.0, np.maximum(law, 1.0)))
