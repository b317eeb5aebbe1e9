"""What can happen to aggregates, in event form, and how it lands on a grid.

Pair events consume two aggregates (`Aggregation`, `CollisionalBreakup`), `Breakage` consumes one, `Restructuring`
changes the shape of one.  Events compete: each has its own rate, all their rates add.  Every product row carries
exactly the mass of its parents; that is checked here, once, for every event whoever wrote it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from pbekit import arguments
from pbekit.balance import right_hand_side as compiled
from pbekit.balance.breakage import Daughters, as_daughters, evaluate_rate
from pbekit.balance.grid import Grid, TwoComponentGrid
from pbekit.balance.kernels import as_kernel, evaluate
from pbekit.errors import KernelError, PBEError


@dataclass(frozen=True, eq=False)
class ShapeMemory:
    """Shapes of products that remember the larger parent (of two equal ones, the one of higher shape class).

    Parameters
    ----------
    shares : (G + 1, K)
        Probabilities of a product's shape given its size; row 0 if the larger parent has one shape only (P = 1, 2), row
        1 + g if its shape is in group g.
    group_of_shape : (shapes,) integers
        Non-decreasing, group 0 ... G - 1 of each shape class.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit

    Products keep the class of shape of the larger parent with probability 0.8:

    >>> grid = pbekit.Grid.primaries(exact_to=4).with_shapes([1.0, 1.5, 4.0])
    >>> shares = np.ones((3, grid.cells))
    >>> two = grid.shape_of_cell >= 0
    >>> shares[0, two] = 0.5
    >>> shares[1, two] = np.where(grid.shape_of_cell[two] == 0, 0.8, 0.2)
    >>> shares[2, two] = np.where(grid.shape_of_cell[two] == 1, 0.8, 0.2)
    >>> memory = pbekit.ShapeMemory(shares, group_of_shape=np.array([0, 1]))
    >>> pbekit.PopulationBalance(grid, pbekit.Aggregation(1e-15, memory)).cells
    6
    """

    shares: np.ndarray
    group_of_shape: np.ndarray


@dataclass(frozen=True, eq=False)
class PairRows:
    """Products of every pair of sizes, already on the grid.

    number : (S (S + 1) / 2, S + 2) products on each pivot, then overflow number and mass; pair i <= j of sizes is row
        j (j + 1) / 2 + i

    Examples
    --------
    >>> import numpy as np
    >>> from pbekit.balance import PairRows

    Of sizes 1 and 2, whose pairs 1 + 1, 1 + 2 and 2 + 2 all shatter into primaries:

    >>> shatter = PairRows(np.array([[2.0, 0, 0, 0], [3.0, 0, 0, 0], [4.0, 0, 0, 0]]))
    >>> shatter.number.shape
    (3, 4)
    """

    number: np.ndarray
    name: str = "pair rows"


@dataclass(frozen=True, eq=False)
class Aggregation:
    """i + j -> one aggregate with the mass of both.

    Parameters
    ----------
    kernel : Kernel, callable, array or number
        Rate at which two aggregates meet and stick [m^3/s].
    shape : (shapes,), (K,) or ShapeMemory
        Shares of the product's shapes; the same share for all by default.

    Examples
    --------
    A function of two masses, here Smoluchowski's for whole primaries of 500 nm at 100 1/s, where every encounter sticks.

    >>> import numpy as np
    >>> import pbekit
    >>> grid = pbekit.Grid.primaries(32)
    >>> shear = pbekit.Aggregation(lambda i, j: 4 / 3 * 100.0 * 1.25e-19 * (i ** (1 / 3) + j ** (1 / 3)) ** 3)
    >>> balance = pbekit.PopulationBalance(grid, [shear])
    >>> course = pbekit.solve(balance, grid.monodisperse(1e14), [0.0, 30.0, 60.0])
    >>> course.mean_size.values.round(2).tolist()
    [1.0, 1.22, 1.48]
    """

    kernel: object
    shape: np.ndarray | ShapeMemory | None = None


@dataclass(frozen=True, eq=False)
class CollisionalBreakup:
    """i + j -> fragments of the two together (exchange included).

    Parameters
    ----------
    kernel : Kernel, callable, array or number
        Rate at which two aggregates meet and break [m^3/s].
    daughters : Daughters, callable or PairRows
        Of the joint mass; or a function (mass_i, mass_j) -> (masses, expected numbers).
    shape : (shapes,) or (K,)
        Shares of the products' shapes.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> grid = pbekit.Grid.primaries(32)
    >>> def halves(first, second):
    ...     return np.array([(first + second) / 2]), np.array([2.0])
    >>> event = pbekit.CollisionalBreakup(lambda i, j: 1e-17 * (i + j > 8), halves)
    >>> balance = pbekit.PopulationBalance(grid, [pbekit.Aggregation(1e-16), event], edge="closed")
    """

    kernel: object
    daughters: object
    shape: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Breakage:
    """i -> fragments, first order.  rate : function of mass, array (K,), or a law of `breakage`.

    Parameters
    ----------
    rate : callable, (K,) array or a law of `pbekit.balance`
        Of mass [1/s].
    daughters : Daughters or callable
        Of the parent; or a function of its mass that returns (masses, expected numbers).
    shape : (shapes,) or (K,)
        Shares of the products' shapes.

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.balance import PowerLawRate, Uniform
    >>> event = pbekit.Breakage(PowerLawRate(1e-3, 1.0, 1.0), Uniform())
    """

    rate: object
    daughters: object
    shape: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Restructuring:
    """Encounters of i and j after which i and j live on; i takes a new shape of its own size.

    Parameters
    ----------
    kernel : Kernel, callable, array or number
        Rate at which i meets j and both survive [m^3/s].
    transition : (shapes, shapes), (K, shapes) or (G, K, shapes)
        Probability of the shape after, given the cell.
    partner_start : (G + 1,) integers
        First cell of each group of partners, if the transitions depend on the partner.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit

    Of two classes of shape, an encounter makes one in ten of the elongated compact and none of the compact elongated:

    >>> meet = pbekit.Restructuring(kernel=1e-15, transition=np.array([[1.0, 0.0], [0.1, 0.9]]))
    >>> grid = pbekit.Grid.primaries(exact_to=4).with_shapes([1.0, 1.5, 4.0])
    >>> pbekit.PopulationBalance(grid, meet).cells
    6
    """

    kernel: object
    transition: np.ndarray
    partner_start: np.ndarray | None = None


Event = Aggregation | CollisionalBreakup | Breakage | Restructuring
MASS_TOLERANCE = 1e-12


class _Rows:
    """Product rows, gathered in compressed form."""

    def __init__(self, grid: Grid | TwoComponentGrid, scheme: str, closed: bool) -> None:
        self.grid, self.scheme, self.closed = grid, scheme, closed
        self.slot: list[np.ndarray] = []
        self.number: list[np.ndarray] = []
        self.carried: list[np.ndarray] = []
        self.length: list[np.ndarray] = []

    @property
    def count(self) -> int:
        return sum(len(part) for part in self.length)

    def add_dense(
        self, number: np.ndarray, carried: np.ndarray, offset: int, parents: np.ndarray, name: str
    ) -> None:
        """One row from a vector over the slots."""
        keep = np.flatnonzero((number != 0) | (carried != 0))
        self.check(keep[None], number[keep][None], carried[keep][None], np.atleast_2d(parents), name)
        self.add_block(keep[None] + offset, number[keep][None], carried[keep][None])

    def add_pairs(self, given: PairRows, parents: np.ndarray, offset: int) -> None:
        """All rows at once."""
        grid, number = self.grid, arguments.array(f"products of {given.name}", given.number, None)
        if not isinstance(grid, Grid) or number.shape != (len(parents), grid.sizes + 2):
            raise PBEError(f"{given.name}: got {number.shape}, expected ({len(parents)}, {grid.sizes + 2})")
        if np.any(~np.isfinite(number)) or np.any(number < 0):
            raise KernelError(f"{given.name}: negative or not finite")
        carried = number[:, :-2] * grid.pivots
        weighs = carried.sum(axis=1) + number[:, -1]
        wrong = np.flatnonzero(np.abs(weighs - parents[:, 0]) > 1e-9 * parents[:, 0])
        if wrong.size:
            r = wrong[0]
            raise KernelError(
                f"{given.name}: products weigh {weighs[r]} where the parents weigh {parents[r, 0]}"
            )
        number = number * (parents / weighs[:, None])
        row, slot = np.nonzero(number)
        self.slot.append(slot + offset)
        self.number.append(number[row, slot])
        # A product on its pivot has the pivot's mass: the cell average then leaves it there.
        self.carried.append(np.append(grid.pivots, [0.0, 0.0])[slot] * number[row, slot])
        self.length.append(np.bincount(row, minlength=len(parents)))

    def add_block(self, slot: np.ndarray, number: np.ndarray, carried: np.ndarray) -> None:
        """Rows of equal length (rows, entries)."""
        self.slot.append(slot.ravel())
        self.number.append(number.ravel())
        self.carried.append(carried.ravel())
        self.length.append(np.full(slot.shape[0], slot.shape[1]))

    def corners(self, products: np.ndarray, offset: int, parents: np.ndarray, name: str) -> None:
        """Rows of one product each; products (n, M) masses, parents (n, M) the masses they must carry."""
        slot, number, carried = self.grid.corners(products, self.scheme, self.closed)
        carried = np.zeros_like(number) if carried is None else carried
        self.check(slot, number, carried, parents, name)
        self.add_block(slot + offset, number, carried)

    def check(
        self, slot: np.ndarray, number: np.ndarray, carried: np.ndarray, parents: np.ndarray, name: str
    ) -> None:
        """Refuse rows that do not carry the parents' mass."""
        grid = self.grid
        if isinstance(grid, TwoComponentGrid):
            masses = np.concatenate([grid.masses, np.zeros((1, 2)), np.eye(2)])
            got = np.einsum("rc,rcm->rm", number, masses[slot])
        else:
            overflow = slot == grid.sizes + 1
            got = (carried.sum(axis=1) + (number * overflow).sum(axis=1))[:, None]
        wrong = np.abs(got - parents) > MASS_TOLERANCE * parents.sum(axis=1, keepdims=True)
        if np.any(wrong):
            r = np.argwhere(wrong)[0][0]
            raise KernelError(f"{name}: products weigh {got[r]} where the parents weigh {parents[r]}")

    def finish(self) -> compiled.Products:
        """All rows without their zeros; a run ends where the next slot is not the neighbour, and with its row."""
        slot, number, carried = (np.concatenate(part) for part in (self.slot, self.number, self.carried))
        some = (number != 0) | (carried != 0)
        kept = np.concatenate([[0], np.cumsum(some)])
        entry = kept[np.concatenate([[0], np.cumsum(np.concatenate(self.length))])]
        slot, number = slot[some].astype(np.int64), number[some].astype(float)
        begins = np.ones(slot.size, bool)
        begins[1:] = np.diff(slot) != 1
        begins[entry[:-1][np.diff(entry) > 0]] = True
        run = np.append(np.flatnonzero(begins), slot.size).astype(np.int64)
        row = np.searchsorted(run, entry).astype(np.int64)
        mass = carried[some].astype(float) if self.scheme == "cell average" else np.zeros(0)
        return compiled.Products(row, run, slot[run[:-1]], number, mass)


