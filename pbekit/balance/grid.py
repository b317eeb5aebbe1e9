"""The classes of the balance: size times shape, or two components.

Legend: K cells, S sizes (pivots).  Masses are numbers of primaries P (a *discrete* grid) or volumes (a
*continuous* one).  A grid is a list of cells, not a rectangle: P = 1 and P = 2 have one shape each.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pbekit.arguments import MOST_EXACT, array, number, whole_number
from pbekit.balance import three_pivots
from pbekit.errors import PBEError

LARGEST = 10**9
"""Primaries of the largest aggregate."""
Cumulative = Callable[[np.ndarray], np.ndarray]
"""Masses -> number, or mass, of what lies below them."""


def _amount(given: object) -> float:
    return number("number", given, 0.0, 1e300, "a number of aggregates per volume")


class Cells(NamedTuple):
    """What a kernel may know of an aggregate; arrays of one broadcast shape.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> cells = pbekit.Cells(mass=np.array([1.0, 8.0]), shape=np.ones(2), outer_radius=1e-6 * np.array([0.5, 1.0]))
    >>> [f"{rate:.2e} m^3/s" for rate in pbekit.balance.ShearEncounter(shear_rate=1e4)(cells, cells)]
    ['1.33e-14 m^3/s', '1.07e-13 m^3/s']
    """

    mass: np.ndarray  # P [-] or volume
    shape: np.ndarray  # the shape coordinate, NaN where a size has only one shape
    outer_radius: np.ndarray  # R [m], NaN if the grid was not given one


@dataclass(frozen=True)
class Grid:
    """Sizes (pivots) times shapes.

    pivots : (S,) ascending masses
    edges : (S + 1,) cell boundaries, edges[k] <= pivots[k] <= edges[k + 1]
    discrete : masses are whole primaries
    shape_edges : (shapes + 1,) boundaries of the shape classes, None for one shape
    size_of_cell, shape_of_cell : (K,); shape_of_cell is -1 where the size has one shape only
    outer_radius : (K,) [m] or None

    Examples
    --------
    >>> import pbekit
    >>> grid = pbekit.Grid.primaries(exact_to=8, largest=20)
    >>> grid.pivots.tolist()
    [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 14.0, 17.0, 20.0]
    >>> volumes = pbekit.Grid.geometric(1e-19, 1e-15, ratio=2.0)
    >>> len(volumes.pivots), volumes.discrete
    (14, False)
    """

    pivots: np.ndarray
    edges: np.ndarray
    discrete: bool
    shape_edges: np.ndarray | None = None
    shape_name: str = "aspect ratio"
    outer_radius: np.ndarray | None = None
    size_of_cell: np.ndarray = field(init=False)
    shape_of_cell: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        pivots, edges = array("pivots", self.pivots, (None,)), array("edges", self.edges, (None,))
        if self.shape_edges is not None:
            array("shape edges", self.shape_edges, (None,))
        if pivots.ndim != 1 or pivots.size == 0 or pivots[0] <= 0 or np.any(np.diff(pivots) <= 0):
            raise PBEError(f"grid: pivots must be positive and ascending, got {pivots}")
        if edges.shape != (pivots.size + 1,) or np.any(edges[:-1] > pivots) or np.any(edges[1:] < pivots):
            raise PBEError("grid: every pivot must lie between its two edges")
        shapes = 1 if self.shape_edges is None else len(self.shape_edges) - 1
        single = np.ones(pivots.size, bool) if shapes == 1 else self.discrete & (pivots <= 2)
        per_size = np.where(single, 1, shapes)
        size_of_cell = np.repeat(np.arange(pivots.size), per_size)
        shape_of_cell = np.concatenate([[-1] if one else np.arange(shapes) for one in single])
        for name, value in dict(
            pivots=pivots, edges=edges, size_of_cell=size_of_cell, shape_of_cell=shape_of_cell
        ).items():
            object.__setattr__(self, name, value)

    # -- the usual grids ---------------------------------------------------------------------------------------

    @classmethod
    def primaries(cls, exact_to: int = 32, largest: int | None = None, ratio: float = 2**0.25) -> Grid:
        """Every whole number of primaries up to `exact_to`, then integer pivots at about a constant ratio."""
        exact_to = whole_number("exact_to", exact_to, 1, MOST_EXACT)
        number("ratio", ratio, 1.0 + 1e-6, 1e6)
        if largest is not None and whole_number("largest", largest, 1, LARGEST) < exact_to:
            raise PBEError(
                f"grid: largest = {largest} lies below exact_to = {exact_to}, the largest size with a class of its own: "
                "lower exact_to, or leave one of them out"
            )
        pivots = list(range(1, exact_to + 1))
        while largest is not None and pivots[-1] < largest:
            pivots.append(max(pivots[-1] + 1, round(pivots[-1] * ratio)))
        p = np.array(pivots, float)
        middle = 0.5 * (p[1:] + p[:-1])
        return cls(p, np.concatenate([[p[0] - 0.5], middle, [p[-1] + 0.5]]), discrete=True)

    def extended(self, factor: float) -> Grid:
        """The same classes, and more of the same ratio until the largest size is `factor` times as large; no radii."""
        if not self.discrete:
            raise PBEError("grid: only one of whole primaries (Grid.primaries) can be extended")
        longer = Grid.primaries(_leading_whole(self.pivots), int(np.ceil(factor * self.pivots[-1])))
        pivots = np.append(self.pivots, longer.pivots[longer.pivots > self.pivots[-1]])
        middle = 0.5 * (pivots[1:] + pivots[:-1])
        edges = np.concatenate([[pivots[0] - 0.5], middle, [pivots[-1] + 0.5]])
        return replace(self, pivots=pivots, edges=edges, outer_radius=None)

    @classmethod
    def geometric(cls, smallest: float, largest: float, ratio: float = 2**0.5) -> Grid:
        """Continuous volumes; edges at a constant ratio, pivots in the middle of their cells."""
        number("smallest", smallest, 1e-300, 1e300)
        number("largest", largest, smallest, 1e300)
        number("ratio", ratio, 1.0 + 1e-6, 1e6)
        count = int(np.ceil(np.log(largest / smallest) / np.log(ratio)))
        edges = smallest * ratio ** np.arange(count + 1)
        return cls(0.5 * (edges[1:] + edges[:-1]), edges, discrete=False)

    def with_shapes(self, edges: ArrayLike, name: str = "aspect ratio") -> Grid:
        """The same sizes, each divided into shape classes with these boundaries (P = 1, 2 keep one)."""
        edges = array("shape edges", edges, (None,))
        if edges.size < 2 or np.any(np.diff(edges) <= 0):
            raise PBEError(f"grid: shape edges must ascend, got {edges}")
        return replace(self, shape_edges=edges, shape_name=name, outer_radius=None)

    def with_outer_radius(self, radius: Callable[..., ArrayLike] | ArrayLike) -> Grid:
        """Give every cell its outer radius R [m]: an array (K,), or a function of mass, or of mass and shape."""
        if callable(radius):
            wanted = [p for p in inspect.signature(radius).parameters.values() if p.default is p.empty]
            if len(wanted) not in (1, 2):
                raise PBEError(
                    f"grid: outer radius: a function of {len(wanted)} arguments, expected one of mass, or of mass and shape"
                )
            values = radius(self.mass, self.shape) if len(wanted) == 2 else radius(self.mass)
        else:
            values = radius
        values = np.array(array("outer radii", values, None))
        if values.shape not in ((), (self.cells,)):
            raise PBEError(f"grid: outer radii: got shape {values.shape}, expected ({self.cells},)")
        values = np.broadcast_to(values, (self.cells,)).copy()
        if not np.all(np.isfinite(values) & (values > 0)):
            raise PBEError("grid: outer radii must be positive and finite in every cell")
        return replace(self, outer_radius=values)

    # -- reading -------------------------------------------------------------------------------------------------

    @property
    def sizes(self) -> int:
        return self.pivots.size

    @property
    def shapes(self) -> int:
        return 1 if self.shape_edges is None else len(self.shape_edges) - 1

    @property
    def cells(self) -> int:
        return self.size_of_cell.size

    @property
    def mass(self) -> np.ndarray:
        """(K,) mass of each cell."""
        return self.pivots[self.size_of_cell]

    @property
    def masses(self) -> np.ndarray:
        """(K, 1) conserved masses of each cell."""
        return self.mass[:, None]

    @property
    def shape(self) -> np.ndarray:
        """(K,) shape coordinate: middle of the shape class, NaN where there is one shape only."""
        if self.shape_edges is None:
            return np.full(self.cells, np.nan)
        middle = 0.5 * (self.shape_edges[1:] + self.shape_edges[:-1])
        return np.where(self.shape_of_cell < 0, np.nan, middle[self.shape_of_cell])

    @property
    def state(self) -> Cells:
        radius = np.full(self.cells, np.nan) if self.outer_radius is None else self.outer_radius
        return Cells(self.mass, self.shape, radius)

    def neighbour(self, step: int) -> np.ndarray:
        """(K,) cell of the same shape, `step` sizes on; the size's only cell if shapes differ, -1 off the grid."""
        found = np.full(self.cells, -1)
        index = {(p, s): k for k, (p, s) in enumerate(zip(self.size_of_cell, self.shape_of_cell))}
        for k, (p, s) in enumerate(zip(self.size_of_cell, self.shape_of_cell)):
            target = index.get((p + step, s), index.get((p + step, -1)))
            if target is not None:
                found[k] = target
        return found

    def same_shape_share(self, share: np.ndarray | None) -> np.ndarray:
        """(K,) probabilities of the shapes of a product given its size, checked; None where there is one shape."""
        if share is None:
            if self.cells != self.sizes:
                raise PBEError("grid has several shapes per size: say how products are shaped (shape=...)")
            return np.ones(self.cells)
        share = array("shape shares", share, None, "probabilities")
        if share.shape == (self.shapes,):
            share = np.where(self.shape_of_cell < 0, 1.0, share[self.shape_of_cell])
        if share.shape != (self.cells,):
            raise PBEError(f"shape shares must be ({self.cells},) or ({self.shapes},), got {share.shape}")
        total = np.bincount(self.size_of_cell, share, self.sizes)
        if np.any(share < 0) or np.any(np.abs(total - 1) > 1e-9):
            raise PBEError("shape shares must be non-negative and add to one for every size")
        return share / total[self.size_of_cell]

    # -- initial populations -------------------------------------------------------------------------------------

    def monodisperse(self, number: float, mass: float | None = None) -> np.ndarray:
        """(K,) `number` per volume, all in the cell of pivot `mass` (the smallest by default)."""
        number = _amount(number)
        if mass is not None:
            array("mass", mass, (), "a mass")
        size = 0 if mass is None else int(np.argmin(np.abs(self.pivots - mass)))
        if mass is not None and not np.isclose(self.pivots[size], mass):
            raise PBEError(f"no pivot at mass {mass}; nearest is {self.pivots[size]}")
        cells = np.flatnonzero(self.size_of_cell == size)
        return number * np.eye(self.cells)[cells].sum(axis=0) / cells.size

    def from_cumulative(
        self, number_below: Cumulative, mass_below: Cumulative, scheme: str = "fixed pivot"
    ) -> np.ndarray:
        """(K,) a continuous distribution put on the pivots, number and mass of it kept (as far as the grid reaches).

        number_below, mass_below : integrals of n(v) and v n(v) from 0 to v; "three pivots" keeps the second moment too, but for
        what it would put below zero; any other scheme starts from the same numbers
        """
        on = "three pivots" if scheme == "three pivots" else "fixed pivot"
        number, _ = self.place_density(number_below, mass_below, np.inf, on)
        return number[:-2][self.size_of_cell]

    # -- where products go -------------------------------------------------------------------------------------

    def _on_three(self, scheme: str) -> bool:
        """Whether products are shared among three pivots; fewer than three are shared by two."""
        return scheme == "three pivots" and self.sizes >= 3

    def corners(
        self, mass: np.ndarray, scheme: str = "fixed pivot", closed: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Slots that share one product of each given mass: (slot, number, mass), each (n, 2), (n, 3) on three pivots.

        Fixed pivot (Kumar & Ramkrishna 1996): shared between the two neighbouring pivots so that number and mass are
        kept.  Three pivots: the second moment too.  Cell average (Kumar et al. 2006): the cell that holds the mass.  Slots S
        and S + 1 are the overflow's number and mass; a product below the first pivot keeps its mass, not its number, and
        so does one beyond the last pivot of a closed grid.
        """
        x = np.asarray(mass, float).reshape(-1)
        wide = 3 if self._on_three(scheme) else 2
        slot, number, carried = np.zeros((x.size, wide), int), *np.zeros((2, x.size, wide))
        over, low = x > self.pivots[-1] * (1 + 1e-12), x < self.pivots[0]
        x = np.minimum(x, self.pivots[-1])
        if wide == 3:
            slot, number = three_pivots.of_masses(self.pivots, np.maximum(x, self.pivots[0]))
            number[low] = np.stack([x / self.pivots[0], 0 * x, 0 * x], axis=1)[low]
            carried = number * self.pivots[slot]
        elif scheme == "cell average":
            k = np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, self.sizes - 1)
            slot[:] = k[:, None]
            number[:, 0], carried[:, 0] = 1.0, x
            number[low, 0] = np.where(x < self.edges[0], x / self.pivots[0], 1.0)[low]
        else:
            k = np.clip(np.searchsorted(self.pivots, x, side="right") - 1, 0, max(self.sizes - 2, 0))
            slot[:, 0], slot[:, 1] = k, np.minimum(k + 1, self.sizes - 1)
            width = np.maximum(self.pivots[slot[:, 1]] - self.pivots[slot[:, 0]], 1e-300)
            upper = np.where(low, 0.0, (x - self.pivots[k]) / width)
            if self.discrete:
                # Whole primaries meet their own pivot exactly; no round-off may leak to its neighbour.
                upper = np.where(np.abs(upper) < 1e-12, 0.0, np.where(np.abs(upper - 1) < 1e-12, 1.0, upper))
            number[:, 0], number[:, 1] = np.where(low, x / self.pivots[0], 1 - upper), upper
            carried[:] = number * self.pivots[slot]
        beyond = np.asarray(mass, float).reshape(-1)[over]
        if closed:
            slot[over], number[over] = self.sizes - 1, 0.0
            number[over, 0] = beyond / self.pivots[-1]
            carried[over] = number[over] * self.pivots[-1]
        else:
            slot[over] = [self.sizes, self.sizes + 1, self.sizes + 1][:wide]
            number[over] = 0.0
            number[over, 0], number[over, 1] = 1.0, beyond
            carried[over] = 0.0
        return slot, number, carried

    def place(
        self, mass: np.ndarray, number: np.ndarray, scheme: str = "fixed pivot", closed: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """`number` products of each given mass, summed over the slots: (number, mass), each (S + 2,)."""
        slot, share, carried = self.corners(mass, scheme, closed)
        weight = np.asarray(number, float).reshape(-1, 1)
        size = self.sizes + 2
        return (
            np.bincount(slot.ravel(), (share * weight).ravel(), size),
            np.bincount(slot.ravel(), (carried * weight).ravel(), size),
        )

    def place_density(
        self,
        number_below: Cumulative,
        mass_below: Cumulative,
        upto: float,
        scheme: str = "fixed pivot",
        closed: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same for a continuous density up to mass `upto`, by its exact cumulative number and mass."""
        out, out_mass = np.zeros(self.sizes + 2), np.zeros(self.sizes + 2)

        def between(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            low, high = np.minimum(low, upto), np.minimum(high, upto)
            return number_below(high) - number_below(low), mass_below(high) - mass_below(low)

        x = self.pivots
        top = x[-1]
        n, m = between(np.array([top]), np.array([np.inf if np.isinf(upto) else max(upto, top)]))
        if closed:
            out[-3] += m[0] / top
            out_mass[-3] += m[0] if scheme == "cell average" else 0.0
        else:
            out[-2], out[-1] = n[0], m[0]
        if scheme == "cell average":
            high = np.minimum(self.edges[1:], top)
            n, m = between(np.minimum(self.edges[:-1], top), high)
            first = between(np.zeros(1), self.edges[:1])
            out[:-2] += n
            out_mass[:-2] += m
            # Dust below the grid: mass is kept, on the first pivot.
            out[0] += first[1][0] / x[0]
            out_mass[0] += first[1][0]
            return out, out_mass
        dust = between(np.zeros(1), x[:1])[1][0]
        out[0] += dust / x[0]
        n, m = between(x[:-1], x[1:])
        n = np.maximum(n, 0.0)
        width = np.diff(x)
        upper = np.clip((m - x[:-1] * n) / width, 0.0, n)
        out[:-3] += n - upper
        out[1:-2] += upper
        if self._on_three(scheme):
            surplus = three_pivots.surplus(x, number_below, upto)
            out[:-2] = three_pivots.without_surplus(x, out[:-2], surplus, positive=np.isinf(upto))
        out_mass[:-2] = out[:-2] * x
        return out, out_mass


@dataclass(frozen=True)
class TwoComponentGrid:
    """Particles made of two materials: cells are pairs of pivots (mass of A, mass of B); fixed pivot only.

    Products go to the four pivots around them with bilinear weights, which keep number, both masses and the product
    of the masses (Kumar & Ramkrishna 1996, in two coordinates).  An axis may start at zero; then nothing is lost at
    small masses.  Slots after the cells: overflow number, overflow mass of A, of B.

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> grid = pbekit.TwoComponentGrid(first=np.arange(4.0), second=np.arange(3.0), discrete=True)
    >>> grid.first.size, grid.second.size
    (4, 3)
    """

    first: np.ndarray  # (m,) pivots of material A
    second: np.ndarray  # (n,) pivots of material B
    discrete: bool = False
    outer_radius: None = None

    def __post_init__(self) -> None:
        for name in ("first", "second"):
            axis = array(f"two-component grid: {name} pivots", getattr(self, name), (None,))
            if axis.size < 2 or axis[0] < 0 or np.any(np.diff(axis) <= 0):
                raise PBEError(f"two-component grid: {name} pivots must ascend from zero or more, got {axis}")
            object.__setattr__(self, name, axis)

    @classmethod
    def primaries(cls, first: int, second: int) -> TwoComponentGrid:
        """Whole primaries: 0 ... `first` of A and 0 ... `second` of B."""
        whole_number("first", first, 1, MOST_EXACT)
        whole_number("second", second, 1, MOST_EXACT)
        return cls(np.arange(first + 1.0), np.arange(second + 1.0), discrete=True)

    @property
    def masses(self) -> np.ndarray:
        """(K, 2) mass of each material in each cell."""
        a, b = np.meshgrid(self.first, self.second, indexing="ij")
        return np.stack([a.ravel(), b.ravel()], axis=1)

    @property
    def mass(self) -> np.ndarray:
        return self.masses.sum(axis=1)

    @property
    def cells(self) -> int:
        return self.first.size * self.second.size

    sizes = cells

    @property
    def size_of_cell(self) -> np.ndarray:
        return np.arange(self.cells)

    @property
    def state(self) -> Cells:
        nan = np.full(self.cells, np.nan)
        return Cells(self.mass, nan, nan)

    def same_shape_share(self, share: np.ndarray | None) -> np.ndarray:
        if share is not None:
            raise PBEError("a two-component grid has no shapes")
        return np.ones(self.cells)

    def corners(
        self, mass: np.ndarray, scheme: str = "fixed pivot", closed: bool = False
    ) -> tuple[np.ndarray, np.ndarray, None]:
        """Slots that share one product of each given pair of masses (n, 2): (slot, number, None), each (n, 4)."""
        if scheme != "fixed pivot":
            raise PBEError(f"{scheme} is for one mass coordinate; a two-component grid uses the fixed pivot")
        m = np.asarray(mass, float).reshape(-1, 2)
        over = (m[:, 0] > self.first[-1] * (1 + 1e-12)) | (m[:, 1] > self.second[-1] * (1 + 1e-12))
        if np.any(m[:, 0] < self.first[0] * (1 - 1e-12)) or np.any(m[:, 1] < self.second[0] * (1 - 1e-12)):
            raise PBEError("two-component grid: a product lies below the first pivot; start the axes at zero")
        (i, u), (j, v) = _bracket(self.first, m[:, 0]), _bracket(self.second, m[:, 1])
        n = self.second.size
        slot = np.stack([i * n + j, i * n + j + 1, (i + 1) * n + j, (i + 1) * n + j + 1], axis=1)
        number = np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v], axis=1)
        slot[over] = self.cells + np.array([0, 1, 2, 2])
        number[over] = np.stack([np.ones(len(m)), m[:, 0], m[:, 1], np.zeros(len(m))], axis=1)[over]
        return slot, number, None


def _leading_whole(pivots: np.ndarray) -> int:
    """How many pivots from 1 on are whole numbers without a gap."""
    return int((pivots == np.arange(1, pivots.size + 1)).sum())


def _bracket(axis: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower neighbour of x on an axis and the share of the upper one."""
    x = np.clip(x, axis[0], axis[-1])
    i = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, axis.size - 2)
    return i, (x - axis[i]) / (axis[i + 1] - axis[i])
