"""Aggregates that designed encounters draw from, and the record of one such encounter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcdem.aggregates.aggregate import Aggregate
from mcdem.aggregates.morphology import aspect_ratio, second_moments, semi_axes
from mcdem.analysis.dataset import RunDataset
from mcdem.encounter.simulate import EncounterResult
from mcdem.kernel_tables.runs import outcome_of
from pbekit.tables.kernel_table import SOURCES, KernelTable, Records


@dataclass(frozen=True, eq=False)
class Library:
    """Aggregates that runs produced, by class of the table.

    members : (classes) row numbers of the aggregates in each class
    """

    aggregates: tuple[Aggregate, ...]
    outer_radius: NDArray[np.float64]
    members: tuple[NDArray[np.intp], ...]

    @classmethod
    def of(cls, runs: Sequence[RunDataset], table: KernelTable) -> Library:
        """All aggregates of all snapshots, and a monomer."""
        found = [Aggregate.monomer()]
        for run in runs:
            for snapshot in range(len(run.snapshot_times)):
                found += [a for a in run.aggregates(snapshot) if a.size > 1]
        ratios, gyration, outer = _shapes(found, table.radius)
        size = np.array([a.size for a in found])
        shape = {
            "aspect ratio": ratios,
            "outer radius": outer / (table.radius * np.cbrt(size)),
            "radius of gyration": gyration / (table.radius * np.cbrt(size)),
        }[table.shape_name]
        beyond = size >= table.size_edges[-1]
        of_class = np.where(beyond, -1, table.class_of(size, shape))
        return cls(tuple(found), outer, tuple(np.flatnonzero(of_class == k) for k in range(table.classes)))

    def has(self, a: NDArray[np.intp], b: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether there are aggregates of both classes."""
        some = np.array([len(m) > 0 for m in self.members])
        return some[a] & some[b]

    def draw(self, a: int, b: int, rng: np.random.Generator) -> tuple[int, int]:
        """An aggregate of each class, the pair in proportion to its flux."""
        return self.draw_of(self.members[a], self.members[b], rng)

    def draw_of(
        self, one: NDArray[np.intp], other: NDArray[np.intp], rng: np.random.Generator
    ) -> tuple[int, int]:
        """One of these aggregates and one of those, the pair in proportion to its flux."""
        most = (self.outer_radius[one].max() + self.outer_radius[other].max()) ** 3
        while True:
            i, j = rng.choice(one), rng.choice(other)
            if rng.random() * most < (self.outer_radius[i] + self.outer_radius[j]) ** 3:
                return int(i), int(j)


def _shapes(
    aggregates: Sequence[Aggregate], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Aspect ratio, radius of gyration [m] and outer radius [m] of each."""
    sizes = np.array([a.size for a in aggregates])
    moments = second_moments(np.concatenate([a.positions for a in aggregates]), sizes)
    outer = np.array([a.outer_radius(radius) for a in aggregates])
    return aspect_ratio(semi_axes(moments, radius)), np.sqrt(moments.sum(axis=1)), outer


def record_of(
    first: Aggregate, second: Aggregate, result: EncounterResult, radius: float, weight: float = 1.0
) -> Records:
    """One designed encounter."""
    everyone = [first, second, *result.products]
    ratios, gyration, outer = _shapes(everyone, radius)
    sizes = np.array([a.size for a in everyone])
    return Records(
        size=sizes[None, :2],
        aspect_ratio=ratios[None, :2],
        outer_radius=outer[None, :2],
        radius_of_gyration=gyration[None, :2],
        offset=np.array([result.offset]),
        outcome=np.array([outcome_of(result.outcome, result.contact)]),
        source=np.array([SOURCES.index("designed")]),
        time=np.array([np.nan]),
        solves=np.array([result.solves]),
        cpu_time=np.array([result.cpu_time]),
        products=np.array([len(result.products)]),
        product_size=sizes[2:],
        product_from_first=np.array([int((m < first.size).sum()) for m in result.members]),
        product_aspect_ratio=ratios[2:],
        product_outer_radius=outer[2:],
        product_radius_of_gyration=gyration[2:],
        weight=np.array([weight]),
    )