def _place_fragments(
    grid: Grid | TwoComponentGrid, daughters: Daughters, parent: float, scheme: str, closed: bool
) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(grid, TwoComponentGrid):
        raise PBEError(
            "two-component grids take daughters as a function that returns (masses (n, 2), numbers)"
        )
    if grid.discrete or type(daughters).pieces is not Daughters.pieces:
        mass, number = daughters.pieces(parent)
        return grid.place(mass, number, scheme, closed)
    return grid.place_density(*daughters.cumulative(parent), parent, scheme, closed)


@dataclass
class Assembled:
    """The compiled arrays of a set of events on a grid."""

    geometry: compiled.Geometry
    encounters: compiled.Encounters
    first_order: compiled.FirstOrder
    restructuring: compiled.Restructuring


class _Variants:
    """The kinds of shape rows in use; equal rows are kept once."""

    def __init__(self, grid: Grid | TwoComponentGrid) -> None:
        self.grid = grid
        self.shares: list[np.ndarray] = []
        self.width = grid.sizes + 1 + grid.masses.shape[1]

    def offset(self, share: np.ndarray | None) -> int:
        """First slot of the variant with these shares."""
        share = self.grid.same_shape_share(share)
        for v, known in enumerate(self.shares):
            if np.array_equal(known, share):
                return v * self.width
        self.shares.append(share)
        return (len(self.shares) - 1) * self.width


