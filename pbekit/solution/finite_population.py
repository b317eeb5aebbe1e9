"""The rates of a table in a finite population: what the balance leaves out by averaging over infinitely many.

The same encounters, outcomes, fragments and shapes as in the balance, drawn one at a time for a sample of some hundred
aggregates that is doubled when it has become small, as in the Monte Carlo the table came from.  Its mean over replicas
against the balance is the error of the mean field; its spread is what one run can be expected to show.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from pbekit import arguments
from pbekit.balance.encounters import ShapeMemory
from pbekit.balance.grid import Grid
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import SURVIVE, EstimatedRates
from pbekit.solution import compiled_population


def population_course(
    estimated: EstimatedRates,
    volume_fraction: float,
    times: np.ndarray,
    *,
    initial: int = 200,
    doubling_below: float = 0.75,
    replicas: int = 8,
    steady_from: float | None = None,
    seed: int = 0,
    largest: int = 4000,
    drawn: bool = False,
    progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """<P>, sigma_P, d32 over time of each replica of a finite population, and sizes counted once it is steady.

    Parameters
    ----------
    estimated : EstimatedRates
        Rates of a table.
    volume_fraction : float
        Of primaries [-].
    times : (T,) array
        At which the population is looked at [s].
    initial : int
        Primaries at the start.
    doubling_below : float
        Share of the initial number of aggregates below which the sample is doubled [-].
    replicas : int
        How many populations are followed.
    steady_from : float
        From when on sizes are counted [s]; the last 40 % by default.
    seed : int
        Of all draws.
    largest : int
        Primaries of the largest aggregate that is followed.
    drawn : bool
        Whether each replica follows its own posterior draw of the estimated rates, so that their spread is that of one run to
        come: what the table leaves open and what a finite population scatters, together.
    progress : callable
        Called with how many replicas are done.

    Returns
    -------
    xarray.Dataset
        Over `replica` and `time`, sizes in primaries, lengths in m.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> from pbekit.estimated_rates import EstimatedRates
    >>> from pbekit.solution import population_course
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> estimated = EstimatedRates(table, pbekit.Grid.primaries(exact_to=16, largest=40), outcomes="smooth")
    >>> course = population_course(estimated, 1e-4, np.linspace(0.0, 5.0, 6), initial=100, replicas=2)
    >>> course["mean_size"].shape
    (2, 6)
    """
    arguments.volume_fraction(volume_fraction)
    times = arguments.array("times", times, (None,), "times")
    if not times.size or np.any(np.diff(times) < 0) or times[0] < 0:
        raise PBEError("times must be 0 or more and ascend")
    arguments.whole_number("initial", initial, 2, 10**6)
    arguments.number("doubling_below", doubling_below, 0.0, 1.0)
    arguments.whole_number("replicas", replicas, 1, 10**6)
    arguments.whole_number("largest", largest, 1, 10**7)
    arguments.whole_number("seed", seed, 0, arguments.LARGEST_SEED)
    lookup = None if drawn else _lookup(estimated, largest)
    volume = initial * 4 / 3 * np.pi * estimated.table.radius**3 / volume_fraction
    since = 0.6 * times[-1] if steady_from is None else steady_from
    series = np.zeros((replicas, times.size, 6))
    counted = np.zeros((replicas, largest + 1))
    shapes = estimated.grid.shapes
    for r in range(replicas):
        if drawn:
            lookup = _lookup(estimated, largest, np.random.default_rng([seed, r, 1]))
        sizes, shape = np.ones(64 * initial, np.int64), np.full(64 * initial, shapes, np.int64)
        keep = int(np.ceil(doubling_below * initial))
        compiled_population.finite_population(
            lookup,
            compiled_population.Population(sizes, shape, initial, volume, keep),
            times,
            np.random.default_rng([seed, r]),
            compiled_population.Samples(series[r], counted[r], int(np.searchsorted(times, since))),
        )
        if progress is not None:
            progress(r + 1)
    number, mass, square = series[..., 0], series[..., 2], series[..., 3]
    mean = mass / number
    return xr.Dataset(
        {
            "mean_size": (("replica", "time"), mean, {"units": "1"}),
            "size_deviation": (
                ("replica", "time"),
                np.sqrt(np.maximum(square / number - mean**2, 0)),
                {"units": "1"},
            ),
            "sauter_diameter": (("replica", "time"), 2 * series[..., 5] / series[..., 4], {"units": "m"}),
            "share": (
                ("replica", "size"),
                counted / np.maximum(counted.sum(axis=1, keepdims=True), 1),
                {"units": "1"},
            ),
        },
        coords={"time": ("time", times, {"units": "s"}), "size": np.arange(largest + 1)},
    )


def _lookup(
    estimated: EstimatedRates, largest: int, rng: np.random.Generator | None = None
) -> compiled_population.Lookup:
    grid, table = estimated.grid, estimated.table
    weight = estimated.weights(rng)
    nearest_size = np.abs(
        np.log(np.maximum(np.arange(largest + 1), 1))[:, None] - np.log(grid.pivots)[None]
    ).argmin(axis=1)
    first = np.searchsorted(grid.size_of_cell, np.arange(grid.sizes))
    count = np.bincount(grid.size_of_cell)
    shapes = grid.shapes
    cell = np.zeros((largest + 1, shapes + 1), np.int64)
    for s in range(shapes):
        cell[:, s] = first[nearest_size] + np.minimum(s, count[nearest_size] - 1)
    cell[:, shapes] = first[nearest_size]

    p = estimated.probabilities(weight, rng)
    p = p if estimated.smooth else p[estimated.cell_pair]
    share_join = np.ones((1, grid.cells))
    share_scatter = np.ones(grid.cells)
    kept = np.ones((1, grid.cells, 1))
    if shapes > 1:
        joined, share_scatter = estimated.shapes_of_products(weight, rng)
        share_join = joined.shares if isinstance(joined, ShapeMemory) else joined[None]
        kept = estimated.transitions(weight, rng)
    cumulate = lambda rows: np.stack([_by_size(r, grid) for r in np.atleast_2d(rows)])
    if estimated.scattered.size:
        near = estimated._fragment_norm
        cumulative = near.data * weight[estimated.scattered][near.indices]
        for a, b in zip(near.indptr[:-1], near.indptr[1:], strict=True):
            cumulative[a:b] = np.cumsum(cumulative[a:b]) / cumulative[a:b].sum()
        r = estimated.records
        products = r.products[estimated.scattered]
        start = np.concatenate([[0], np.cumsum(r.products)])[estimated.scattered]
        rows = np.concatenate([np.arange(a, a + n) for a, n in zip(start, products, strict=True)])
        near_start, near_event = near.indptr.astype(np.int64), near.indices.astype(np.int64)
        event_start, event_size = np.concatenate([[0], np.cumsum(products)]), r.product_size[rows]
    else:
        pairs = grid.sizes * (grid.sizes + 1) // 2
        near_start, near_event, cumulative = np.arange(pairs + 1), np.zeros(pairs, np.int64), np.ones(pairs)
        event_start, event_size = np.array([0, 2]), np.array([5, 5])
    return compiled_population.Lookup(
        cell,
        estimated.radius_moments(weight),
        np.ascontiguousarray(np.cumsum(p, axis=-1)[..., : SURVIVE + 2]),
        nearest_size.astype(np.int64),
        near_start,
        near_event,
        cumulative,
        event_start.astype(np.int64),
        event_size.astype(np.int64),
        cumulate(share_join),
        _by_size(share_scatter, grid),
        np.cumsum(kept, axis=2),
        (np.searchsorted(estimated.partner_start, np.arange(grid.cells), side="right") - 1).astype(np.int64),
        grid.shape_of_cell.astype(np.int64),
        first[grid.size_of_cell].astype(np.int64),
        4 / 3 * table.shear_rate,
    )


def _by_size(share: np.ndarray, grid: Grid) -> np.ndarray:
    """(K,) shares of the shapes of each size, cumulated within the size."""
    total = np.cumsum(share)
    first = np.searchsorted(grid.size_of_cell, grid.size_of_cell)
    return total - np.where(first > 0, total[first - 1], 0.0)
