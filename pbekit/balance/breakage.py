"""Breakup of one aggregate: how often (rates) and into what (daughter distributions).

A daughter distribution is held by its *mass-weighted* density over x = fragment / parent, whose integral is one, so
that mass is exact whatever else is approximated; the number of fragments is the integral of that density over 1/x.
On a grid of whole primaries a parent of P yields 1 ... P - 1; the density is taken there and its sum made one.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from pbekit import arguments
from pbekit.arguments import shown
from pbekit.balance.grid import Cells, Cumulative
from pbekit.errors import KernelError, RangeWarning

# -- rates ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PowerLawRate:
    """S = c (m - offset)^p for m > offset.

    With p = 1 and no offset the random scission of Ziff & McGrady (1985); with offset = 1, p = 1 each of the P - 1
    bonds of a chain breaks at rate c.  c grows as a power of the shear rate in flocculation models (Pandya & Spielman
    1983; Flesch, Spicer & Pratsinis 1999: p = 1/3).  A power below zero would break the smallest first, one above 3 is
    steeper than any of these: both are warned of.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.balance import PowerLawRate

    A chain whose bonds break at 0.1 per second each:

    >>> chains = pbekit.Cells(np.array([1.0, 2.0, 11.0]), np.ones(3), None)
    >>> PowerLawRate(0.1, power=1.0, offset=1.0)(chains).tolist()
    [0.0, 0.1, 1.0]
    """

    rate: float
    power: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        arguments.law(self, finite=("rate", "power", "offset"))
        if not 0 <= self.power <= 3:
            warnings.warn(
                f"PowerLawRate: power = {self.power:g} is outside 0 ... 3", RangeWarning, stacklevel=3
            )

    def __call__(self, cells: Cells) -> np.ndarray:
        return self.rate * np.maximum(cells.mass - self.offset, 0.0) ** self.power


@dataclass(frozen=True)
class ExponentialRate:
    """S = sqrt(4/(15 pi)) g exp(-strength/stress), strength(m) = strength m^-power.

    After Kusters (1991), S = sqrt(4/(15 pi)) sqrt(eps/nu) exp(-eps_b/eps) for flocs in turbulence; in simple shear g
    takes the place of sqrt(eps/nu) and mu g that of eps.  Stress meets strength at a size that falls as
    (mu g)^(-1/power), so power = 1/2 goes with q = 2; the range of q is that of `CriticalSize`.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.balance import ExponentialRate
    >>> flocs = pbekit.Cells(np.array([1.0, 100.0, 1e4]), np.ones(3), None)
    >>> ExponentialRate(shear_rate=100.0, stress=0.1, strength=1.0)(flocs).round(3).tolist()
    [0.001, 10.718, 26.362]
    """

    shear_rate: float  # g [1/s]
    stress: float  # mu g [Pa]
    strength: float  # of a parent of unit mass [Pa]
    power: float = 0.5  # strength(P) = strength P^-power

    def __post_init__(self) -> None:
        arguments.law(self, positive=("shear_rate", "stress", "strength"), finite=("power",))
        if not 1 / 3 <= self.power <= 2:
            warnings.warn(
                f"ExponentialRate: power = {self.power:g} is outside 1/3 ... 2", RangeWarning, stacklevel=3
            )

    def __call__(self, cells: Cells) -> np.ndarray:
        resistance = self.strength * cells.mass**-self.power
        return np.sqrt(4 / (15 * np.pi)) * self.shear_rate * np.exp(-resistance / self.stress)


@dataclass(frozen=True)
class CriticalSize:
    """Breakup above a critical size P_c = reference_size (mu g / reference_stress)^-q.

    As a first-order rate: g times the probability.  As a probability of breakup on encounter (`of_pair`): of the two
    masses together.  The step is 1/(1 + (P_c/P)^sharpness).  q is near 2 for the paper's dense aggregates and
    d_f/2 is expected of tenuous ones (Bremer & co-workers; Zaccone et al. 2009): its range is a claim to be tested,
    hence the warning when q is outside 0.5 ... 3.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.balance import CriticalSize

    Breakup at 24 primaries at 1000 Pa; with q = 2 at 96 at half the stress:

    >>> law = CriticalSize(stress=500.0, reference_stress=1000.0, reference_size=24.0)
    >>> law(pbekit.Cells(np.array([24.0, 96.0, 400.0]), np.ones(3), None)).round(3).tolist()
    [0.0, 0.5, 1.0]
    """

    stress: float  # mu g [Pa]
    reference_stress: float  # [Pa]
    reference_size: float  # P_c at the reference stress
    q: float = 2.0
    sharpness: float = 8.0
    shear_rate: float = 1.0  # g [1/s], for the first-order rate

    def __post_init__(self) -> None:
        arguments.law(
            self,
            positive=("stress", "reference_stress", "reference_size", "sharpness", "shear_rate"),
            finite=("q",),
        )
        if not 0.5 <= self.q <= 3:
            warnings.warn(f"CriticalSize: q = {self.q:g} is outside 0.5 ... 3", RangeWarning, stacklevel=3)

    @property
    def critical_size(self) -> float:
        return self.reference_size * (self.stress / self.reference_stress) ** -self.q

    def probability(self, mass: ArrayLike) -> np.ndarray:
        return special.expit(self.sharpness * np.log(np.asarray(mass, float) / self.critical_size))

    def __call__(self, cells: Cells) -> np.ndarray:
        return self.shear_rate * np.where(cells.mass > 1, self.probability(cells.mass), 0.0)

    def of_pair(self, i: Cells, j: Cells) -> np.ndarray:
        """Probability that an encounter of i and j ends in breakup."""
        return self.probability(i.mass + j.mass)


def evaluate_rate(rate: object, cells: Cells, name: str | None = None) -> np.ndarray:
    """(K,) breakage rate; a callable of cells, a plain function of mass, or an array. Refused if negative or NaN."""
    name = name or getattr(rate, "__name__", type(rate).__name__)
    if callable(rate):
        library = isinstance(rate, (PowerLawRate, ExponentialRate, CriticalSize))
        values = rate(cells) if library else rate(cells.mass)
    else:
        values = rate
    try:
        values = np.broadcast_to(np.asarray(values, float), cells.mass.shape).copy()
    except (TypeError, ValueError):
        raise KernelError(
            f"breakage rate {name}: expected a number, a function of mass, or an array {cells.mass.shape}, got {shown(values)}"
        ) from None
    for bad, what in ((~np.isfinite(values), "not finite"), (values < 0, "negative")):
        if np.any(bad):
            k = np.flatnonzero(bad)[0]
            raise KernelError(f"breakage rate {name}: {what} at mass {cells.mass[k]:g}: {values[k]:g}")
    return values


# -- daughters -----------------------------------------------------------------------------------------------------


class Daughters:
    """Mass-weighted density over x in (0, 1); `scale_free` ones depend on x alone.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit.balance import Daughters

    Whole primaries need the density alone; here two-thirds of the mass stays together:

    >>> class ThirdAndRest(Daughters):
    ...     def mass_density(self, x):
    ...         return np.exp(-(((x - 2 / 3) / 0.1) ** 2)) + 0.5 * np.exp(-(((x - 1 / 3) / 0.1) ** 2))
    >>> sizes, numbers = ThirdAndRest().pieces(30.0)
    >>> int(sizes[np.argmax(sizes * numbers)]), round(float(sizes @ numbers), 9)
    (20, 30.0)
    """

    def mass_below(self, x: np.ndarray) -> np.ndarray:
        """Share of the parent's mass in fragments below x; 0 at 0 and 1 at 1."""
        raise NotImplementedError

    def number_below(self, x: np.ndarray) -> np.ndarray:
        """Number of fragments below x."""
        raise NotImplementedError

    def mass_density(self, x: np.ndarray) -> np.ndarray:
        """d(mass_below)/dx, for whole primaries; need not be normalised."""
        raise NotImplementedError

    @property
    def name(self) -> str:
        return type(self).__name__

    def pieces(self, parent: float) -> tuple[np.ndarray, np.ndarray]:
        """Whole primaries: (sizes, expected numbers) of the fragments of a parent of P primaries."""
        sizes = np.arange(1.0, np.ceil(parent - 1e-9))
        if sizes.size == 0:
            raise KernelError(f"daughters {self.name}: a parent of {parent:g} primaries cannot break")
        weight = np.asarray(self.mass_density(sizes / parent), float)
        if np.any(~np.isfinite(weight)) or np.any(weight < 0) or weight.sum() <= 0:
            raise KernelError(
                f"daughters {self.name}: density negative or not finite for a parent of {parent:g}"
            )
        return sizes, parent * weight / weight.sum() / sizes

    def cumulative(self, parent: float) -> tuple[Cumulative, Cumulative]:
        """Volumes: (number below v, mass below v) of the fragments of a parent of volume `parent`."""
        return (
            lambda v: self.number_below(np.clip(np.asarray(v, float) / parent, 0.0, 1.0)),
            lambda v: parent * self.mass_below(np.clip(np.asarray(v, float) / parent, 0.0, 1.0)),
        )


