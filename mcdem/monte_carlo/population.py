"""The aggregates of the sample volume and their moments (Frungieri & Vanni, section 2.1).

An aggregate sits at a *place* that stays its own as long as it lives.  Places are filled lowest first, so that the
layout, and with it everything drawn from it, depends on the history of events alone.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mcdem.aggregates.aggregate import Aggregate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mcdem.scene import Scene

FIXED_POINT = 2**40
"""Powers of R/a are summed as integers of 1/FIXED_POINT: the sums then depend neither on order nor on history."""


class ConservationError(AssertionError):
    """Primary particles were lost or made: a defect of the program, never of the input."""


@dataclass(frozen=True)
class Product:
    """An aggregate that left an encounter."""

    aggregate: Aggregate
    serial: int
    """Number of the aggregate; it survives an encounter that leaves its set of primary particles as it was."""
    place: int
    from_first: int
    """How many of its primary particles came from the first parent."""


class SamplePopulation:
    """Aggregates at places 0, 1, 2, ...; a free place holds `None` and has size and outer radius 0.

    Attributes
    ----------
    primary_radius : a [m], of several the largest
    volume : sample volume Delta V [m^3]
    aggregates : aggregate of each place, or None
    serials : number of the aggregate at each place
    sizes : (places,) primary particles of each
    outer_radii : (places,) R [m]

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.monte_carlo import SamplePopulation
    >>> sample = SamplePopulation(primary_radius=0.5e-6, volume=5e-13)
    >>> place = sample.add(mcdem.Aggregate.monomer())
    >>> int(sample.sizes[place]), sample.volume
    (1, 5e-13)
    """

    def __init__(self, primary_radius: float, volume: float, places: int = 16) -> None:
        self.primary_radius = primary_radius
        self.volume = volume
        self.aggregates: list[Aggregate | None] = []
        self.serials: list[int] = []
        self.sizes: NDArray[np.int64] = np.zeros(places, dtype=np.int64)
        self.outer_radii: NDArray[np.float64] = np.zeros(places)
        self.number = 0
        self.primaries = 0
        self.next_serial = 0
        self._free: list[int] = []
        self._squared_sizes = 0
        self._squared_radii = 0
        self._cubed_radii = 0

    @classmethod
    def of_primaries(cls, scene: Scene) -> SamplePopulation:
        """The suspension at the start: `population.initial` free primary particles at the scene's volume fraction.

        Of several radii, each has its share of them, to within one primary.
        """
        suspension, initial = scene.suspension, scene.population.initial
        numbers = shares_of(initial, suspension.number_fractions or (1.0,))
        cubes = math.fsum(n * radius**3 for n, radius in zip(numbers, suspension.species, strict=True))
        volume = cubes * (4.0 / 3.0) * math.pi / suspension.volume_fraction
        population = cls(suspension.radius, volume, initial)
        for number, radius in zip(numbers, suspension.species, strict=True):
            monomer = Aggregate.monomer(None if suspension.radii is None else radius)
            for _ in range(number):
                population.add(monomer)
        return population

    def __iter__(self) -> Iterator[tuple[int, Aggregate]]:
        """(place, aggregate) of each occupied place, in order."""
        return (
            (place, aggregate) for place, aggregate in enumerate(self.aggregates) if aggregate is not None
        )

    def at(self, place: int) -> Aggregate:
        aggregate = self.aggregates[place]
        if aggregate is None:
            raise LookupError(f"place {place} is free")
        return aggregate

    # Moments

    @property
    def mean_size(self) -> float:
        """<P>, mean number of primary particles per aggregate."""
        return self.primaries / self.number

    @property
    def size_deviation(self) -> float:
        """sigma_P, standard deviation of the number of primary particles over the population."""
        return math.sqrt(self.number * self._squared_sizes - self.primaries**2) / self.number

    @property
    def sauter_diameter(self) -> float:
        """d32 = 2 sum R^3 / sum R^2 [m] (Frungieri & Vanni, Eq. 24)."""
        return 2.0 * self.primary_radius * (self._cubed_radii / self._squared_radii)

    # Changes

    def add(self, aggregate: Aggregate, serial: int | None = None, place: int | None = None) -> int:
        """Put an aggregate at the lowest free place, or at a given free one; returns the place."""
        if serial is None:
            serial = self.next_serial
        self.next_serial = max(self.next_serial, serial + 1)
        if place is None:
            place = heapq.heappop(self._free) if self._free else len(self.aggregates)
        while place >= len(self.aggregates):
            if len(self.aggregates) == len(self.sizes):
                self.sizes = np.concatenate([self.sizes, np.zeros_like(self.sizes)])
                self.outer_radii = np.concatenate([self.outer_radii, np.zeros_like(self.outer_radii)])
            self.aggregates.append(None)
            self.serials.append(-1)
        self.aggregates[place] = aggregate
        self.serials[place] = serial
        self._count(place, aggregate, +1)
        return place

    def _take(self, place: int) -> Aggregate:
        aggregate = self.at(place)
        self._count(place, aggregate, -1)
        self.aggregates[place] = None
        self.serials[place] = -1
        return aggregate

    def _count(self, place: int, aggregate: Aggregate, sign: int) -> None:
        radius = aggregate.outer_radius(self.primary_radius) if sign > 0 else float(self.outer_radii[place])
        scaled = radius / self.primary_radius
        self.sizes[place] = aggregate.size if sign > 0 else 0
        self.outer_radii[place] = radius if sign > 0 else 0.0
        self.number += sign
        self.primaries += sign * aggregate.size
        self._squared_sizes += sign * aggregate.size**2
        self._squared_radii += sign * round(scaled**2 * FIXED_POINT)
        self._cubed_radii += sign * round(scaled**3 * FIXED_POINT)

    def replace(
        self,
        first: int,
        second: int,
        products: Sequence[Aggregate],
        members: Sequence[NDArray[np.integer]],
    ) -> tuple[list[Product], list[int]]:
        """Put the products of an encounter in the place of its parents.

        Parameters
        ----------
        first, second : places of the parents
        products : what left the encounter
        members : for each product, which primary particles of the first parent followed by the second it holds

        Returns the products as recorded, and the places whose content (a geometry, or none) is another than before.
        """
        parents = (self.at(first), self.at(second))
        split = parents[0].size
        total = split + parents[1].size
        if sum(product.size for product in products) != total or not np.array_equal(
            np.sort(np.concatenate([np.asarray(m) for m in members])), np.arange(total)
        ):
            raise ConservationError(
                f"an encounter of {parents[0].size} + {parents[1].size} primary particles returned "
                f"{[product.size for product in products]}"
            )
        from_first = [int(np.count_nonzero(np.asarray(m) < split)) for m in members]
        survivors = surviving(parents, products, members)
        # Product -> place of the parent whose primaries it holds, all and no other.
        kept = {k: place for k, place in zip(survivors, (first, second), strict=True) if k is not None}

        before = dict(zip((first, second), parents, strict=True))
        serial_of = {place: self.serials[place] for place in before}
        self._take(first)
        self._take(second)
        vacated = sorted({first, second} - set(kept.values()))
        placed = []
        for k, product in enumerate(products):
            if k in kept:
                product = unless_same(product, before[kept[k]])
                place = self.add(product, serial_of[kept[k]], kept[k])
            else:
                place = self.add(product, place=vacated.pop(0) if vacated else None)
            placed.append(Product(product, self.serials[place], place, from_first[k]))
        for place in vacated:
            heapq.heappush(self._free, place)
        touched = {first, second, *(product.place for product in placed)}
        return placed, sorted(p for p in touched if self.aggregates[p] is not before.get(p))

    def double(self) -> None:
        """Add an exact copy of every aggregate and double the volume: concentrations and distribution stay."""
        before = self.primaries
        for _, aggregate in list(self):
            self.add(aggregate)
        self.volume *= 2.0
        if self.primaries != 2 * before:
            raise ConservationError(f"doubling made {self.primaries} primary particles out of {before}")

    @classmethod
    def restored(
        cls,
        primary_radius: float,
        volume: float,
        next_serial: int,
        places: Sequence[int],
        serials: Sequence[int],
        aggregates: Sequence[Aggregate],
    ) -> SamplePopulation:
        """The population that a dataset holds."""
        population = cls(primary_radius, volume, max(16, len(aggregates)))
        for place, serial, aggregate in zip(places, serials, aggregates, strict=True):
            population.add(aggregate, int(serial), int(place))
        population._free = [p for p, aggregate in enumerate(population.aggregates) if aggregate is None]
        population.next_serial = next_serial
        return population


def shares_of(count: int, fractions: Sequence[float]) -> list[int]:
    """Whole numbers that add up to `count`, nearest to its `fractions` (largest remainders)."""
    wanted = [count * fraction for fraction in fractions]
    numbers = [math.floor(share + 1e-9) for share in wanted]
    by_remainder = sorted(range(len(wanted)), key=lambda s: numbers[s] - wanted[s])
    for s in by_remainder[: count - sum(numbers)]:
        numbers[s] += 1
    return numbers


def surviving(
    parents: Sequence[Aggregate], products: Sequence[Aggregate], members: Sequence[NDArray[np.integer]]
) -> tuple[int | None, int | None]:
    """For each of two parents, which product holds all its primary particles and no other, if there is one."""
    found: list[int | None] = [None, None]
    split = parents[0].size
    for k, (product, member) in enumerate(zip(products, members, strict=True)):
        if product.size == parents[0].size and np.all(np.asarray(member) < split):
            found[0] = k
        elif product.size == parents[1].size and np.all(np.asarray(member) >= split):
            found[1] = k
    return found[0], found[1]


def unless_same(product: Aggregate, parent: Aggregate) -> Aggregate:
    """The parent itself where the product does not differ from it in any bit, as a free primary particle never does."""
    same = np.array_equal(product.positions, parent.positions) and np.array_equal(product.bonds, parent.bonds)
    if product.springs is not None and len(product.springs):
        same = same and parent.springs is not None and np.array_equal(product.springs, parent.springs)
    return parent if same else product
