"""How sure a balance is that rests on counted encounters, and which encounters to make next.

Bands come from draws of the whole estimated.  Variance shares come from one factorisation: at a steady state the adjoint
gives each event a value, the change of the wanted output per event, and the posterior variance is the sum over
encounters of the square of what their weight does (the infinitesimal jackknife, Efron 1982), so it falls to the pairs of
classes the encounters belong to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import xarray as xr

from pbekit.arguments import LARGEST_SEED, LEVEL, MOST_DRAWS, least_draws, number, whole_number
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import JOIN, SCATTER, SURVIVE, EstimatedRates
from pbekit.estimated_rates.logistic_law import LogisticLaw
from pbekit.solution.solve import integrate
from pbekit.solution.steady import NotReachedError, SteadyState, steady_state
from pbekit.tables.counts import weighted_share
from pbekit.tables.kernel_table import AGGREGATION, UNRESOLVED, KernelTable


class Drawn(Protocol):
    """What draws are made of: a `EstimatedRates`, or two (`between.InterpolatedRates`)."""

    def balance(
        self, rng: np.random.Generator | None = None, scheme: str = "fixed pivot"
    ) -> PopulationBalance: ...


def draws_of(
    estimated: Drawn,
    output: Callable[[PopulationBalance], Mapping[str, np.ndarray | float]],
    draws: int,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
    scheme: str = "fixed pivot",
) -> xr.Dataset:
    """`output` of posterior draws, stacked along `draw`; a draw that cannot be solved is an error, not left out.

    Parameters
    ----------
    estimated : EstimatedRates or InterpolatedRates
        From which rates are drawn.
    output : callable
        What is asked of a balance: a mapping of names to arrays.
    draws : int
        How many.
    seed : int
        Of the draws.
    progress : callable
        Called with how many are done.
    scheme : str
        "fixed pivot", "cell average" or "three pivots".

    Returns
    -------
    xarray.Dataset
        Each output, stacked along `draw`.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.estimated_rates import EstimatedRates
    >>> from pbekit.study import draws_of
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> estimated = EstimatedRates(table, pbekit.Grid.primaries(exact_to=16))

    The rate at which primaries alone begin to disappear, and how far the table leaves it open:

    >>> def loss(balance):
    ...     alone = np.zeros(balance.cells)
    ...     alone[0] = 1e14
    ...     return {"loss": -balance.rhs(0.0, balance.state(alone))[0] / 1e14}
    >>> drawn = draws_of(estimated, loss, draws=20)
    >>> drawn["loss"].sizes["draw"], bool(drawn["loss"].std() > 0)
    (20, True)
    """
    whole_number("draws", draws, 1, MOST_DRAWS)
    whole_number("seed", seed, 0, LARGEST_SEED)
    rows = []
    for k in range(draws):
        rows.append(output(estimated.balance(np.random.default_rng([seed, k]), scheme)))
        if progress is not None:
            progress(k + 1)
    names = rows[0].keys()
    stacked = {name: np.stack([np.asarray(row[name], float) for row in rows]) for name in names}
    return xr.Dataset(
        {n: (("draw", *(f"{n}_{d}" for d in range(v.ndim - 1))), v) for n, v in stacked.items()}
    )


def band(draws: np.ndarray, level: float = LEVEL, axis: int = 0) -> np.ndarray:
    """(2, ...) limits that hold the middle `level` of the draws; a further draw lies between them as often.

    Parameters
    ----------
    draws : (D, ...) array
        Along `axis`.
    level : float
        Of the band [-].
    axis : int
        Of the draws.

    Returns
    -------
    (2, ...) array
        Lower and upper limits.

    Raises
    ------
    PBEError
        For fewer draws than `least_draws`.

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit.study import band
    >>> band(np.arange(1.0, 20.0)).tolist()
    [1.0, 19.0]
    """
    number("level", level, 0.0, 0.9999)
    draws = np.asarray(draws, float)
    if draws.shape[axis] < least_draws(level):
        raise PBEError(
            f"draws: got {draws.shape[axis]}, expected {least_draws(level)} or more, the fewest that a {100 * level:g} % band "
            "can be read from"
        )
    ordered = np.sort(np.moveaxis(draws, axis, 0), axis=0)
    limits = []
    for tail in (0.5 * (1 - level), 0.5 * (1 + level)):
        at = np.clip(tail * (len(ordered) + 1) - 1, 0, len(ordered) - 1)
        below, above = ordered[int(at + 1e-9)], ordered[min(int(at + 1e-9) + 1, len(ordered) - 1)]
        # A draw may be without limit: then so is what lies beside it.
        step = np.where(above == below, 0.0, above - np.where(np.isinf(below), 0.0, below))
        share = max(at - int(at + 1e-9), 0.0)
        limits.append(below + share * step if share > 1e-9 else below)
    return np.stack(limits)


def steady_output(
    population: np.ndarray, volume_fraction_scale: float = 1.0, guess: np.ndarray | None = None
) -> Callable[[PopulationBalance], dict[str, np.ndarray | float]]:
    """An output for `draws_of`: the steady mean size, relative deviation and distribution reached from `population`.

    A draw in which sizes grow without end counts as that, sizes inf: it belongs to what a table leaves open.
    """

    def output(balance: PopulationBalance) -> dict[str, np.ndarray | float]:
        try:
            n = steady_state(balance, population * volume_fraction_scale, guess=guess).population
        except NotReachedError:
            return {
                "mean_size": np.inf,
                "relative_deviation": np.inf,
                "sauter_diameter": np.inf,
                "share": np.zeros(balance.grid.sizes),
            }
        return steady_summary(balance, n)

    return output


def steady_summary(balance: PopulationBalance, n: np.ndarray) -> dict[str, np.ndarray | float]:
    """<P>, sigma_P/<P>, d32 [m] and numbers per size of a population."""
    grid = balance.grid
    mean = n @ grid.mass / n.sum()
    radius = grid.state.outer_radius
    return {
        "mean_size": mean,
        "relative_deviation": np.sqrt(max(n @ grid.mass**2 / n.sum() - mean**2, 0.0)) / mean,
        "sauter_diameter": 2 * (n @ radius**3) / (n @ radius**2),
        "share": np.bincount(grid.size_of_cell, n) / n.sum(),
    }


def course_output(
    population: np.ndarray, times: np.ndarray, share_from: float | None = None, **options: Any
) -> Callable[[PopulationBalance], dict[str, np.ndarray]]:
    """An output for `draws_of`: <P>, sigma_P and d32 at the given times.

    share_from : [s], adds the number share of each size, averaged over the times from there on
    """

    def output(balance: PopulationBalance) -> dict[str, np.ndarray]:
        n = np.maximum(integrate(balance, population, times, **options)[:, : balance.cells], 0.0)
        grid, total = balance.grid, n.sum(axis=1)
        mean = n @ grid.mass / total
        radius = grid.state.outer_radius
        found = {
            "mean_size": mean,
            "size_deviation": np.sqrt(np.maximum(n @ grid.mass**2 / total - mean**2, 0.0)),
            "sauter_diameter": 2 * (n @ radius**3) / (n @ radius**2),
        }
        if share_from is not None:
            late = (n / total[:, None])[times >= share_from].mean(axis=0)
            found["late_share"] = np.bincount(grid.size_of_cell, late)
        return found

    return output


def eta_11(table: KernelTable) -> tuple[float, float, float]:
    """Efficiency of two primaries: share that aggregated, and its 90 % interval (`weighted_share`); nan without any pair."""
    r = table.records
    pair = (r.size == 1).all(axis=1) & (r.outcome != UNRESOLVED)
    return weighted_share(r.outcome[pair] == AGGREGATION, r.weight[pair])


def mean_size_gradient(balance: PopulationBalance, n: np.ndarray) -> np.ndarray:
    """(K,) d<P>/dn."""
    mass = balance.grid.mass
    return (mass - n @ mass / n.sum()) / n.sum()


@dataclass(frozen=True)
class VarianceShares:
    """Variance of one output of the steady state and where it comes from.

    of_pair : (pairs of classes) variance that encounters of each pair (and the few the prior stands for) leave
    of_law : variance through the law's coefficients, where classes lean on it
    deviation : square root of their sum
    flux : (pairs of classes) encounters per unit volume and time
    """

    of_pair: np.ndarray
    of_law: float
    flux: np.ndarray
    estimated: EstimatedRates

    @property
    def deviation(self) -> float:
        return float(np.sqrt(self.of_pair.sum() + self.of_law))

    def table(self) -> np.ndarray:
        """(C, C) shares of the variance, symmetric: a pair and its mirror hold the pair's share each."""
        return self.estimated.table.square(self.of_pair) / (self.of_pair.sum() + self.of_law)

    def largest(self, count: int = 10) -> list[tuple[str, float, int]]:
        """The pairs with the largest shares: (name, share, trials so far)."""
        table = self.estimated.table
        b, a = np.tril_indices(table.classes)
        total = self.of_pair.sum() + self.of_law
        return [
            (
                f"{table.class_name(a[k])} with {table.class_name(b[k])}",
                self.of_pair[k] / total,
                int(self.estimated.trials[k]),
            )
            for k in np.argsort(-self.of_pair)[:count]
        ]

    def next_trials(self, count: int, cost: np.ndarray | None = None) -> np.ndarray:
        """(pairs,) where to spend `count` more encounters so that the variance falls most (Neyman 1934).

        cost : (pairs,) of one encounter, in any unit; the allocation is in proportion to deviation per sqrt(cost)
        """
        trials = self.estimated.trials
        effective = trials + self.estimated.strength
        # What the law leaves uncertain falls to the pairs that lean on it.
        lean = self.flux * self.estimated.strength / effective
        law = self.of_law * lean / lean.sum() if lean.sum() > 0 else 0.0
        spread = np.sqrt((self.of_pair + law) * effective)
        if cost is not None:
            spread = spread / np.sqrt(
                np.where(cost > 0, cost, np.median(cost[cost > 0]) if np.any(cost > 0) else 1.0)
            )
        if spread.sum() == 0:
            return np.zeros(len(spread), int)
        wanted = (trials.sum() + count) * spread / spread.sum() - trials
        wanted = np.maximum(wanted, 0.0)
        share = wanted * (count / wanted.sum()) if wanted.sum() > 0 else wanted
        whole = np.floor(share).astype(int)
        rest = count - whole.sum()
        whole[np.argsort(whole - share)[:rest]] += 1
        return whole