@dataclass(frozen=True)
class Uniform(Daughters):
    """Two fragments, any split equally likely: b(u|v) = 2/v (random scission, Ziff & McGrady 1985).

    Examples
    --------
    >>> from pbekit.balance import Uniform
    >>> Uniform().mass_below(0.5)
    0.25
    """

    def mass_below(self, x: np.ndarray) -> np.ndarray:
        return x**2

    def number_below(self, x: np.ndarray) -> np.ndarray:
        return 2 * x

    def mass_density(self, x: np.ndarray) -> np.ndarray:
        return 2 * x


@dataclass(frozen=True)
class BetaSplit(Daughters):
    """Two fragments, x and 1 - x, with x from a symmetric beta distribution; width -> 0 is the binary halving.

    concentration c : density ~ (x (1 - x))^(c - 1); c = 1 is Uniform, large c equal halves.

    Examples
    --------
    >>> from pbekit.balance import BetaSplit

    The share of the mass in fragments below 0.4 of the parent, at random splits and near halves:

    >>> [round(float(BetaSplit(c).mass_below(0.4)), 4) for c in (1.0, 30.0)]
    [0.16, 0.0445]
    """

    concentration: float = 1.0

    def __post_init__(self) -> None:
        arguments.law(self, positive=("concentration",))

    def mass_below(self, x: np.ndarray) -> np.ndarray:
        # x f(x) with f the beta(c, c) density, doubled, is the beta(c + 1, c) density.
        return special.betainc(self.concentration + 1, self.concentration, x)

    def number_below(self, x: np.ndarray) -> np.ndarray:
        return 2 * special.betainc(self.concentration, self.concentration, x)

    def mass_density(self, x: np.ndarray) -> np.ndarray:
        return x * (x * (1 - x)) ** (self.concentration - 1)