def assemble(grid: Grid | TwoComponentGrid, events: Sequence[Event], scheme: str, closed: bool) -> Assembled:
    """Events on a grid as arrays for the compiled balance.

    closed : products beyond the last pivot are put on it with their mass, not their number; nothing leaves the grid
    """
    if scheme != "fixed pivot" and isinstance(grid, TwoComponentGrid):
        raise PBEError(f"{scheme} is for one mass coordinate; a two-component grid uses the fixed pivot")
    for event in events:
        if not isinstance(event, Event):
            raise PBEError(
                f"events: got {event!r}, expected Aggregation, CollisionalBreakup, Breakage or Restructuring"
            )
    variants = _Variants(grid)
    group = _groups(grid, events)
    sizes = grid.size_of_cell
    runs = sizes * (group.max() + 1) + group
    class_start = np.concatenate([np.flatnonzero(np.diff(runs, prepend=-1)), [grid.cells]]).astype(np.int64)

    pair_events = [e for e in events if isinstance(e, (Aggregation, CollisionalBreakup))]
    encounters = (
        _encounters(grid, pair_events, class_start, group, variants, scheme, closed)
        if pair_events
        else compiled.NO_ENCOUNTERS
    )
    first = [e for e in events if isinstance(e, Breakage)]
    first_order = (
        _first_order(grid, first, variants.offset, scheme, closed) if first else compiled.NO_FIRST_ORDER
    )
    reshaping = [e for e in events if isinstance(e, Restructuring)]
    if len(reshaping) > 1:
        raise PBEError(
            "events: give one Restructuring, with the kernels and transitions of all of them together"
        )
    restructuring = _restructuring(grid, reshaping[0]) if reshaping else compiled.NO_RESTRUCTURING

    step = (
        (lambda by: grid.neighbour(by))
        if scheme == "cell average" and isinstance(grid, Grid)
        else (lambda by: np.full(grid.cells, -1))
    )
    geometry = compiled.Geometry(
        class_start,
        sizes.astype(np.int64),
        np.ascontiguousarray(variants.shares or [np.ones(grid.cells)]),
        np.ascontiguousarray(grid.mass),
        step(1).astype(np.int64),
        step(-1).astype(np.int64),
        variants.width - grid.sizes,
    )
    return Assembled(geometry, encounters, first_order, restructuring)