def variance_shares(estimated: EstimatedRates, steady: SteadyState, gradient: np.ndarray) -> VarianceShares:
    """Shares of the variance of an output with this gradient (K,) in the populations of the steady state.

    Outcomes and fragments are resolved by pair of classes; shapes and radii, whose part is small, are left to the draws.
    """
    balance = steady.balance
    if balance.averaged:
        raise PBEError(
            "variance_shares: sensitivities are exact where the balance is bilinear; use scheme='fixed pivot'"
        )
    grid, n, table = balance.grid, steady.population, estimated.table
    value = steady.importance(gradient)
    weight = estimated.weights(None)
    met = estimated.encounter_rate(weight) * np.outer(n, n)
    met *= np.where(np.eye(grid.cells, dtype=bool), 0.5, 1.0)
    upper = np.triu(np.ones_like(met)) > 0
    worth = _values(balance, value)  # (3, K, K)

    p = estimated.probabilities(weight, None)
    flux = np.bincount(estimated.cell_pair[upper], met[upper], table.pairs)
    gain = np.stack(
        [np.bincount(estimated.cell_pair[upper], (met * w)[upper], table.pairs) for w in worth], axis=1
    )  # (pairs, 3) change of the output per unit of probability
    per_encounter = np.zeros(len(estimated.records))
    of_prior = np.zeros(table.pairs)
    if estimated.smooth:
        of_law = _law_variance(
            estimated,
            lambda law: float(
                (met * (law(estimated._cell_features).transpose(2, 0, 1) * worth).sum(axis=0))[upper].sum()
            ),
        )
    else:
        effective = np.bincount(table.pair, weight, table.pairs) + estimated.strength
        surprise = (gain - (p * gain).sum(axis=1, keepdims=True)) / effective[:, None]
        per_encounter += surprise[table.pair, estimated.kind]
        prior = estimated.strength * estimated.law(estimated._class_features)
        of_prior = (surprise**2 * prior).sum(axis=1)
        lean = (estimated.strength / effective)[:, None]
        of_law = _law_variance(
            estimated, lambda law: float((lean * law(estimated._class_features) * gain).sum())
        )
    per_encounter[estimated.scattered] += _fragment_slopes(estimated, balance, value, met, p)
    of_pair = np.bincount(table.pair, (weight * per_encounter) ** 2, table.pairs) + of_prior
    return VarianceShares(of_pair, of_law, flux, estimated)