def Binary(concentration: float = 30.0) -> BetaSplit:
    """Two nearly equal halves (spread 1/sqrt(8 c + 4) in x).

    Parameters
    ----------
    concentration : float
        c [-]; the larger, the nearer the halves.

    Returns
    -------
    Daughters
        For `Breakage` and `CollisionalBreakup`.

    Examples
    --------
    >>> from pbekit.balance import Binary
    >>> daughters = Binary()
    """
    return BetaSplit(concentration)


@dataclass(frozen=True)
class TwoPeak(Daughters):
    """Two fragments, the smaller about `fraction` of the parent: peaks at x and 1 - x of the same number.

    Each peak is a beta distribution of concentration c and mean fraction, 1 - fraction.  fraction -> 0 is erosion.

    Examples
    --------
    >>> from pbekit.balance import TwoPeak

    Erosion of a twentieth: nearly all mass stays in the large fragment.

    >>> erosion = TwoPeak(fraction=0.05, concentration=200.0)
    >>> round(float(erosion.mass_below(0.5)), 3)
    0.05
    """

    fraction: float = 0.3
    concentration: float = 40.0

    def __post_init__(self) -> None:
        arguments.law(self, positive=("concentration",), finite=("fraction",))
        if not 0 < self.fraction <= 0.5:
            raise KernelError(
                f"TwoPeak: fraction of the smaller piece must be in (0, 0.5], got {self.fraction:g}"
            )

    @property
    def _shape(self) -> tuple[float, float]:
        return self.fraction * self.concentration, (1 - self.fraction) * self.concentration

    def mass_below(self, x: np.ndarray) -> np.ndarray:
        a, b = self._shape
        light = self.fraction * special.betainc(a + 1, b, x)
        return light + (1 - self.fraction) * special.betainc(b + 1, a, x)

    def number_below(self, x: np.ndarray) -> np.ndarray:
        a, b = self._shape
        return special.betainc(a, b, x) + special.betainc(b, a, x)

    def mass_density(self, x: np.ndarray) -> np.ndarray:
        a, b = self._shape
        scale = special.betaln(a, b)
        log_x, log_y = np.log(x), np.log1p(-x)
        return x * (
            np.exp((a - 1) * log_x + (b - 1) * log_y - scale)
            + np.exp((b - 1) * log_x + (a - 1) * log_y - scale)
        )


