"""The atlas: what encounters came to, counted over cohesion number, both sizes, shape and offset; anyone can add theirs.

An atlas is a list of parts.  A part is the counts of one table's encounters at one cohesion number N, in cells that are
the same for all, with where they come from (scene, runs, seed, command).  Parts are of one material family: all groups
but N agree, or go with N as they do for one material when the stress alone changes (`merged` checks it).

Sizes are classes that are exact up to 8, then at a ratio of 1.25; the shape is the geometric mean of both aspect ratios
(1 for primaries); the offset is |(x0, y0)|/(R_i + R_j).

File (NetCDF): /count and /cell, the counts that are not zero and where they are; /part, to which part each belongs;
attributes `parts` (JSON) and `format`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from pbekit.arguments import number, whole_number
from pbekit.errors import PBEError
from pbekit.outputs import ATLAS, FILES
from pbekit.tables.counts import share_interval
from pbekit.tables.kernel_table import (
    AGGREGATION,
    OUTCOMES,
    SCATTERED,
    UNRESOLVED,
    KernelTable,
    size_classes,
)
from pbekit.tables.similarity import COHESION, groups_of

FORMAT = 1
EXPECTED = "an atlas; make one with mcdem kernels SCENE --from RUN --into ATLAS"
SIZE_EDGES = np.unique(
    np.concatenate([np.arange(1, 9), size_classes(4096, 1.25)[size_classes(4096, 1.25) > 8]])
)
SHAPE_EDGES = np.array([0.0, 1.4, 2.0, np.inf])
OFFSET_EDGES = np.array([0.0, 0.25, 0.5, 0.75, np.inf])
SHIPPED = Path(__file__).with_name("atlas.nc")
"""The atlas that comes with the package."""
_S = SIZE_EDGES.size - 1
CELLS = (_S * (_S + 1) // 2, SHAPE_EDGES.size - 1, OFFSET_EDGES.size - 1, len(OUTCOMES))
"""Pairs of size classes b (b + 1)/2 + a, shapes, offsets, outcomes."""
SAME = 1e-6
"""Relative difference of groups up to which they are the same."""
ORIGIN = ("scene_name", "scene", "runs", "seed", "command")


@dataclass(frozen=True, eq=False)
class Part:
    """Counts at one cohesion number.

    Parameters
    ----------
    cohesion : N
    groups : (value, power of the radius, power of the stress) of each group, by name
    origin : scene, runs, seed and command that made it
    counts : of shape CELLS
    """

    cohesion: float
    groups: Mapping[str, tuple[float, float, float]]
    origin: Mapping[str, str]
    counts: np.ndarray

    @property
    def encounters(self) -> int:
        """All of it."""
        return int(self.counts.sum())

    @classmethod
    def of(cls, table: KernelTable) -> Part:
        """The counts of a table; raises `PBEError` where it does not say its groups."""
        groups = groups_of(table)
        if COHESION not in groups:
            raise PBEError("the table is of a suspension without contacts, and has no cohesion number")
        if table.shape_name != "aspect ratio":
            raise PBEError(f"the table has shapes by {table.shape_name}, the atlas is by aspect ratio")
        r = table.records
        if r.weighted:
            raise PBEError(
                "the table has encounters with weights (mcdem kernels --until-error), the atlas holds counts: give it runs, or "
                "a table made without --until-error"
            )
        sizes = np.clip(np.searchsorted(SIZE_EDGES, r.size, side="right") - 1, 0, _S - 1)
        a, b = sizes.min(axis=1), sizes.max(axis=1)
        ratio = np.where(r.size > 2, np.nan_to_num(r.aspect_ratio, nan=1.0), np.where(r.size == 2, 2.0, 1.0))
        shape = np.searchsorted(SHAPE_EDGES[1:-1], np.sqrt(ratio.prod(axis=1)), side="right")
        reduced = np.hypot(*r.offset.T) / r.outer_radius.sum(axis=1)
        offset = np.searchsorted(OFFSET_EDGES[1:-1], reduced, side="right")
        at = np.ravel_multi_index((b * (b + 1) // 2 + a, shape, offset, r.outcome), CELLS)
        counts = np.bincount(at, minlength=int(np.prod(CELLS))).reshape(CELLS)
        origin = {key: str(table.about[key]) for key in ORIGIN if key in table.about}
        powers = {name: (g.value, g.radius, g.stress) for name, g in groups.items()}
        return cls(groups[COHESION].value, powers, origin, counts)

    def same_origin(self, other: Part) -> bool:
        """Whether both hold encounters of the same runs and seed."""
        keys = ("scene", "runs", "seed")
        return [self.origin.get(k) for k in keys] == [other.origin.get(k) for k in keys]

    def unlike(self, other: Part) -> list[str]:
        """Groups that differ by more than a change of stress alone makes, in words."""
        found = []
        for name in sorted(self.groups.keys() | other.groups.keys()):
            if name not in self.groups or name not in other.groups:
                found.append(f"{name} in one alone")
                continue
            (one, _, power), (two, _, _) = self.groups[name], other.groups[name]
            of_stress = self.groups[COHESION][2]
            expected = one * (other.cohesion / self.cohesion) ** (power / of_stress if of_stress else 0.0)
            if abs(two - expected) > SAME * abs(expected):
                found.append(f"{name} {two:.6g} where {expected:.6g} is expected")
        return found


class Measured(NamedTuple):
    """A probability with its 90 % interval, and the encounters behind it."""

    value: float
    low: float
    high: float
    seen: int
    trials: int


@dataclass(frozen=True, eq=False)
class Atlas:
    """Parts at several cohesion numbers.

    Examples
    --------
    >>> import pbekit
    >>> atlas = pbekit.Atlas.load()  # the one that comes with the package
    >>> atlas.cohesion_numbers.round(3).tolist()
    [0.255, 0.319, 0.372, 0.426, 0.532, 0.638, 0.851]
    """

    parts: tuple[Part, ...]

    def merged(self, part: Part) -> Atlas:
        """With another part; raises `PBEError` where its groups differ, or it is there already."""
        for known in self.parts:
            differs = known.unlike(part)
            if differs:
                raise PBEError(
                    f"the atlas is of other groups: {'; '.join(differs[:4])}; start another atlas for these"
                )
            if known.same_origin(part):
                raise PBEError(
                    f"the atlas holds the encounters of {part.origin.get('runs', 'this run')} at N = {part.cohesion:.4g} already"
                )
        return Atlas(tuple(sorted((*self.parts, part), key=lambda p: p.cohesion)))

    @property
    def cohesion_numbers(self) -> np.ndarray:
        """Ascending."""
        return np.unique([part.cohesion for part in self.parts])

    def counts_at(self, cohesion: float) -> np.ndarray:
        """Counts of all parts of this cohesion number."""
        own = [part.counts for part in self.parts if abs(part.cohesion / cohesion - 1) <= SAME]
        return np.sum(own, axis=0) if own else np.zeros(CELLS, int)

    def largest(self, cohesion: float) -> int:
        """Largest size of a class that any encounter at this cohesion number is in."""
        b = np.tril_indices(_S)[0]
        seen = self.counts_at(cohesion).sum(axis=(1, 2, 3)) > 0
        return int(SIZE_EDGES[b[seen].max() + 1] - 1) if seen.any() else 0

    def probability(
        self, size_i: int, size_j: int, cohesion: float, kinds: Sequence[int] = (AGGREGATION,)
    ) -> Measured:
        """Share of the resolved encounters of two sizes that end in one of these outcomes.

        Parameters
        ----------
        size_i, size_j : primaries
        cohesion : N; between two of the atlas its logit is interpolated in ln N
        kinds : outcomes; aggregation by default

        Raises
        ------
        PBEError : outside the cohesion numbers of the atlas, or where no encounter of these sizes was made
        """
        size_i, size_j = (whole_number("size", p, 1, int(SIZE_EDGES[-1] - 1)) for p in (size_i, size_j))
        number("cohesion number", cohesion, 1e-12, 1e12)
        known = self.cohesion_numbers
        exact = known[np.abs(known / cohesion - 1) <= SAME]
        if exact.size:
            k, n = self._counted(size_i, size_j, float(exact[0]), kinds)
            return Measured(k / n, *share_interval(k, n), k, n)
        if not known.size or not known[0] < cohesion < known[-1]:
            told = ", ".join(f"{value:.4g}" for value in known)
            raise PBEError(
                f"cohesion number N = {cohesion:.4g}: expected one from the atlas' ({told}) or between two; beyond them nothing "
                "is known"
            )
        upper = int(np.searchsorted(known, cohesion))
        low, high = float(known[upper - 1]), float(known[upper])
        weight = np.log(cohesion / low) / np.log(high / low)
        logit, variance, count, trials = 0.0, 0.0, 0, 0
        for value, w in ((low, 1 - weight), (high, weight)):
            k, n = self._counted(size_i, size_j, value, kinds)
            # Haldane & Anscombe: finite for no count, too.
            logit += w * np.log((k + 0.5) / (n - k + 0.5))
            variance += w**2 * (1 / (k + 0.5) + 1 / (n - k + 0.5))
            count, trials = count + k, trials + n
        of = lambda x: float(1 / (1 + np.exp(-x)))
        half = 1.645 * np.sqrt(variance)
        return Measured(of(logit), of(logit - half), of(logit + half), count, trials)

    def _counted(self, size_i: int, size_j: int, cohesion: float, kinds: Sequence[int]) -> tuple[int, int]:
        """Encounters of the outcomes, and all that were resolved, in the pair of classes."""
        a, b = sorted(int(np.searchsorted(SIZE_EDGES, p, side="right") - 1) for p in (size_i, size_j))
        of_outcome = self.counts_at(cohesion)[b * (b + 1) // 2 + a].sum(axis=(0, 1))
        trials = int(of_outcome.sum() - of_outcome[UNRESOLVED])
        if trials == 0:
            raise PBEError(
                f"no encounter of {size_i} and {size_j} primaries at N = {cohesion:.4g} is in the atlas (sizes there reach "
                f"{self.largest(cohesion)}): nothing is known of them"
            )
        return int(of_outcome[list(kinds)].sum()), trials

    # -- the file ----------------------------------------------------------------------------------------------------

    def save(self, path: Path | str) -> None:
        """Write the file, whole or not at all."""
        cells = [np.flatnonzero(part.counts) for part in self.parts]
        part = np.repeat(np.arange(len(self.parts)), [len(c) for c in cells])
        about: list[dict[str, Any]] = [
            {"cohesion": p.cohesion, "groups": dict(p.groups), "origin": dict(p.origin)} for p in self.parts
        ]
        data = xr.Dataset(
            {
                "count": (
                    "entry",
                    np.concatenate([p.counts.ravel()[c] for p, c in zip(self.parts, cells, strict=True)]),
                    {"units": "1", "long_name": "encounters"},
                ),
                "cell": (
                    "entry",
                    np.concatenate(cells),
                    {"units": "1", "long_name": "index over pair, shape, offset, outcome"},
                ),
                "part": ("entry", part, {"units": "1", "long_name": "part of the atlas"}),
            },
            attrs={
                "title": "Atlas of encounters of colloidal aggregates",
                "format": FORMAT,
                "parts": json.dumps(about),
            },
        ).astype(np.int32)
        pack = {str(name): {"zlib": True, "complevel": 9} for name in data.data_vars}
        FILES.write_dataset(path, ATLAS, {"": data}, {"": pack})

    @classmethod
    def load(cls, path: Path | str = SHIPPED) -> Atlas:
        """Read a file that `save` wrote; the one that comes with the package by default."""
        with FILES.reading(path, EXPECTED):
            with xr.open_dataset(path) as data:
                data.load()
            if data.attrs.get("format") != FORMAT or "parts" not in data.attrs:
                raise PBEError(f"{path}: no atlas of format {FORMAT}; expected {EXPECTED}")
            parts = []
            for k, about in enumerate(json.loads(data.attrs["parts"])):
                counts = np.zeros(int(np.prod(CELLS)), int)
                own = data.part.values == k
                counts[data.cell.values[own]] = data["count"].values[own]
                groups = {name: tuple(values) for name, values in about["groups"].items()}
                parts.append(Part(about["cohesion"], groups, about["origin"], counts.reshape(CELLS)))
            return cls(tuple(parts))
        raise AssertionError  # the guard lets nothing pass in silence


def joint_breakup(atlas: Atlas, cohesion: float) -> dict[str, np.ndarray]:
    """Probability of breakup over the joint class of sizes: middle of P_i + P_j, counts, trials, in classes of joint size."""
    b, a = np.tril_indices(_S)
    middle = 0.5 * (SIZE_EDGES[:-1] + SIZE_EDGES[1:] - 1)
    total = middle[a] + middle[b]
    of_outcome = atlas.counts_at(cohesion).sum(axis=(1, 2))
    trials = of_outcome.sum(axis=1) - of_outcome[:, UNRESOLVED]
    broken = of_outcome[:, list(SCATTERED)].sum(axis=1)
    bins = np.searchsorted(2.0 * size_classes(4096, 1.25), total, side="right")
    seen = np.unique(bins[trials > 0])
    n, k, size = (np.bincount(bins, w, bins.max() + 1)[seen] for w in (trials, broken, total * trials))
    return {"size": size / n, "trials": n.astype(int), "broken": k.astype(int)}
