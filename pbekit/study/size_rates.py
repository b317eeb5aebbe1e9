"""What a table says of each pair of sizes, in the units that other solvers take: rates to read, to plot and to hand over.

Everything is the mean over shapes: one class per size.  The rates are those of the balance itself (`EstimatedRates` on a grid
without shapes), so that whoever solves with them solves the same balance.  Limits of a pair's probabilities are those of its own
counts (Wilson 1927), widened to hold the value, which leans on a law fitted to all pairs; where a pair was not tried, and of what
sums over pairs, they come from the balance's posterior draws.

    K_ij = f_ij eta_ij [m^3/s]     aggregation of i with j;  f_ij = (4/3) g <(R_i + R_j)^3>
    B_ij = f_ij p_ij [m^3/s]       encounters of i with j after which other sets of primaries are left: fragments, exchange
    nu_k(ij)                       expected products in class k of such an encounter

    dn_k/dt = sum over pairs i <= j of n_i n_j / (1 + delta_ij)
              * [K_ij (a_k(ij) - delta_ki - delta_kj) + B_ij (nu_k(ij) - delta_ki - delta_kj)]

with a_k(ij) the product of aggregation on the pivots.  Breakup is of second order in number.  Solvers that know breakup of
first order alone take what it amounts to in one population n (`FirstOrder`), which is proportional to phi g:

    encounters of i that break        M_i = sum_j B_ij n_j
    binary breakups of i              S_i = sum_j B_ij n_j w_ij (nu(ij) - 2),  w_ij = (P_i - 1)/(P_i + P_j - 2)

where nu = sum_k nu_k, and S_i is the rate at which parents that fall in two would make as many new aggregates: an encounter's
new aggregates are shared between its parents in proportion to the fewest bonds that hold them, so that primaries have none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from pbekit import arguments
from pbekit.arguments import LEVEL
from pbekit.balance.grid import Grid
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import (
    JOIN,
    SCATTER,
    EstimatedRates,
    Rates,
    grid_for,
    start_of,
)
from pbekit.study.evidence import supported_steady_state
from pbekit.study.uncertainty import band
from pbekit.tables.kernel_table import KernelTable

MOMENTS = 6
"""Orders 0 to 5 of the daughters."""


@dataclass(frozen=True)
class Limits:
    """A quantity with the limits of its 90 % interval, all of one shape."""

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, value: np.ndarray, draws: np.ndarray) -> Limits:
        """From the mean and draws (draws, ...)."""
        low, high = band(draws)
        return cls(value, low, high)


@dataclass(frozen=True)
class FirstOrder:
    """What breakup by encounters amounts to as breakup of first order, in one population.

    Parameters
    ----------
    population : (S,) [1/m^3]
    volume_fraction : of primaries
    words : which population this is
    meeting, breakage : (S,) [1/s] M_i and S_i of the module's description
    """

    population: np.ndarray
    volume_fraction: float
    words: str
    meeting: Limits
    breakage: Limits


@dataclass(frozen=True)
class SizeRates:
    """Rates of a table between S classes of size, with their limits.

    Parameters
    ----------
    table : of the encounters
    grid : S whole numbers of primaries, one shape each
    outer_radius, radius_of_gyration : (S,) [m]
    trials, aggregated, broken : (S, S) encounters counted in the pair of tabulated classes that holds the pair
    encounter_rate : (S, S) [m^3/s] f_ij
    efficiency, breakup : (S, S) eta_ij and p_ij
    aggregation_rate, breakup_rate : (S, S) [m^3/s] K_ij and B_ij
    daughters : (S, S, S) nu_k(ij); products beyond the last pivot are put on it with their mass
    daughters_error : (S, S, S) standard errors
    extrapolated : (S, S) whether nobody sampled the pair's class, or sizes beyond those seen
    first_order : in one population, or None where there is none
    no_first_order : why there is none
    """

    table: KernelTable
    grid: Grid
    outer_radius: np.ndarray
    radius_of_gyration: np.ndarray
    trials: np.ndarray
    aggregated: np.ndarray
    broken: np.ndarray
    encounter_rate: Limits
    efficiency: Limits
    breakup: Limits
    aggregation_rate: Limits
    breakup_rate: Limits
    daughters: np.ndarray
    daughters_error: np.ndarray
    extrapolated: np.ndarray
    first_order: FirstOrder | None
    no_first_order: str = ""

    @property
    def pivots(self) -> np.ndarray:
        """(S,) primaries of each class."""
        return self.grid.pivots

    @property
    def breaks(self) -> bool:
        """Whether any encounter broke an aggregate."""
        return bool(self.broken.sum() > 0)

    def moments(self) -> np.ndarray:
        """(S, S, MOMENTS) of the daughters over x = P_k/(P_i + P_j): order 0 is their number, order 1 is one."""
        total = self.pivots[:, None] + self.pivots[None]
        x = self.pivots / total[..., None]
        return np.stack([(self.daughters * x**m).sum(axis=2) for m in range(MOMENTS)], axis=2)


def size_rates(
    table: KernelTable,
    *,
    draws: int = 60,
    seed: int = 0,
    exact_to: int = 32,
    largest: int | None = None,
    volume_fraction: float | None = None,
    population: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> SizeRates:
    """Rates of a table between classes of size.

    Parameters
    ----------
    table : KernelTable
        Of encounters.
    draws : int
        Posterior draws for the 90 % limits.
    seed : int
        Of the draws.
    exact_to, largest : int
        Sizes with a class of their own, and the largest size (twice the largest seen by default).
    volume_fraction : float
        Of primaries [-], for the first-order rates; that of the table's scene by default.
    population : array_like, (S,)
        Numbers in any unit in which first-order rates are wanted; the steady ones by default.
    progress : callable
        Called with the share that is done.

    Returns
    -------
    SizeRates
        Of each pair of classes aggregation and breakup [m^3/s], of each class breakage [1/s] and daughters, with 90 % limits.

    Raises
    ------
    PBEError
        Of a table without resolved encounters, or options that do not fit.

    Examples
    --------
    >>> import pbekit
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> rates = pbekit.size_rates(table, draws=20, largest=40)
    >>> size = list(rates.pivots).index(10.0)
    >>> f"10 + 10: K = {rates.aggregation_rate.value[size, size]:.1e} m^3/s of f = {rates.encounter_rate.value[size, size]:.1e}"
    '10 + 10: K = 9.6e-15 m^3/s of f = 6.6e-13'
    """
    arguments.draws(draws)
    grid = grid_for(table, exact_to, largest, shapes=None)
    estimated = EstimatedRates(table, grid)
    mean = estimated.mean_rates
    pair = estimated.cell_pair
    counts = np.bincount(estimated.table.pair * 3 + estimated.kind, minlength=3 * estimated.table.pairs)
    counts = counts.reshape(-1, 3)[pair]
    chosen, why = _population(estimated, volume_fraction, population)
    middle = _quantities(mean, grid, None if chosen is None else chosen[0])
    drawn: dict[str, list[np.ndarray]] = {name: [] for name in middle}
    total, square = (np.zeros_like(mean.fragments) for _ in range(2))
    for k in range(draws):
        rates = estimated.rates(np.random.default_rng([seed, k]))
        for name, value in _quantities(rates, grid, None if chosen is None else chosen[0]).items():
            drawn[name].append(value)
        total += rates.fragments
        square += rates.fragments**2
        if progress is not None:
            progress((k + 1) / draws)
    limits = {name: Limits.of(middle[name], np.array(rows)) for name, rows in drawn.items()}
    for probability, rate, kind in (
        ("efficiency", "aggregation_rate", JOIN),
        ("breakup", "breakup_rate", SCATTER),
    ):
        # Of encounters with weights counts say nothing: limits are those of the draws.
        if not estimated.records.weighted:
            limits[probability] = _counted(limits[probability], counts[..., kind], counts.sum(axis=-1))
        own, f = limits[probability], mean.encounters
        limits[rate] = Limits(f * own.value, f * own.low, f * own.high)
    # One more event of unknown kind is allowed for: draws say nothing of sizes that no event near a pair gave.
    near = estimated._fragment_norm if estimated.scattered.size else None
    more = np.inf if near is None else (near.multiply(near)).sum(axis=1) / near.sum(axis=1) ** 2
    deviation = np.sqrt(
        np.maximum(square - total**2 / draws, 0.0) / (draws - 1) + np.reshape(more, (-1, 1)) ** 2
    )
    first = None
    if chosen is not None:
        numbers, phi, words = chosen
        first = FirstOrder(numbers, phi, words, limits["meeting"], limits["breakage"])
    return SizeRates(
        table=table,
        grid=grid.with_outer_radius(mean.radius_moments[0]),
        outer_radius=mean.radius_moments[0],
        radius_of_gyration=estimated.radius_of_gyration,
        trials=counts.sum(axis=-1),
        aggregated=counts[..., JOIN],
        broken=counts[..., SCATTER],
        encounter_rate=limits["encounter_rate"],
        efficiency=limits["efficiency"],
        breakup=limits["breakup"],
        aggregation_rate=limits["aggregation_rate"],
        breakup_rate=limits["breakup_rate"],
        daughters=_square(mean.fragments[:, : grid.sizes], grid.sizes),
        daughters_error=_square(deviation[:, : grid.sizes], grid.sizes),
        extrapolated=estimated.extrapolated,
        first_order=first,
        no_first_order=why,
    )


def _counted(drawn: Limits, count: np.ndarray, trials: np.ndarray) -> Limits:
    """Limits by the counts of each pair where there are any, widened to hold the value; those of the draws elsewhere."""
    z = stats.norm.ppf(0.5 * (1 + LEVEL))
    n = np.maximum(trials, 1)
    share = count / n
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * np.sqrt(share * (1 - share) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    low, high = np.maximum(middle - half, 0.0), np.minimum(middle + half, 1.0)
    tried = trials > 0
    return Limits(
        drawn.value,
        np.where(tried, np.minimum(np.where(count > 0, low, 0.0), drawn.value), drawn.low),
        np.where(tried, np.maximum(np.where(count < trials, high, 1.0), drawn.value), drawn.high),
    )


def _square(rows: np.ndarray, sizes: int) -> np.ndarray:
    """(S, S, S) from a row per pair i <= j."""
    low, high = (
        np.minimum.outer(np.arange(sizes), np.arange(sizes)),
        np.maximum.outer(np.arange(sizes), np.arange(sizes)),
    )
    return rows[high * (high + 1) // 2 + low]


def _quantities(rates: Rates, grid: Grid, population: np.ndarray | None) -> dict[str, np.ndarray]:
    eta, p = rates.outcomes[..., JOIN], rates.outcomes[..., SCATTER]
    broken = rates.encounters * p
    found = {
        "encounter_rate": rates.encounters,
        "efficiency": eta,
        "breakup": p,
        "aggregation_rate": rates.encounters * eta,
        "breakup_rate": broken,
    }
    if population is not None:
        pieces = _square(rates.fragments[:, : grid.sizes].sum(axis=1)[:, None], grid.sizes)[..., 0]
        bonds = grid.pivots - 1.0
        share = bonds[:, None] / np.maximum(bonds[:, None] + bonds[None], 1.0)
        found["meeting"] = broken @ population
        # Placed on the last pivot with their mass alone, products may count as fewer than they are.
        found["breakage"] = (broken * share * np.maximum(pieces - 2.0, 0.0)) @ population
    return found


def _population(
    estimated: EstimatedRates, volume_fraction: float | None, given: ArrayLike | None
) -> tuple[tuple[np.ndarray, float, str] | None, str]:
    """Numbers [1/m^3], their volume fraction and which they are; or None, and why."""
    grid, table = estimated.grid, estimated.table
    phi = table.about.get("volume_fraction") if volume_fraction is None else volume_fraction
    if phi is None:
        return None, "the table does not say its volume fraction; give one"
    phi = arguments.volume_fraction(float(phi) if volume_fraction is None else phi)
    start = start_of(grid, table, phi)
    if given is not None:
        numbers = arguments.array("population", given, (grid.sizes,), "numbers of aggregates")
        if np.any(numbers < 0) or not numbers @ grid.mass > 0:
            raise PBEError("population: expected numbers of aggregates, none below 0 and not all 0")
        return (numbers * (start @ grid.mass) / (numbers @ grid.mass), phi, "the population given"), ""
    steady, evidence = supported_steady_state(estimated, start)
    if steady is None:
        return None, evidence.refusal(table)
    return (steady.population, phi, "the steady population"), ""