def Erosion(fraction: float = 0.05, concentration: float = 60.0) -> TwoPeak:
    """A small piece leaves a large one.

    Parameters
    ----------
    fraction : float
        Mass of the piece over that of the parent [-].
    concentration : float
        The larger, the narrower [-].

    Returns
    -------
    Daughters
        For `Breakage` and `CollisionalBreakup`.

    Examples
    --------
    >>> from pbekit.balance import Erosion
    >>> daughters = Erosion(fraction=0.1)
    """
    return TwoPeak(fraction, concentration)


@dataclass(frozen=True)
class TwoBeta(Daughters):
    """Two beta peaks of the mass-weighted density: shares w and 1 - w of the mass, means m and concentrations c of each.

    The number of fragments follows from them; it is finite where m c > 1 in both.
    """

    share: float = 0.5
    mean: float = 0.3
    concentration: float = 20.0
    other_mean: float = 0.6
    other_concentration: float = 20.0

    def __post_init__(self) -> None:
        arguments.law(
            self,
            positive=("mean", "concentration", "other_mean", "other_concentration"),
            finite=("share",),
        )
        if not (0 <= self.share <= 1 and self.mean < 1 and self.other_mean < 1):
            raise KernelError(
                f"TwoBeta: share {self.share:g} must be in [0, 1] and the means {self.mean:g}, {self.other_mean:g} in (0, 1)"
            )
        if min(self.mean * self.concentration, self.other_mean * self.other_concentration) <= 1:
            raise KernelError("TwoBeta: mean times concentration must be above 1 in both peaks")

    @property
    def _peaks(self) -> list[tuple[float, float, float]]:
        """(share of the mass, a, b) of both."""
        peaks = (
            (self.share, self.mean, self.concentration),
            (1 - self.share, self.other_mean, self.other_concentration),
        )
        return [(w, m * c, (1 - m) * c) for w, m, c in peaks]

    def mass_below(self, x: np.ndarray) -> np.ndarray:
        return np.sum([w * special.betainc(a, b, x) for w, a, b in self._peaks], axis=0)

    def number_below(self, x: np.ndarray) -> np.ndarray:
        # beta(x; a, b)/x is (a + b - 1)/(a - 1) times beta(x; a - 1, b).
        return np.sum(
            [w * (a + b - 1) / (a - 1) * special.betainc(a - 1, b, x) for w, a, b in self._peaks], axis=0
        )

    def mass_density(self, x: np.ndarray) -> np.ndarray:
        log_x, log_y = np.log(x), np.log1p(-x)
        return np.sum(
            [w * np.exp((a - 1) * log_x + (b - 1) * log_y - special.betaln(a, b)) for w, a, b in self._peaks],
            axis=0,
        )