def _groups(grid: Grid | TwoComponentGrid, events: Sequence[Event]) -> np.ndarray:
    """(K,) shape group of each cell that products remember: 0 none, 1 + g."""
    memories = [shape for e in events if isinstance(shape := getattr(e, "shape", None), ShapeMemory)]
    if not memories:
        return np.zeros(grid.cells, int)
    if isinstance(grid, TwoComponentGrid):
        raise PBEError("a two-component grid has no shapes")
    of_shape = np.asarray(memories[0].group_of_shape, int)
    if any(not np.array_equal(m.group_of_shape, of_shape) for m in memories):
        raise PBEError("events: every ShapeMemory must use the same groups of shapes")
    if of_shape.shape != (grid.shapes,) or np.any(np.diff(of_shape) < 0) or of_shape.min() != 0:
        raise PBEError(
            f"ShapeMemory: groups must ascend from 0, one per shape class ({grid.shapes}), got {of_shape}"
        )
    return np.where(grid.shape_of_cell < 0, 0, 1 + of_shape[grid.shape_of_cell])


def _encounters(
    grid: Grid | TwoComponentGrid,
    events: Sequence[Aggregation | CollisionalBreakup],
    class_start: np.ndarray,
    group: np.ndarray,
    variants: _Variants,
    scheme: str,
    closed: bool,
) -> compiled.Encounters:
    first_cell = class_start[:-1]
    class_size, class_group = grid.size_of_cell[first_cell], group[first_cell]
    cb, ca = np.tril_indices(len(first_cell))  # row-major lower triangle: pair index b (b + 1) / 2 + a
    low = np.minimum(class_size[ca], class_size[cb])
    high = np.maximum(class_size[ca], class_size[cb])
    size_pair = high * (high + 1) // 2 + low
    larger = np.where(
        class_size[ca] == class_size[cb], np.maximum(class_group[ca], class_group[cb]), class_group[cb]
    )
    size_mass = grid.masses[np.searchsorted(grid.size_of_cell, np.arange(grid.sizes))]
    high_size, low_size = np.tril_indices(grid.sizes)

    rows, weights, row_of_pair = _Rows(grid, scheme, closed), [], []
    for event in events:
        kernel = as_kernel(event.kernel)
        weight = evaluate(kernel, grid.state)
        weights.append(weight)
        start = rows.count
        shape = event.shape
        memory = shape if isinstance(shape, ShapeMemory) else None
        shares: list[np.ndarray | None] = list(shape.shares) if isinstance(shape, ShapeMemory) else [shape]
        for share in shares:
            offset = variants.offset(share)
            if isinstance(event, Aggregation):
                joint = size_mass[low_size] + size_mass[high_size]
                rows.corners(joint, offset, joint, kernel.name)
            else:
                _collisional_rows(grid, event, rows, size_mass, low_size, high_size, weight, offset)
        row_of_pair.append(start + size_pair + (0 if memory is None else larger * high_size.size))
    return compiled.Encounters(np.ascontiguousarray(weights), np.array(row_of_pair, np.int64), rows.finish())