def _slot_values(balance: PopulationBalance, value: np.ndarray) -> np.ndarray:
    """(variants, S) value of a product of each size, by the variant of its shape."""
    g = balance.arrays.geometry
    return np.stack([np.bincount(g.size_of_cell, share * value) for share in g.share])


def _values(balance: PopulationBalance, value: np.ndarray) -> np.ndarray:
    """(3, K, K) change of the output per event: survive, join, scatter."""
    arrays, cells = balance.arrays, balance.cells
    g, enc = arrays.geometry, arrays.encounters
    slot = np.zeros((len(g.share), balance.grid.sizes + g.tail))
    slot[:, : balance.grid.sizes] = _slot_values(balance, value)
    made = enc.products
    of_entry = np.repeat(made.slot - made.run[:-1], np.diff(made.run)) + np.arange(made.number.size)
    start = made.run[made.row]
    row_value = np.add.reduceat(np.append(made.number * slot.ravel()[of_entry], 0.0), start[:-1])
    row_value = np.where(np.diff(start) > 0, row_value, 0.0)
    of_class = np.searchsorted(g.class_start, np.arange(cells), side="right") - 1
    high = np.maximum(of_class[:, None], of_class[None])
    low = np.minimum(of_class[:, None], of_class[None])
    products = row_value[enc.row[:, high * (high + 1) // 2 + low]]
    out = np.zeros((3, cells, cells))
    parents = value[:, None] + value[None]
    out[JOIN], out[SCATTER] = products[0] - parents, products[1] - parents
    r = arrays.restructuring
    if r.first_cell.size:
        shapes = r.transition.shape[2]
        spread = np.zeros((cells, shapes))
        size = np.bincount(g.size_of_cell)[g.size_of_cell]
        for s in range(shapes):
            has = size > s
            spread[has, s] = value[(r.first_cell + s)[has]]
        after = np.einsum("gks,ks->gk", r.transition, spread)  # (G, K)
        group = np.searchsorted(r.partner_start, np.arange(cells), side="right") - 1
        change = after[group].T - value[:, None]  # (K, K): of i after meeting j
        out[SURVIVE] = change + change.T
    return out


def _fragment_slopes(
    estimated: EstimatedRates, balance: PopulationBalance, value: np.ndarray, met: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """(scattered encounters,) change of the output with the weight of each, through what others' fragments become."""
    if estimated.scattered.size == 0:
        return np.zeros(0)
    grid = balance.grid
    scattering = met * (p if estimated.smooth else p[estimated.cell_pair])[..., SCATTER]
    starts = np.searchsorted(grid.size_of_cell, np.arange(grid.sizes))
    per_size = np.add.reduceat(np.add.reduceat(scattering, starts, axis=0), starts, axis=1)
    # `met` holds each unordered pair of cells twice off the diagonal, once halved on it.
    high, low = np.tril_indices(grid.sizes)
    flux = per_size[high, low]
    same = high == low
    inner = np.array(
        [np.triu(scattering[a:b, a:b]).sum() for a, b in zip(starts, np.append(starts[1:], grid.cells))]
    )
    flux[same] = inner
    g, enc = balance.arrays.geometry, balance.arrays.encounters
    variant = enc.products.slot[enc.products.row[enc.row[1, -1]]] // (grid.sizes + g.tail)
    slot = np.append(_slot_values(balance, value)[variant], [0.0, 0.0])
    near, fragments = estimated._fragment_norm, estimated._fragments
    weight = estimated.records.weight[estimated.scattered]
    norm = near @ weight
    per_event = fragments.T @ (np.repeat(flux / norm, slot.size) * np.tile(slot, len(flux)))
    mean = (fragments @ weight).reshape(len(flux), -1) @ slot / norm
    return per_event - near.T @ (flux / norm * mean)


def _law_variance(estimated: EstimatedRates, output: Callable[[LogisticLaw], float]) -> float:
    """Variance of `output(law)` through the law's coefficients, to first order."""
    law = estimated.law
    flat = law.coefficients.ravel()
    slope = np.zeros(flat.size)
    for k in range(flat.size):
        step = 1e-4
        ends = []
        for sign in (1, -1):
            moved = flat.copy()
            moved[k] += sign * step
            ends.append(
                output(
                    type(law)(moved.reshape(law.coefficients.shape), law.covariance, law.centre, law.scale)
                )
            )
        slope[k] = (ends[0] - ends[1]) / (2 * step)
    return float(slope @ law.covariance @ slope)