@dataclass(frozen=True)
class SchulzZimm(Daughters):
    """Many fragments whose numbers follow a Schulz-Zimm (gamma) law cut off at the parent (Schulz 1939, Zimm 1948).

    mean : number-average x of the law before the cut; shape k : 1/k = relative variance (k = 1 exponential).

    Examples
    --------
    >>> from pbekit.balance import SchulzZimm
    >>> shatter = SchulzZimm(mean=0.1, shape=2.0)
    >>> round(float(shatter.number_below(1.0)), 1)
    10.0
    """

    mean: float = 0.2
    shape: float = 2.0

    def __post_init__(self) -> None:
        arguments.law(self, positive=("mean", "shape"))

    def mass_below(self, x: np.ndarray) -> np.ndarray:
        rate = self.shape / self.mean
        return special.gammainc(self.shape + 1, rate * x) / special.gammainc(self.shape + 1, rate)

    def number_below(self, x: np.ndarray) -> np.ndarray:
        rate = self.shape / self.mean
        return special.gammainc(self.shape, rate * x) / (self.mean * special.gammainc(self.shape + 1, rate))

    def mass_density(self, x: np.ndarray) -> np.ndarray:
        return x**self.shape * np.exp(-self.shape * x / self.mean)


@dataclass(frozen=True)
class FromPieces(Daughters):
    """A user's own: a function of the parent's mass that returns (masses, expected numbers) of its fragments.

    Examples
    --------
    >>> from pbekit.balance import FromPieces

    Erosion: one primary comes off a parent of m primaries.

    >>> erosion = FromPieces(lambda m: ([1.0, m - 1.0], [1.0, 1.0]))
    >>> sizes, numbers = erosion.pieces(10.0)
    >>> sizes.tolist(), numbers.tolist()
    ([1.0, 9.0], [1.0, 1.0])
    """

    function: Callable[[float], tuple[ArrayLike, ArrayLike]]

    @property
    def name(self) -> str:
        return getattr(self.function, "__name__", "function")

    def pieces(self, parent: float) -> tuple[np.ndarray, np.ndarray]:
        try:
            mass, number = (np.atleast_1d(np.asarray(v, float)) for v in self.function(parent))
        except (TypeError, ValueError):
            mass, number = np.zeros(0), np.zeros(0)
        if mass.ndim != 1 or mass.shape != number.shape or not mass.size:
            raise KernelError(
                f"daughters {self.name}: expected two arrays of one length, masses and expected numbers, for a parent of "
                f"{parent:g}"
            )
        if np.any(~np.isfinite(number)) or np.any(number < 0) or np.any(mass <= 0):
            raise KernelError(f"daughters {self.name}: negative or not finite for a parent of {parent:g}")
        total = float(mass @ number)
        if abs(total - parent) > 1e-9 * parent:
            raise KernelError(
                f"daughters {self.name}: fragments of a parent of {parent:g} weigh {total:g}; mass must be conserved"
            )
        return mass, number * (parent / total)


def as_daughters(daughters: object) -> Daughters:
    """What a user brings, as Daughters."""
    if isinstance(daughters, Daughters):
        return daughters
    if callable(daughters):
        return FromPieces(daughters)
    raise KernelError(
        f"daughters: expected a Daughters or a function of the parent's mass, got {daughters!r}"
    )