def _collisional_rows(
    grid: Grid | TwoComponentGrid,
    event: CollisionalBreakup,
    rows: _Rows,
    size_mass: np.ndarray,
    low_size: np.ndarray,
    high_size: np.ndarray,
    weight: np.ndarray,
    offset: int,
) -> None:
    two, scheme, closed = isinstance(grid, TwoComponentGrid), rows.scheme, rows.closed
    if isinstance(event.daughters, PairRows):
        rows.add_pairs(event.daughters, size_mass[low_size] + size_mass[high_size], offset)
        return
    of_pair: Callable[..., Any] | None = None
    if not isinstance(event.daughters, Daughters) and callable(event.daughters):
        of_pair = event.daughters
    name = getattr(event.daughters, "name", getattr(of_pair, "__name__", "daughters"))
    # Pairs that never meet get an empty row.
    first_cell = np.searchsorted(grid.size_of_cell, np.arange(grid.sizes))
    meets = np.add.reduceat(np.add.reduceat(weight, first_cell, axis=0), first_cell, axis=1) > 0
    cached: dict[float, tuple[np.ndarray, np.ndarray]] = {}
    empty = np.zeros(0, int)
    for i, j in zip(low_size, high_size):
        if not meets[i, j]:
            rows.add_block(empty[None], np.zeros((1, 0)), np.zeros((1, 0)))
            continue
        parents = size_mass[i] + size_mass[j]
        if of_pair is not None:
            mass, number = _two(of_pair(*(size_mass[s] if two else size_mass[s, 0] for s in (i, j))), name)
            placed = _placed_pieces(grid, mass, number, parents, scheme, closed, name)
        else:
            key = float(parents[0])
            if key not in cached:
                cached[key] = _place_fragments(grid, as_daughters(event.daughters), key, scheme, closed)
            placed = cached[key]
        rows.add_dense(*placed, offset, parents, name)


