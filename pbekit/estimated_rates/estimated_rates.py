"""From tabulated encounters to the rates of a balance.

Everything here is a function of one weight per encounter.  Weights of one (the table's own, where encounters were drawn by
importance) give the mean; these times weights drawn from the exponential distribution give a draw of the posterior (the Bayesian
bootstrap, Rubin 1981), in which outcomes of a pair
of classes are Dirichlet and every draw is physical: probabilities add to one, products have exactly their parents' mass.
Encounters that shape several rates at once keep them consistent within a draw.

Where little was sampled a law takes over, with the uncertainty of few data:
outcomes    per pair of classes, with a fitted multinomial logistic law of both sizes and shapes as prior, of as many
            pseudo-encounters as the classes' scatter about the law asks for (or the law alone: outcomes="smooth");
fragments   of the nearest scattered encounters in total size and size ratio, scaled to the pair at hand;
shapes      of the nearest products in size, with their spread over all sizes as prior;
radii       R/(a P^(1/2)) of the nearest aggregates in size, of the same shape.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, sparse, special

from pbekit import arguments
from pbekit.arguments import MOST_EXACT, whole_number
from pbekit.balance.encounters import (
    Aggregation,
    CollisionalBreakup,
    Event,
    PairRows,
    Restructuring,
    ShapeMemory,
)
from pbekit.balance.grid import LARGEST, Grid
from pbekit.balance.population_balance import EDGES, PopulationBalance
from pbekit.errors import PBEError
from pbekit.estimated_rates.kernel_smoothing import nearest
from pbekit.estimated_rates.logistic_law import LogisticLaw
from pbekit.tables.kernel_table import SCATTERED, KernelTable, kind_of

SURVIVE, JOIN, SCATTER = range(3)
STRONGEST_PRIOR = 20.0
"""Pseudo-encounters that the law may stand for in a pair of classes.  Classes cannot separate a law's small faults from their
own noise, but the balance adds them up over all pairs: where there are data, data decide."""
SHAPE_PRIOR = 1.0
"""Pseudo-counts of a row of shapes."""


def grid_for(
    table: KernelTable,
    exact_to: int = 32,
    largest: int | None = None,
    shapes: ArrayLike | None = "table",
) -> Grid:
    """A grid for a table: its shape classes, sizes to twice the largest seen.

    Parameters
    ----------
    table : KernelTable
        Whose sizes and shapes are covered.
    exact_to : int
        Largest size with a class of its own.
    largest : int
        Largest size; twice the largest seen by default.
    shapes : str or array_like
        "table", None for one mean shape per size, or boundaries.

    Returns
    -------
    Grid
        Of whole primaries.

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.estimated_rates import grid_for
    >>> table = pbekit.open_table("notebooks/data/designed-1250Pa.nc")
    >>> grid_for(table, exact_to=16).pivots[:16].tolist() == list(range(1, 17))
    True
    """
    if not isinstance(table, KernelTable):
        raise PBEError(
            f"table: got {arguments.shown(table)}, expected a KernelTable, as KernelTable.load(path) reads it"
        )
    if isinstance(shapes, str) and shapes != "table":
        raise PBEError(f'shapes: got {arguments.shown(shapes)}, expected "table", None or boundaries')
    seen = int(table.records.size.max()) if len(table.records) else 1
    exact_to = whole_number("exact_to", exact_to, 1, MOST_EXACT)
    if largest is None:
        largest = max(2 * seen, exact_to)
    elif whole_number("largest", largest, 1, LARGEST) < seen:
        raise PBEError(
            f"largest = {largest}: expected at least {seen}, the largest aggregate that the table saw"
        )
    grid = Grid.primaries(min(exact_to, largest), largest=largest)
    edges = table.shape_edges if isinstance(shapes, str) else shapes
    return grid if edges is None else grid.with_shapes(edges, table.shape_name)


def start_of(grid: Grid, table: KernelTable, volume_fraction: float | None = None) -> np.ndarray:
    """(K,) free primaries at the volume fraction of the table's scene [1/m^3].

    Parameters
    ----------
    grid : Grid
        Of K cells.
    table : KernelTable
        Whose scene says radius and volume fraction.
    volume_fraction : float
        Instead of the scene's [-].

    Returns
    -------
    (K,) array
        [1/m^3].

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.estimated_rates import start_of
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> start = start_of(pbekit.Grid.primaries(exact_to=8), table, volume_fraction=1e-4)
    >>> f"{start[0]:.2e} primaries per m^3", float(start[1:].sum())
    ('1.91e+14 primaries per m^3', 0.0)
    """
    phi = table.about.get("volume_fraction") if volume_fraction is None else volume_fraction
    if phi is None:
        raise PBEError("the table does not say its volume fraction; give one")
    phi = arguments.volume_fraction(float(phi) if volume_fraction is None else phi)
    return grid.monodisperse(phi / (4 / 3 * np.pi * table.radius**3))


class Rates(NamedTuple):
    """What a balance takes from a table of encounters, on the cells of its grid.

    encounters : (K, K) [m^3/s] f_ij;  outcomes : (K, K, 3) probability to survive, join, scatter
    fragments : (pairs of sizes, S + 2) expected products of a scattering pair, as `PairRows`
    radius_moments : (3, K) means of R, R^2, R^3 [m, m^2, m^3]
    joined, broken, transitions : shapes of products of aggregation and breakup, and of survivors (groups of partners, K,
        shapes); None where sizes have one shape only
    """

    encounters: np.ndarray
    outcomes: np.ndarray
    fragments: np.ndarray
    radius_moments: np.ndarray
    joined: np.ndarray | ShapeMemory | None
    broken: np.ndarray | None
    transitions: np.ndarray | None

    @property
    def size_changes(self) -> np.ndarray:
        """(K, K) [m^3/s] rate of the encounters that change sizes."""
        return self.encounters * (self.outcomes[..., JOIN] + self.outcomes[..., SCATTER])

    def balance(self, grid: Grid, partner_start: np.ndarray, scheme: str, edge: str) -> PopulationBalance:
        """The balance of these events."""
        join, scatter = (
            self.encounters * self.outcomes[..., JOIN],
            self.encounters * self.outcomes[..., SCATTER],
        )
        events: list[Event] = []
        if self.transitions is not None:
            survive = self.encounters * self.outcomes[..., SURVIVE]
            events.append(Restructuring(survive, self.transitions, partner_start))
        events += [
            Aggregation(join, self.joined),
            CollisionalBreakup(scatter, PairRows(self.fragments, "fragments of encounters"), self.broken),
        ]
        return PopulationBalance(grid.with_outer_radius(self.radius_moments[0]), events, scheme, edge)


def extrapolated_shares(changes: np.ndarray, mass: np.ndarray, guessed: np.ndarray) -> tuple[float, float]:
    """Shares of `changes` (K, K) where `guessed` (K, K), in number and weighted with the mass (K,) of both parents."""
    heavy = changes * (mass[:, None] + mass[None])
    number, weighted = (float(c[guessed].sum() / c.sum()) for c in (changes, heavy))
    return number, weighted


def _every(allowed: np.ndarray) -> Callable[[int], np.ndarray]:
    """The same samples, for each target of `nearest`."""
    return lambda target: allowed


class _ShapesOfProducts(NamedTuple):
    """Products (p,) whose shapes are counted.

    shape, encounter : (p,) their shape class and the encounter they left
    near : for each group of larger parents, (sizes with several shapes, p) weights of a local average
    """

    shape: np.ndarray
    encounter: np.ndarray
    near: dict[int, sparse.csr_array]


class EstimatedRates:
    """A table on a grid.

    outcomes : "table" (classes, with the law as prior) or "smooth" (the law alone)
    memory : whether the shape of an aggregation product remembers the shape of the larger parent
    partners : first sizes of the groups of partners whose encounters reshape survivors differently

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.estimated_rates import EstimatedRates
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> estimated = EstimatedRates(table, pbekit.Grid.primaries(exact_to=16, largest=40))
    >>> balance = estimated.balance()
    >>> balance.cells == estimated.grid.cells
    True
    """

    def __init__(
        self,
        table: KernelTable,
        grid: Grid,
        outcomes: str = "table",
        memory: bool = True,
        partners: tuple[int, ...] = (1, 3, 10),
        edge: str = "closed",
    ):
        if not isinstance(table, KernelTable):
            raise PBEError(f"table: got {arguments.shown(table)}, expected a KernelTable")
        if not isinstance(grid, Grid):
            raise PBEError(f"grid: got {arguments.shown(grid)}, expected a Grid, as grid_for(table) makes it")
        if edge not in EDGES:
            raise PBEError(f"edge: got {edge!r}, expected one of {', '.join(EDGES)}")
        if outcomes not in ("table", "smooth"):
            raise PBEError(f'outcomes: got {outcomes!r}, expected "table" or "smooth"')
        if not grid.discrete:
            raise PBEError("a table of encounters needs a grid of whole primaries (Grid.primaries)")
        if grid.shapes > 1 and grid.shape_name != table.shape_name:
            raise PBEError(f"grid has shapes by {grid.shape_name}, the table by {table.shape_name}")
        self.grid, self.edge, self.smooth, self.memory = (
            grid,
            edge,
            outcomes == "smooth",
            memory and grid.shapes > 1,
        )
        kind = kind_of(table.records.outcome)
        total = table.records.weight.sum()
        self.unresolved = float(table.records.weight[kind < 0].sum() / total) if total > 0 else 0.0
        resolved = table.records.select(kind >= 0)
        if grid.shapes == 1 and table.shape_edges is not None:
            # One mean shape per size: outcomes of all shapes count, in the proportion in which they met.
            table = replace(table, shape_edges=None)
        if len(resolved) == 0:
            raise PBEError("the table holds no resolved encounters")
        self.table = table.with_records(resolved)
        self.records = resolved
        self.kind = kind_of(resolved.outcome)
        self.partners = partners
        self._options = (outcomes, memory, partners, edge)
        self.partner_start = np.array([0, grid.cells])
        self._prepare_outcomes()
        self.scattered = np.flatnonzero(np.isin(resolved.outcome, SCATTERED))
        self._prepare_radii()
        if grid.shapes > 1:
            self._prepare_shapes()

    # -- outcomes -------------------------------------------------------------------------------------------------

    def _prepare_outcomes(self) -> None:
        table, grid, r = self.table, self.grid, self.records
        shape = r.shape(table.shape_name, table.radius)
        single = (r.size <= 2) | (grid.shapes == 1)
        shape = np.where(single, np.nan, shape)
        own = np.where(grid.shape_of_cell < 0, np.nan, grid.shape)
        self._cell_features = LogisticLaw.features(
            grid.mass[:, None], grid.mass[None], own[:, None], own[None]
        )
        # A class is represented to the law by the mean features of its encounters, or by its middle.
        low, high = table.size_edges[table.class_size], table.size_edges[table.class_size + 1] - 1
        size = np.sqrt(low * np.maximum(high, low))
        middle = np.full(table.classes, np.nan)
        if table.shape_edges is not None and grid.shapes > 1:
            edges = table.shape_edges
            middle = np.where(
                table.class_shape < 0, np.nan, 0.5 * (edges[1:] + edges[:-1])[table.class_shape]
            )
        b, a = np.tril_indices(table.classes)
        self._class_features = LogisticLaw.features(size[a], size[b], middle[a], middle[b])
        features = self._features = LogisticLaw.features(*r.size.T, *shape.T)
        seen = np.bincount(table.pair, minlength=table.pairs)
        for f in range(features.shape[1]):
            met = np.bincount(table.pair, r.weight, table.pairs)
            total = np.bincount(table.pair, r.weight * features[:, f], table.pairs)
            mean = total / np.where(met > 0, met, 1.0)
            self._class_features[:, f] = np.where(seen > 0, mean, self._class_features[:, f])
        self.trials = seen
        shape_of_cell = np.where(grid.shape_of_cell < 0, np.nan, grid.shape)
        cell_class = table.class_of(grid.mass, shape_of_cell)
        low_class, high_class = (f(cell_class[:, None], cell_class[None]) for f in (np.minimum, np.maximum))
        self.cell_pair = high_class * (high_class + 1) // 2 + low_class
        beyond = grid.mass > r.size.max()
        self.extrapolated = (seen[self.cell_pair] == 0) | beyond[:, None] | beyond[None]

    @cached_property
    def law(self) -> LogisticLaw:
        """What smoothly depends on sizes and shapes in the outcomes; fitted when it is asked for."""
        return LogisticLaw.fit(self._features, self.kind, weight=self._own_weight)

    @property
    def _own_weight(self) -> np.ndarray | None:
        """(n,) weights of the table; None where all encounters count alike."""
        return self.records.weight if self.records.weighted else None

    @cached_property
    def strength(self) -> float:
        """Pseudo-encounters of the law per pair of classes, by the marginal likelihood of the classes' counts."""
        table = self.table
        place = table.pair * 3 + self.kind
        counts = np.bincount(place, self._own_weight, 3 * table.pairs).reshape(-1, 3)
        law = np.maximum(self.law(self._class_features), 1e-12)
        used = counts.sum(axis=1) > 0

        def misfit(log_strength: float) -> float:
            alpha = np.exp(log_strength) * law[used]
            n, total = counts[used].sum(axis=1), alpha.sum(axis=1)
            value = special.gammaln(total) - special.gammaln(n + total)
            value += (special.gammaln(counts[used] + alpha) - special.gammaln(alpha)).sum(axis=1)
            return -value.sum()

        return float(
            np.exp(
                optimize.minimize_scalar(misfit, bounds=(0.0, np.log(STRONGEST_PRIOR)), method="bounded").x
            )
        )

    def probabilities(self, weight: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
        """(pairs of classes, 3) or, smooth, (K, K, 3): survive, join, scatter."""
        law = self.law.expected if rng is None else self.law.drawn(rng)
        if self.smooth:
            return law(self._cell_features)
        prior = self.strength * np.maximum(law(self._class_features), 1e-12)
        prior = prior if rng is None else rng.standard_gamma(prior)
        counts = np.bincount(self.table.pair * 3 + self.kind, weight, 3 * self.table.pairs).reshape(-1, 3)
        total = counts + prior
        return total / total.sum(axis=1, keepdims=True)

    # -- fragments ------------------------------------------------------------------------------------------------

    def _pair_totals(self) -> tuple[np.ndarray, np.ndarray]:
        """(pairs of sizes,) primaries of both, and of the smaller."""
        grid = self.grid
        high, low = np.tril_indices(grid.sizes)
        return grid.pivots[low] + grid.pivots[high], grid.pivots[low]

    @cached_property
    def _fragment_norm(self) -> sparse.csr_array:
        """(pairs of sizes, scattered) weights of the scattered encounters that stand for those of a pair."""
        r, events = self.records, self.scattered
        total, smaller = self._pair_totals()
        before = r.size[events].sum(axis=1).astype(float)
        targets = np.stack([np.log(total), smaller / total], axis=1)
        samples = np.stack([np.log(before), r.size[events].min(axis=1) / before], axis=1)
        return nearest(targets, samples, np.array([0.25, 0.15]))

    @cached_property
    def _fragments(self) -> sparse.csr_array | np.ndarray:
        """Products of each scattered encounter, scaled to each pair of sizes; found when they are asked for.

        (pairs of sizes times (S + 2), scattered); without any, (pairs of sizes, S + 2) of any split
        """
        grid, r = self.grid, self.records
        total, _ = self._pair_totals()
        events = self.scattered
        if events.size == 0:
            return self._no_fragments(total)
        before = r.size[events].sum(axis=1).astype(float)
        width = grid.sizes + 2
        near = self._fragment_norm
        # Every fragment of every near event, scaled to the pair: monomers and dimers stay what they are.
        pair = np.repeat(np.arange(len(total)), np.diff(near.indptr))
        event = near.indices
        start = np.concatenate([[0], np.cumsum(r.products)])
        pieces = r.products[events][event]
        entry = np.repeat(np.arange(len(event)), pieces)
        product = start[events[event]][entry] + (
            np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        )
        size = r.product_size[product].astype(float)
        small = size <= 2
        light = np.bincount(entry, size * small, len(event))
        heavy = np.bincount(entry, size * ~small, len(event))
        room = total[pair] - light
        fits = ((heavy > 0) & (room >= 3))[entry]
        # Without room for larger pieces all are scaled; monomers and dimers alone are as small in any pair.
        alike = np.where(heavy > 0, total[pair] / before[event], 1.0)[entry]
        stretched = size * (room / np.maximum(heavy, 1))[entry]
        scaled = np.where(fits, np.where(small, size, stretched), size * alike)
        # A daughter is at least a primary and leaves one behind; numbers then keep the mass of the pair.
        scaled = np.clip(scaled, 1.0, total[pair][entry] - 1.0)
        number = (total[pair] / np.bincount(entry, scaled, len(event)))[entry]
        slot, share, _ = grid.corners(scaled, closed=self.edge == "closed")
        at = pair[entry][:, None] * width + slot
        number = (share * number[:, None]) * near.data[entry][:, None]
        columns = np.broadcast_to(event[entry][:, None], at.shape)
        return sparse.csr_array(
            (number.ravel(), (at.ravel(), columns.ravel())), shape=(len(total) * width, events.size)
        )

    def _no_fragments(self, total: np.ndarray) -> np.ndarray:
        """Nothing was seen to break: should the prior's rare breakup occur, any split is equally likely."""
        from pbekit.balance.breakage import Uniform

        closed = self.edge == "closed"
        rows = []
        for parents in total:
            size, number = Uniform().pieces(parents)
            rows.append(self.grid.place(size, number, closed=closed)[0])
        return np.stack(rows)

    def fragment_rows(self, weight: np.ndarray) -> np.ndarray:
        """(pairs of sizes, S + 2) expected products of a scattering pair."""
        if self.scattered.size == 0:
            return self._fragments
        w = weight[self.scattered]
        rows = (self._fragments @ w).reshape(-1, self.grid.sizes + 2)
        return rows / (self._fragment_norm @ w)[:, None]

    # -- radii ----------------------------------------------------------------------------------------------------

    def _prepare_radii(self) -> None:
        grid, r, table = self.grid, self.records, self.table
        size, radius = r.size.ravel(), r.outer_radius.ravel()
        shape = self._grid_shape(size, r.shape(table.shape_name, table.radius).ravel())
        reduced = radius / (table.radius * np.sqrt(size))
        good = np.isfinite(reduced)
        by_shape = {
            s: np.flatnonzero(good & ((shape == s) if s >= 0 else True)) for s in set(grid.shape_of_cell)
        }
        every = np.flatnonzero(good)

        def within(k: int) -> np.ndarray:
            own = by_shape[grid.shape_of_cell[k]]
            if grid.mass[k] <= 2:
                own = every[size[every] == grid.mass[k]]
            return own if own.size else every

        targets, samples = np.log(grid.mass)[:, None], np.log(size)[:, None]
        self._radii = nearest(targets, samples, np.array([0.1]), within)
        # Encounters come in proportion to their flux, (R_i + R_j)^3; radii are wanted per aggregate.
        flux = np.repeat(r.outer_radius.sum(axis=1) ** 3, 2)
        self._reduced = np.nan_to_num(reduced)
        self._per_aggregate = np.nan_to_num(np.median(flux) / flux)

    def radius_moments(self, weight: np.ndarray) -> np.ndarray:
        """(3, K) means of R, R^2, R^3 [m, m^2, m^3] of each cell."""
        w = np.repeat(weight, 2) * self._per_aggregate
        norm = self._radii @ w
        length = self.table.radius * np.sqrt(self.grid.mass)
        return np.stack([length**p * (self._radii @ (w * self._reduced**p)) / norm for p in (1, 2, 3)])

    @cached_property
    def radius_of_gyration(self) -> np.ndarray:
        """(K,) mean R_g [m] of each cell; nan where the table recorded none."""
        reduced = self.records.radius_of_gyration.ravel() / np.sqrt(self.records.size.ravel())
        known = np.isfinite(reduced)
        w = np.repeat(self.records.weight, 2) * self._per_aggregate * known
        with np.errstate(invalid="ignore"):
            mean = (self._radii @ (w * np.nan_to_num(reduced))) / (self._radii @ w)
        return np.sqrt(self.grid.mass) * mean

    # -- shapes ---------------------------------------------------------------------------------------------------

    def _grid_shape(self, size: np.ndarray, shape: np.ndarray) -> np.ndarray:
        """Shape class on the grid, -1 for one and two primaries."""
        if self.grid.shape_edges is None:
            return np.full(np.shape(size), -1)
        inner = self.grid.shape_edges[1:-1]
        return np.where(
            size <= 2, -1, np.searchsorted(inner, np.nan_to_num(shape, nan=inner[0]), side="right")
        )

    def _prepare_shapes(self) -> None:
        grid, r, table = self.grid, self.records, self.table
        parent = self._grid_shape(r.size, r.shape(table.shape_name, table.radius))
        product = self._grid_shape(r.product_size, r.product_shape(table.shape_name, table.radius))
        kind_of_product = self.kind[r.encounter_of_product]
        larger = np.where(
            r.size[:, 0] == r.size[:, 1], parent.max(axis=1), parent[np.arange(len(r)), r.size.argmax(axis=1)]
        )
        several = grid.shape_of_cell >= 0
        pivots = np.flatnonzero(np.bincount(grid.size_of_cell, minlength=grid.sizes) > 1)

        def rows(chosen: np.ndarray, group: np.ndarray) -> _ShapesOfProducts:
            """Local averages for each (group, size with several shapes) of the products `chosen`."""
            samples = np.log(r.product_size[chosen])[:, None]
            targets = np.log(grid.pivots[pivots])[:, None]
            found = []
            for g in np.unique(np.append(group, -2)):
                if g > -2:
                    own = np.flatnonzero(group == g)
                    found.append((g, nearest(targets, samples, np.array([0.1]), _every(own))))
            return _ShapesOfProducts(product[chosen], r.encounter_of_product[chosen], dict(found))

        joined = np.flatnonzero((kind_of_product == JOIN) & (product >= 0))
        group = larger[r.encounter_of_product[joined]] if self.memory else np.zeros(joined.size, int)
        self._joined = rows(joined, group)
        broken = np.flatnonzero((kind_of_product == SCATTER) & (product >= 0))
        self._broken = rows(broken, np.zeros(broken.size, int))
        self._pivots, self._several = pivots, several

        kept = (r.survivors >= 0) & (parent >= 0)
        encounter, side = np.nonzero(kept)
        self._kept_encounter = encounter
        self._after = product[r.survivors[encounter, side]]
        before, size = parent[encounter, side], r.size[encounter, side]
        partner = r.size[encounter, 1 - side]
        starts = [p for p in self.partners if p <= grid.pivots[-1]]
        self.partner_start = np.array([np.argmax(grid.mass >= p) for p in starts] + [grid.cells])
        of_partner = np.searchsorted(starts, partner, side="right") - 1
        self._kept_near, self._kept_pool = [], []
        cells = np.flatnonzero(several)
        for g in range(len(starts)):
            own = {s: np.flatnonzero((of_partner == g) & (before == s)) for s in range(grid.shapes)}
            of_cell = [own[s] for s in grid.shape_of_cell[cells]]
            near = nearest(
                np.log(grid.mass[cells])[:, None],
                np.log(size)[:, None],
                np.array([0.1]),
                of_cell.__getitem__,
            )
            self._kept_near.append(near)
            self._kept_pool.append(own)

    def _shape_rows(
        self, prepared: _ShapesOfProducts, weight: np.ndarray, rng: np.random.Generator | None, group: int
    ) -> np.ndarray:
        """(S-with-shapes, shapes) probabilities from local counts and a prior spread over all sizes."""
        shape, encounter, near = prepared
        w, shapes = weight[encounter], self.grid.shapes
        pool = np.bincount(shape, w, shapes) + 1.0 / shapes
        local = np.zeros((self._pivots.size, shapes))
        if group in near:
            for s in range(shapes):
                local[:, s] = near[group] @ (w * (shape == s))
        return self._posterior(local, pool / pool.sum(), rng)

    @staticmethod
    def _posterior(counts: np.ndarray, spread: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
        prior = np.broadcast_to(SHAPE_PRIOR * spread, counts.shape)
        total = counts + (prior if rng is None else rng.standard_gamma(prior)) + 1e-300
        return total / total.sum(axis=-1, keepdims=True)

    def _share(self, rows: np.ndarray) -> np.ndarray:
        """(K,) from rows per size with several shapes."""
        share = np.ones(self.grid.cells)
        share[self._several] = rows.ravel()
        return share

    def shapes_of_products(
        self, weight: np.ndarray, rng: np.random.Generator | None
    ) -> tuple[np.ndarray | ShapeMemory, np.ndarray]:
        """Aggregation's (shares or ShapeMemory), scattering's shares."""
        broken = self._share(self._shape_rows(self._broken, weight, rng, 0))
        if not self.memory:
            return self._share(self._shape_rows(self._joined, weight, rng, 0)), broken
        groups = range(-1, self.grid.shapes)
        shares = np.stack([self._share(self._shape_rows(self._joined, weight, rng, g)) for g in groups])
        return ShapeMemory(shares, np.arange(self.grid.shapes)), broken

    def transitions(self, weight: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
        """(groups of partners, K, shapes) probability of a survivor's shape after, given its cell."""
        grid, shapes = self.grid, self.grid.shapes
        out = np.zeros((len(self._kept_near), grid.cells, shapes))
        out[:, :, 0] = 1.0
        w = weight[self._kept_encounter]
        of_cell = grid.shape_of_cell[self._several]
        for g, near in enumerate(self._kept_near):
            local = np.stack([near @ (w * (self._after == s)) for s in range(shapes)], axis=1)
            pool = np.eye(shapes)
            for s, own in self._kept_pool[g].items():
                pool[s] += np.bincount(self._after[own], w[own], shapes)
            pool /= pool.sum(axis=1, keepdims=True)
            out[g, self._several] = self._posterior(local, pool[of_cell], rng)
        return out

    # -- the balance ----------------------------------------------------------------------------------------------

    def weights(self, rng: np.random.Generator | None) -> np.ndarray:
        """(n,) those of the table for the mean, times exponential ones for a draw."""
        own = self.records.weight
        return own if rng is None else own * rng.standard_exponential(len(own))

    def encounter_rate(self, weight: np.ndarray) -> np.ndarray:
        """(K, K) f_ij = (4/3) g <(R_i + R_j)^3> [m^3/s] (the paper's Eq. 1, averaged over each cell)."""
        r1, r2, r3 = self.radius_moments(weight)
        cube = r3[:, None] + 3 * r2[:, None] * r1[None] + 3 * r1[:, None] * r2[None] + r3[None]
        return 4 / 3 * self.table.shear_rate * cube

    def rates(self, rng: np.random.Generator | None = None) -> Rates:
        """All that the balance takes from the table: the mean, or a draw."""
        weight = self.weights(rng)
        p = self.probabilities(weight, rng)
        moments = self.radius_moments(weight)
        join, broken, transitions = None, None, None
        if self.grid.shapes > 1:
            join, broken = self.shapes_of_products(weight, rng)
            transitions = self.transitions(weight, rng)
        return Rates(
            self.encounter_rate(weight),
            p if self.smooth else p[self.cell_pair],
            self.fragment_rows(weight),
            moments,
            join,
            broken,
            transitions,
        )

    def balance(
        self, rng: np.random.Generator | None = None, scheme: str = "fixed pivot"
    ) -> PopulationBalance:
        """The mean balance, or a draw of it."""
        rates = self.mean_rates if rng is None else self.rates(rng)
        return rates.balance(self.grid, self.partner_start, scheme, self.edge)

    @cached_property
    def mean_rates(self) -> Rates:
        """Rates with the weights of the table."""
        return self.rates()

    @cached_property
    def mean(self) -> PopulationBalance:
        """The balance with the weights of the table."""
        return self.balance()

    # -- what it rests on -----------------------------------------------------------------------------------------

    @property
    def tables(self) -> tuple[KernelTable, ...]:
        """The table, for those that take one or two."""
        return (self.table,)

    def on(self, grid: Grid) -> EstimatedRates:
        """The same table on another grid."""
        return EstimatedRates(self.table, grid, *self._options)

    @cached_property
    def _meetings(self) -> tuple[np.ndarray, np.ndarray]:
        """(K, K) rate of encounters [m^3/s], and of those that change sizes."""
        return self.mean_rates.encounters, self.mean_rates.size_changes

    def extrapolated_flux(self, population: np.ndarray) -> float:
        """Share of all encounters, in number, that meet in pairs of classes nobody sampled or beyond sampled sizes."""
        met = self._meetings[0] * np.outer(population, population)
        return float(met[self.extrapolated].sum() / met.sum())

    def extrapolated_changes(self, population: np.ndarray) -> tuple[float, float]:
        """The same share among the encounters that change sizes, in number and by mass."""
        changes = self._meetings[1] * np.outer(population, population)
        return extrapolated_shares(changes, self.grid.mass, self.extrapolated)

    def missing_pairs(self, population: np.ndarray) -> list[tuple[str, float, int]]:
        """Pairs of classes not sampled: name, share of the mass in changes of size, trials; the largest shares first."""
        changes = self._meetings[1] * np.outer(population, population)
        mass = changes * (self.grid.mass[:, None] + self.grid.mass[None])
        mass /= mass.sum()
        table, beyond = self.table, self.grid.mass > self.records.size.max()
        within = self.extrapolated & ~(beyond[:, None] | beyond[None])
        upper = np.triu(within)
        share = np.bincount(
            self.cell_pair[upper], (mass + mass.T * ~np.eye(len(mass), dtype=bool))[upper], table.pairs
        )
        b, a = np.tril_indices(table.classes)
        found = [
            (f"{table.class_name(a[k])} with {table.class_name(b[k])}", float(share[k]), int(self.trials[k]))
            for k in np.flatnonzero(share > 0)
        ]
        out = float(mass[beyond[:, None] | beyond[None]].sum())
        if out > 0:
            found.append((f"sizes beyond {self.records.size.max()} with any", out, 0))
        return sorted(found, key=lambda pair: -pair[1])
