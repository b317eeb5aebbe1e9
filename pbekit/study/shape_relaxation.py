"""Restructuring as relaxation of shape: how encounters that both aggregates survive draw the shape of each to a resting one.

Of survivors of a size class, whose shape coordinate is x before and x' after an encounter,

    <ln x'> - ln x = -kappa (ln x - ln x_r)

kappa is the share of the way to the resting shape x_r that one encounter takes an aggregate, and M kappa [1/s], with M the
encounters that it survives per unit time, the rate of relaxation.  M goes with phi g and with the population, so a rate is of
those of the first-order rates (`size_rates`).  Encounters count as often as they happen there, whatever they were designed for:
those of a pair of classes share the rate at which this pair meets.

kappa and ln x_r are of weighted least squares over the encounters themselves; limits are of 90 %, by the scatter of
single encounters.  A negative kappa (shapes spread) is reported as such and has no resting shape.
A class with fewer than `FEWEST` survivors of known shape, or of one shape alone, says nothing, and is refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from pbekit.arguments import LEVEL
from pbekit.errors import PBEError
from pbekit.study.fitted_form import widened
from pbekit.study.size_rates import Limits, SizeRates
from pbekit.tables.kernel_table import UNRESOLVED

FEWEST = 50
"""Survivors of a class below which nothing is said of it."""


@dataclass(frozen=True)
class ShapeRelaxation:
    """Relaxation of shape of C size classes of three primaries or more; nan where unseen.

    Parameters
    ----------
    shape_name : str
        The coordinate x.
    low, high : (C,) int
        Smallest and largest size of each class.
    survivors : (C,) int
        Aggregates that an encounter left whole, with their shapes known.
    kappa : Limits
        (C,) share of the way to rest that an encounter takes [-].
    resting_shape : Limits
        (C,) x_r.
    spread : (C,)
        Standard deviation of ln x' about its mean given x.
    surviving : (C,) [1/s]
        M, encounters that an aggregate survives per unit time.
    rate : Limits
        (C,) M kappa [1/s].
    """

    shape_name: str
    low: np.ndarray
    high: np.ndarray
    survivors: np.ndarray
    kappa: Limits
    resting_shape: Limits
    spread: np.ndarray
    surviving: np.ndarray
    rate: Limits

    def of(self, size: int) -> tuple[float, float]:
        """(rate [1/s], resting shape) of aggregates of so many primaries.

        Raises
        ------
        PBEError
            Of sizes whose change of shape was not seen, or that have no resting shape.
        """
        at = np.flatnonzero((self.low <= size) & (size <= self.high))
        if at.size == 0 or not np.isfinite(self.kappa.value[at[0]]):
            seen = np.isfinite(self.kappa.value)
            known = (
                f"from {self.low[seen].min()} to {self.high[seen].max()} primaries" if seen.any() else "none"
            )
            raise PBEError(
                f"relaxation of shape: P = {size}: expected a class with {FEWEST} survivors of known shape or more ({known})"
            )
        if not np.isfinite(self.resting_shape.value[at[0]]):
            raise PBEError(
                f"relaxation of shape: P = {size}: encounters do not draw these to a resting shape"
            )
        return float(self.rate.value[at[0]]), float(self.resting_shape.value[at[0]])


def shape_relaxation(rates: SizeRates) -> ShapeRelaxation:
    """Relaxation of shape by encounters that both survive, in the population of the first-order rates.

    Parameters
    ----------
    rates : SizeRates
        Of a table, from `size_rates`.

    Returns
    -------
    ShapeRelaxation
        By class of size, with 90 % limits.

    Raises
    ------
    PBEError
        Where there is no population, or no class with enough survivors.

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.study import shape_relaxation
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> try:
    ...     shape_relaxation(pbekit.size_rates(table, draws=19))
    ... except pbekit.PBEError as problem:
    ...     print(str(problem)[:41])
    relaxation of shape is of a population: n
    """
    first, table, r = rates.first_order, rates.table, rates.table.records
    if first is None:
        raise PBEError(f"relaxation of shape is of a population: {rates.no_first_order}")
    before, after = _logarithms(rates)
    kept = (r.survivors >= 0) & (r.size > 2) & np.isfinite(before) & np.isfinite(after)
    kept &= (r.outcome != UNRESOLVED)[:, None]
    weight = _happening(rates)
    own_class = table.size_class(r.size)
    edges = np.asarray(table.size_edges)
    classes = np.flatnonzero(edges[:-1] > 2)
    survive = 1.0 - rates.efficiency.value - rates.breakup.value
    surviving_of_pivot = (rates.encounter_rate.value * survive) @ first.population
    found = np.full((classes.size, 7), np.nan)
    count, spread, surviving = (
        np.zeros(classes.size, int),
        np.full(classes.size, np.nan),
        np.full(classes.size, np.nan),
    )
    z = float(stats.norm.ppf(0.5 * (1 + LEVEL)))
    for row, c in enumerate(classes):
        event, side = np.nonzero(kept & (own_class == c))
        count[row] = event.size
        within = (rates.pivots >= edges[c]) & (rates.pivots < edges[c + 1])
        if within.any():
            surviving[row] = _mean(surviving_of_pivot[within], first.population[within])
        x, w = before[event, side], weight[event]
        if event.size < FEWEST or np.ptp(x) == 0 or not np.any(w > 0):
            continue
        found[row], spread[row] = _relaxed(x, after[event, side] - x, w, z)
    if not np.isfinite(found[:, 0]).any():
        raise PBEError(
            f"relaxation of shape: no class of sizes has {FEWEST} survivors whose {table.shape_name} is known before and after"
        )
    kappa, rest = Limits(*found[:, :3].T), Limits(*found[:, 3:6].T)
    rate = Limits(surviving * kappa.value, surviving * kappa.low, surviving * kappa.high)
    return ShapeRelaxation(
        table.shape_name, edges[classes], edges[classes + 1] - 1, count, kappa, rest, spread, surviving, rate
    )


def _logarithms(rates: SizeRates) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) ln x of both parents before, and of each as a survivor; nan where unknown."""
    table, r = rates.table, rates.table.records
    x, products = (
        r.shape(table.shape_name, table.radius),
        r.product_shape(table.shape_name, table.radius),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        before = np.log(x)
        after = np.where(r.survivors >= 0, np.log(products)[np.maximum(r.survivors, 0)], np.nan)
    return before, after


def _happening(rates: SizeRates) -> np.ndarray:
    """(n,) how often each encounter stands for one of the population: so often its pair of classes meets, over its trials."""
    first, table = rates.first_order, rates.table
    assert first is not None
    n = first.population
    of_class = table.size_class(rates.pivots)
    many = len(table.size_edges) - 1
    met = np.zeros((many, many))
    np.add.at(met, (of_class[:, None], of_class[None]), rates.encounter_rate.value * np.outer(n, n))
    own = table.size_class(table.records.size)
    a, b = own.min(axis=1), own.max(axis=1)
    trials = np.zeros((many, many))
    weight = table.records.weight
    np.add.at(trials, (a, b), weight)
    return np.asarray(weight * met[a, b] / trials[a, b])


def _mean(value: np.ndarray, weight: np.ndarray) -> float:
    """Weighted, or plain where there is no weight."""
    return float(np.average(value, weights=weight) if weight.sum() > 0 else value.mean())


def _relaxed(x: np.ndarray, change: np.ndarray, weight: np.ndarray, z: float) -> tuple[np.ndarray, float]:
    """(kappa and x_r with their limits, and the standard error of kappa), and the spread about them."""
    root, middle = np.sqrt(weight / weight.max()), np.average(x, weights=weight)
    design = np.stack([np.ones(x.size), x - middle], axis=1)
    c, *_ = np.linalg.lstsq(design * root[:, None], change * root, rcond=None)
    left = change - design @ c
    covariance = widened(design * root[:, None], left * root)
    kappa, error = -c[1], float(np.sqrt(covariance[1, 1]))
    found = np.full(7, np.nan)
    found[[0, 1, 2, 6]] = kappa, kappa - z * error, kappa + z * error, error
    if kappa - z * error > 0:
        # ln x_r = middle + c_0/kappa.
        rest = middle + c[0] / kappa
        slope = np.array([1.0 / kappa, c[0] / kappa**2])
        half = z * float(np.sqrt(slope @ covariance @ slope))
        found[3:6] = np.exp([rest, rest - half, rest + half])
    return found, float(np.sqrt(np.average(left**2, weights=weight)))