def _two(pieces: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
    """(masses, numbers) that a user's function returned; raises `KernelError`."""
    try:
        mass, number = (np.asarray(part, float) for part in pieces)
    except (TypeError, ValueError):
        raise KernelError(f"daughters {name}: expected two arrays, masses and expected numbers") from None
    return mass, number


def _placed_pieces(
    grid: Grid | TwoComponentGrid,
    mass: np.ndarray,
    number: np.ndarray,
    parents: np.ndarray,
    scheme: str,
    closed: bool,
    name: str,
) -> tuple[np.ndarray, np.ndarray]:
    mass = np.asarray(mass, float).reshape(-1, len(parents))
    number = np.asarray(number, float).ravel()
    if len(mass) != number.size:
        raise KernelError(
            f"daughters {name}: {len(mass)} masses and {number.size} numbers, expected as many of both"
        )
    total = number @ mass
    if np.any(~np.isfinite(number)) or np.any(number < 0):
        raise KernelError(f"daughters {name}: negative or not finite for parents of {parents}")
    if np.any(np.abs(total - parents) > 1e-9 * parents.sum()):
        raise KernelError(
            f"daughters {name}: fragments weigh {total}, parents {parents}; mass must be conserved"
        )
    if isinstance(grid, TwoComponentGrid):
        slot, share, _ = grid.corners(mass)
        placed = np.bincount(slot.ravel(), (share * number[:, None]).ravel(), grid.cells + 3)
        return placed, np.zeros_like(placed)
    return grid.place(mass, number * (parents[0] / total[0]), scheme, closed)


def _first_order(
    grid: Grid | TwoComponentGrid,
    events: Sequence[Breakage],
    offset_of: Callable[[np.ndarray | None], int],
    scheme: str,
    closed: bool,
) -> compiled.FirstOrder:
    """Several laws of breakage add to one rate with the mixture of their daughters."""
    rates = [evaluate_rate(e.rate, grid.state) for e in events]
    total = np.sum(rates, axis=0)
    rows = _Rows(grid, scheme, closed)
    two = isinstance(grid, TwoComponentGrid)
    offsets = [offset_of(e.shape) for e in events]
    for k in range(grid.cells):
        parents = grid.masses[k]
        slot, number, carried = [np.zeros(0, int)], [np.zeros(0)], [np.zeros(0)]
        for event, rate, offset in zip(events, rates, offsets):
            if rate[k] == 0:
                continue
            if two:
                mass, pieces = cast(Callable[..., Any], event.daughters)(parents)
                name = getattr(event.daughters, "__name__", "daughters")
                n, m = _placed_pieces(grid, mass, pieces, parents, scheme, closed, name)
            else:
                n, m = _place_fragments(
                    grid, as_daughters(event.daughters), float(parents[0]), scheme, closed
                )
            keep = np.flatnonzero((n != 0) | (m != 0))
            name = getattr(event.daughters, "name", "daughters")
            rows.check(keep[None], n[keep][None], m[keep][None], parents[None], name)
            slot.append(keep + offset)
            number.append(n[keep] * rate[k] / total[k])
            carried.append(m[keep] * rate[k] / total[k])
        rows.add_block(
            np.concatenate(slot)[None], np.concatenate(number)[None], np.concatenate(carried)[None]
        )
    return compiled.FirstOrder(total, rows.finish())


def _restructuring(grid: Grid | TwoComponentGrid, event: Restructuring) -> compiled.Restructuring:
    if not isinstance(grid, Grid) or grid.shapes == 1:
        raise PBEError("Restructuring needs a grid with shapes")
    rate = evaluate(as_kernel(event.kernel), grid.state)
    groups = [0, grid.cells] if event.partner_start is None else list(event.partner_start) + [grid.cells]
    if event.partner_start is not None and event.partner_start[-1] == grid.cells:
        groups = list(event.partner_start)
    transition = arguments.array("transition", event.transition, None, "probabilities")
    if transition.shape == (grid.shapes, grid.shapes):
        transition = transition[np.maximum(grid.shape_of_cell, 0)]
    if transition.ndim == 2:
        transition = transition[None]
    if transition.shape != (len(groups) - 1, grid.cells, grid.shapes):
        raise PBEError(f"Restructuring: transition must be (groups, cells, shapes), got {transition.shape}")
    transition = transition.copy()
    single = grid.shape_of_cell < 0
    transition[:, single] = 0.0
    transition[:, single, 0] = 1.0
    total = transition.sum(axis=2, keepdims=True)
    if np.any(transition < 0) or np.any(np.abs(total - 1) > 1e-9):
        raise KernelError("Restructuring: transition rows must be non-negative and add to one")
    first_cell = np.searchsorted(grid.size_of_cell, grid.size_of_cell).astype(np.int64)
    shapes = np.bincount(grid.size_of_cell)[grid.size_of_cell].astype(np.int64)
    return compiled.Restructuring(rate, np.asarray(groups, np.int64), first_cell, shapes, transition / total)
