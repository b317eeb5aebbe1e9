"""Encounters and the tables made of them: the file that is handed from whoever simulates to the balance.

Layout of KERNELS.nc (every variable carries `units` and `long_name`)

    /          classes of aggregates (size x shape) and, per pair of classes: trials, counts of every outcome, masses and
               counts of fragments over x = P_f/(P_i + P_j); per class: shapes of products, changes of shape of survivors,
               moments of R.  All of it follows from /records; it is there to be read without recomputing.
    /records   one row per encounter: both parents (size, aspect ratio, R, R_g), offset, outcome, where it comes from;
               one row per product (ragged, CF contiguous): size, primaries from the first parent, shape, R, R_g
    attributes of the root: scene (TOML text), seed, radius, shear_rate, viscosity, volume_fraction (SI), command, format

Within a pair of classes, encounters are those of a uniform flux over the cross section of radius R_i + R_j, each with its weight.
Where encounters were drawn by importance their weights differ (`weight` in /records, format 2, which older versions refuse):
means over the encounters with their weights are those of the flux.  Then `trials` and `count` say how many were seen, and
`weight_sum` is what they stand for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from pbekit.errors import PBEError
from pbekit.outputs import FILES, TABLE

FORMAT, WEIGHTED_FORMAT = 1, 2
"""Of tables whose encounters all count alike, and of those in which they carry weights."""
SMALL = 4096
"""Bytes of a variable that is stored as it is."""
EXPECTED = "a kernel table; make one with mcdem kernels"
OUTCOMES = (
    "missed",
    "parted",
    "aggregation",
    "exchange",
    "fragmentation with contact",
    "fragmentation without contact",
    "unresolved",
)
"""missed: no contact, the same two sets of primaries; parted: contact, the same two sets; aggregation: one product;
exchange: two products, other sets; fragmentation: more products than two, or a parent split without contact;
unresolved: the motion could not be followed."""
MISSED, PARTED, AGGREGATION, EXCHANGE, BROKEN_TOUCHING, BROKEN_APART, UNRESOLVED = range(7)
SURVIVED, JOINED, SCATTERED = (MISSED, PARTED), (AGGREGATION,), (EXCHANGE, BROKEN_TOUCHING, BROKEN_APART)
SOURCES = ("run", "designed")

SHAPES = {
    "aspect ratio": "aspect ratio of the inertia-equivalent ellipsoid",
    "outer radius": "R / (a P^(1/3))",
    "radius of gyration": "R_g / (a P^(1/3))",
}
"""Second coordinates; sizes 1 and 2 have one shape each."""


@dataclass(frozen=True, eq=False)
class Records:
    """Encounters, n of them, with m products in all.

    size (n, 2) primaries of both parents; aspect_ratio, outer_radius [m], radius_of_gyration [m] (n, 2)
    offset (n, 2) [m]; outcome (n,) index of OUTCOMES; source (n,) index of SOURCES; time (n,) [s] of the run, nan if
    designed; solves (n,) evaluations of the hydrodynamics; cpu_time (n,) [s]
    weight (n,) how many encounters of a uniform flux each stands for, ones if None is given
    products (n,) number of products; product_* (m,) in the order of the encounters; product_from_first: primaries that
    came from the first parent.  Survivors of `missed` and `parted` are their parents again, in any order; products of
    `unresolved` are the parents.

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.tables import OUTCOMES
    >>> records = pbekit.open_table("notebooks/data/designed-1000Pa.nc").records
    >>> joint = records.size.sum(axis=1)
    >>> stuck = records.outcome == list(OUTCOMES).index("aggregation")
    >>> f"{stuck.sum()} of {len(stuck)} stick, of joint sizes from {joint[stuck].min()} to {joint[stuck].max()}"
    '11 of 400 stick, of joint sizes from 9 to 18'
    """

    size: np.ndarray
    aspect_ratio: np.ndarray
    outer_radius: np.ndarray
    radius_of_gyration: np.ndarray
    offset: np.ndarray
    outcome: np.ndarray
    source: np.ndarray
    time: np.ndarray
    solves: np.ndarray
    cpu_time: np.ndarray
    products: np.ndarray
    product_size: np.ndarray
    product_from_first: np.ndarray
    product_aspect_ratio: np.ndarray
    product_outer_radius: np.ndarray
    product_radius_of_gyration: np.ndarray
    weight: np.ndarray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.weight is None:
            object.__setattr__(self, "weight", np.ones(len(self.outcome)))
        integer = ("size", "outcome", "source", "solves", "products", "product_size", "product_from_first")
        for f in fields(self):
            value = np.asarray(getattr(self, f.name))
            if f.name in integer:
                value = value.astype(np.int64)
            else:
                # The precision of the file, so that a table read back is the table that was written.
                value = value.astype(np.float32)
            object.__setattr__(self, f.name, value if f.name in integer else value.astype(float))
        n = len(self.outcome)
        wrong = [
            f.name
            for f in fields(self)
            if len(getattr(self, f.name)) != (len(self.product_size) if f.name.startswith("product_") else n)
        ]
        if wrong or len(self.product_size) != self.products.sum():
            raise PBEError(f"records: columns of unequal length: {', '.join(wrong) or 'products'}")
        after = np.bincount(self.encounter_of_product, self.product_size, n) if n else np.zeros(0)
        bad = np.flatnonzero(after != self.size.sum(axis=1))
        if bad.size:
            e = bad[0]
            raise PBEError(
                f"records: encounter {e} ({OUTCOMES[self.outcome[e]]}) of {self.size[e]} primaries has products "
                f"of {after[e]:g}; primaries must be conserved"
            )
        if not (np.isfinite(self.weight) & (self.weight > 0)).all():
            raise PBEError("records: a weight is not a positive number")
        if n and (self.outcome.min() < 0 or self.outcome.max() >= len(OUTCOMES)):
            raise PBEError(f"records: outcome out of range 0 ... {len(OUTCOMES) - 1}")

    def __len__(self) -> int:
        return len(self.outcome)

    @cached_property
    def weighted(self) -> bool:
        """Whether some count more than others."""
        return bool((self.weight != 1.0).any())

    @cached_property
    def encounter_of_product(self) -> np.ndarray:
        """(m,) the encounter each product came from."""
        return np.repeat(np.arange(len(self.products)), self.products)

    @classmethod
    def empty(cls) -> Records:
        pairs = ("size", "aspect_ratio", "outer_radius", "radius_of_gyration", "offset")
        return cls(**{f.name: np.zeros((0, 2) if f.name in pairs else 0) for f in fields(cls)})

    @classmethod
    def join(cls, parts: Iterable[Records]) -> Records:
        """All encounters of several."""
        parts = list(parts) or [cls.empty()]
        return cls(**{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)})

    def select(self, chosen: np.ndarray) -> Records:
        """The encounters chosen by a mask or by ascending indices."""
        mask = np.zeros(len(self), bool)
        mask[chosen] = True
        rows = mask[self.encounter_of_product]
        return self._with(
            {
                f.name: getattr(self, f.name)[rows if f.name.startswith("product_") else mask]
                for f in fields(self)
            }
        )

    def _with(self, columns: Mapping[str, np.ndarray]) -> Records:
        """Other values of columns that need neither check nor rounding."""
        made = object.__new__(Records)
        for f in fields(self):
            object.__setattr__(made, f.name, columns.get(f.name, getattr(self, f.name)))
        return made

    def scaled(self, length: float, time: float) -> Records:
        """The same encounters in units so many times as long, lengths and times to full precision."""
        lengths = (
            "outer_radius",
            "radius_of_gyration",
            "offset",
            "product_outer_radius",
            "product_radius_of_gyration",
        )
        return self._with(
            {"time": self.time * time} | {name: getattr(self, name) * length for name in lengths}
        )

    def shape(self, name: str, radius: float) -> np.ndarray:
        """(n, 2) shape coordinate of the parents."""
        return _coordinate(
            name, radius, self.size, self.aspect_ratio, self.outer_radius, self.radius_of_gyration
        )

    def product_shape(self, name: str, radius: float) -> np.ndarray:
        """(m,) shape coordinate of the products."""
        return _coordinate(
            name,
            radius,
            self.product_size,
            self.product_aspect_ratio,
            self.product_outer_radius,
            self.product_radius_of_gyration,
        )

    @property
    def work(self) -> np.ndarray:
        """(n,) what an encounter costs on any machine, in units of its own: evaluations times size squared."""
        return self.solves * self.size.sum(axis=1) ** 2.0

    @cached_property
    def survivors(self) -> np.ndarray:
        """(n, 2) index of the product that each parent became where both survived, -1 elsewhere."""
        found = np.full((len(self), 2), -1)
        kept = np.isin(self.outcome, SURVIVED) & (self.products == 2)
        start = np.concatenate([[0], np.cumsum(self.products)])[:-1][kept]
        # The first parent's successor holds all its primaries from it.
        first = np.where(self.product_from_first[start] == self.product_size[start], start, start + 1)
        found[kept] = np.stack([first, 2 * start + 1 - first], axis=1)
        return found


def _coordinate(
    name: str,
    radius: float,
    size: np.ndarray,
    aspect_ratio: np.ndarray,
    outer_radius: np.ndarray,
    radius_of_gyration: np.ndarray,
) -> np.ndarray:
    if name not in SHAPES:
        raise PBEError(f"shape: got {name!r}, expected one of {', '.join(SHAPES)}")
    if name == "aspect ratio":
        return aspect_ratio
    length = outer_radius if name == "outer radius" else radius_of_gyration
    return length / (radius * np.cbrt(size))


COLUMNS = {
    "size": ("1", "primary particles of each parent"),
    "aspect_ratio": ("1", SHAPES["aspect ratio"] + " of each parent"),
    "outer_radius": ("m", "outer radius R of each parent"),
    "radius_of_gyration": ("m", "radius of gyration of each parent"),
    "offset": ("m", "offset (x0, y0) of the second parent in the cross section"),
    "outcome": ("1", "outcome of the encounter"),
    "source": ("1", "where the encounter comes from"),
    "time": ("s", "process time in the run"),
    "solves": ("1", "evaluations of the hydrodynamics within the encounter"),
    "cpu_time": ("s", "processor time of the encounter"),
    "weight": ("1", "encounters of a uniform flux that this one stands for"),
    "products": ("1", "aggregates that left the encounter"),
    "product_size": ("1", "primary particles of each product"),
    "product_from_first": ("1", "primary particles that came from the first parent"),
    "product_aspect_ratio": ("1", SHAPES["aspect ratio"] + " of each product"),
    "product_outer_radius": ("m", "outer radius R of each product"),
    "product_radius_of_gyration": ("m", "radius of gyration of each product"),
}


SIZE_RATIO, FINE_RATIO = 1.35, 1.16
"""Of neighbouring size classes, and where many encounters fill them: a step between wide classes shows in the steady sizes."""
MANY = 100_000
"""Encounters."""


def size_ratio(encounters: int) -> float:
    """Ratio of neighbouring size classes for so many encounters."""
    return FINE_RATIO if encounters >= MANY else SIZE_RATIO


def size_classes(largest: int, ratio: float = SIZE_RATIO) -> np.ndarray:
    """Lower bounds of size classes, whole numbers at about a constant ratio, with one bound beyond `largest`."""
    bounds = [1]
    while bounds[-1] <= largest:
        bounds.append(max(bounds[-1] + 1, round(bounds[-1] * ratio)))
    return np.array(bounds)


@dataclass(frozen=True, eq=False)
class KernelTable:
    """Records in classes.

    size_edges : (S + 1,) whole numbers; class s holds sizes size_edges[s] ... size_edges[s + 1] - 1
    shape_edges : (shapes + 1,) or None; shapes beyond the ends belong to the end classes
    radius [m], shear_rate [1/s] and what else is known of the scene: `about`

    Examples
    --------
    >>> import pbekit
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> table.size_edges[:6].tolist(), table.shear_rate, table.radius
    ([1, 2, 3, 4, 5, 6], 10000.0, 5e-07)
    """

    records: Records
    size_edges: np.ndarray
    shape_edges: np.ndarray | None
    radius: float
    shear_rate: float
    shape_name: str = "aspect ratio"
    about: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        records: Records,
        radius: float,
        shear_rate: float,
        *,
        size_edges: ArrayLike | None = None,
        shape_edges: ArrayLike | None = "quantiles",
        shapes: int = 3,
        shape_name: str = "aspect ratio",
        about: Mapping[str, Any] | None = None,
    ) -> KernelTable:
        """Classes that fit the records: sizes by ratio, shapes by quantiles of the parents of three and more."""
        if size_edges is None:
            size_edges = size_classes(
                int(records.size.max()) if len(records) else 1, size_ratio(len(records))
            )
        if isinstance(shape_edges, str):
            seen = records.shape(shape_name, radius)[records.size > 2]
            seen = seen[np.isfinite(seen)]
            shape_edges = None
            if shapes > 1 and seen.size >= 20 * shapes:
                edges = np.quantile(seen, np.linspace(0, 1, shapes + 1))
                shape_edges = np.unique(edges) if np.unique(edges).size > 2 else None
        return cls(
            records,
            np.asarray(size_edges, np.int64),
            None if shape_edges is None else np.asarray(shape_edges, float),
            float(radius),
            float(shear_rate),
            shape_name,
            dict(about or {}),
        )

    def with_records(self, records: Records) -> KernelTable:
        """The same classes over other records."""
        return KernelTable(
            records,
            self.size_edges,
            self.shape_edges,
            self.radius,
            self.shear_rate,
            self.shape_name,
            self.about,
        )

    # -- classes ---------------------------------------------------------------------------------------------------

    @property
    def sizes(self) -> int:
        return self.size_edges.size - 1

    @property
    def shapes(self) -> int:
        return 1 if self.shape_edges is None else self.shape_edges.size - 1

    @cached_property
    def _first_class(self) -> np.ndarray:
        """(S + 1,) first class of each size class; sizes 1 and 2 alone have one shape."""
        single = (self.size_edges[1:] <= 3) | (self.shapes == 1)
        return np.concatenate([[0], np.cumsum(np.where(single, 1, self.shapes))])

    @property
    def classes(self) -> int:
        return int(self._first_class[-1])

    def size_class(self, size: ArrayLike) -> np.ndarray:
        """Index of the size class; sizes beyond the last belong to the last."""
        return np.clip(
            np.searchsorted(self.size_edges, np.asarray(size), side="right") - 1, 0, self.sizes - 1
        )

    def shape_class(self, shape: ArrayLike) -> np.ndarray:
        if self.shape_edges is None:
            return np.zeros(np.shape(shape), np.int64)
        # In the precision in which shapes are stored, so that one on an edge stays in its class.
        inner = self.shape_edges[1:-1].astype(np.float32)
        return np.searchsorted(
            inner, np.nan_to_num(np.asarray(shape, np.float32), nan=inner[0] - 1), side="right"
        )

    def class_of(self, size: ArrayLike, shape: ArrayLike) -> np.ndarray:
        """Class of an aggregate: size class and, from three primaries on, shape class."""
        s = self.size_class(size)
        several = np.diff(self._first_class)[s] > 1
        return self._first_class[s] + np.where(several, self.shape_class(shape), 0)

    @cached_property
    def class_size(self) -> np.ndarray:
        """(C,) size class of each class."""
        return np.repeat(np.arange(self.sizes), np.diff(self._first_class))

    @cached_property
    def class_shape(self) -> np.ndarray:
        """(C,) shape class of each class, -1 where there is one."""
        counts = np.diff(self._first_class)
        return np.concatenate([[-1] if n == 1 else np.arange(n) for n in counts])

    def class_name(self, k: int) -> str:
        """In words, such as "P 5-6, aspect ratio 1.2-1.6"."""
        low, high = self.size_edges[self.class_size[k]], self.size_edges[self.class_size[k] + 1] - 1
        name = f"P {low}" if low == high else f"P {low}-{high}"
        if self.class_shape[k] >= 0 and self.shape_edges is not None:
            a, b = self.shape_edges[self.class_shape[k] : self.class_shape[k] + 2]
            name += f", {self.shape_name} {a:.2f}-{b:.2f}"
        return name

    @cached_property
    def parent_class(self) -> np.ndarray:
        """(n, 2) class of each parent."""
        return self.class_of(self.records.size, self.records.shape(self.shape_name, self.radius))

    @cached_property
    def pair(self) -> np.ndarray:
        """(n,) unordered pair of classes of each encounter: b (b + 1) / 2 + a, a <= b."""
        a, b = self.parent_class.min(axis=1), self.parent_class.max(axis=1)
        return b * (b + 1) // 2 + a

    @property
    def pairs(self) -> int:
        return self.classes * (self.classes + 1) // 2

    @cached_property
    def counts(self) -> np.ndarray:
        """(pairs, outcomes) encounters of each outcome."""
        found = np.bincount(
            self.pair * len(OUTCOMES) + self.records.outcome, minlength=self.pairs * len(OUTCOMES)
        )
        return found.reshape(self.pairs, len(OUTCOMES))

    @cached_property
    def weight_sums(self) -> np.ndarray:
        """(pairs, outcomes) sums of the weights of the encounters of each outcome."""
        at = self.pair * len(OUTCOMES) + self.records.outcome
        found = np.bincount(at, self.records.weight, self.pairs * len(OUTCOMES))
        return found.reshape(self.pairs, len(OUTCOMES))

    def square(self, per_pair: np.ndarray) -> np.ndarray:
        """(C, C, ...) symmetric array from one value per unordered pair."""
        b, a = np.tril_indices(self.classes)
        out = np.zeros((self.classes, self.classes, *per_pair.shape[1:]), per_pair.dtype)
        out[a, b] = per_pair
        out[b, a] = per_pair
        return out

    # -- what else the file shows ------------------------------------------------------------------------------------

    def fragments(self, bins: int = 20) -> tuple[np.ndarray, np.ndarray]:
        """(pairs, bins) mass-weighted density over x (integral one where there are any) and fragments that were seen."""
        r = self.records
        rows = np.isin(r.outcome, SCATTERED)[r.encounter_of_product]
        e = r.encounter_of_product[rows]
        x = r.product_size[rows] / r.size.sum(axis=1)[e]
        at = self.pair[e] * bins + np.minimum((x * bins).astype(int), bins - 1)
        count = np.bincount(at, minlength=self.pairs * bins).reshape(self.pairs, bins)
        # Counted from nothing, numpy answers in whole numbers, weights or not.
        mass = np.bincount(at, x * r.weight[e], self.pairs * bins).astype(float).reshape(self.pairs, bins)
        total = mass.sum(axis=1, keepdims=True)
        return np.divide(mass * bins, total, out=np.zeros_like(mass), where=total > 0), count

    def product_shapes(self) -> np.ndarray:
        """(3, S, shapes) shapes of products by how they came about: survived, joined, scattered."""
        r = self.records
        kind = _kind(r.outcome)[r.encounter_of_product]
        use = (kind >= 0) & (r.product_size > 2)
        shape = self.shape_class(r.product_shape(self.shape_name, self.radius))
        at = (kind * self.sizes + self.size_class(r.product_size)) * self.shapes + shape
        return self._sums(at[use], r.encounter_of_product[use], (3, self.sizes, self.shapes))

    def _sums(self, at: np.ndarray, encounter: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """Weights of encounters summed by place, whole numbers where they all count alike."""
        weight = self.records.weight[encounter] if self.records.weighted else None
        return np.bincount(at, weight, int(np.prod(shape))).reshape(shape)

    def shape_changes(self) -> np.ndarray:
        """(S, shapes, shapes) survivors by size class, shape before, shape after."""
        r = self.records
        before = self.shape_class(r.shape(self.shape_name, self.radius))
        after = self.shape_class(r.product_shape(self.shape_name, self.radius))
        kept = (r.survivors >= 0) & (r.size > 2)
        at = (self.size_class(r.size) * self.shapes + before) * self.shapes + after[r.survivors]
        return self._sums(at[kept], np.nonzero(kept)[0], (self.sizes, self.shapes, self.shapes))

    def radius_moments(self) -> np.ndarray:
        """(C, 4) number of parents in each class, or the sum of their weights, and means of R [m], R^2, R^3."""
        k, radius = self.parent_class.ravel(), self.records.outer_radius.ravel()
        weight = np.repeat(self.records.weight, 2)
        sums = [np.bincount(k, weight * radius**p, self.classes) for p in range(4)]
        seen = np.where(sums[0] > 0, sums[0], 1.0)
        return np.stack([sums[0], *(s / seen for s in sums[1:])], axis=1)

    # -- the file ----------------------------------------------------------------------------------------------------

    def to_dataset(self) -> xr.Dataset:
        """The root of the file."""
        density, fragments = self.fragments()
        bins = density.shape[1]
        pair = ("class_i", "class_j")
        radii = self.radius_moments()
        data = xr.Dataset(
            {
                "trials": (
                    pair,
                    self.square(self.counts.sum(axis=1)),
                    {"units": "1", "long_name": "encounters"},
                ),
                "count": (
                    (*pair, "outcome"),
                    self.square(self.counts),
                    {"units": "1", "long_name": "encounters of each outcome"},
                ),
                "fragment_mass_density": (
                    (*pair, "x"),
                    self.square(density),
                    {"units": "1", "long_name": "mass-weighted density of fragments over x, integral one"},
                ),
                "fragment_count": (
                    (*pair, "x"),
                    self.square(fragments),
                    {"units": "1", "long_name": "fragments"},
                ),
                "product_shape_count": (
                    ("kind", "size_class", "shape_class"),
                    self.product_shapes(),
                    {"units": "1", "long_name": "products of each shape, by size"},
                ),
                "shape_change_count": (
                    ("size_class", "shape_before", "shape_after"),
                    self.shape_changes(),
                    {"units": "1", "long_name": "survivors by shape before and after"},
                ),
                "parents": ("class_i", radii[:, 0], {"units": "1", "long_name": "parents seen in the class"}),
                "outer_radius": (
                    "class_i",
                    radii[:, 1],
                    {"units": "m", "long_name": "mean outer radius <R>"},
                ),
                "outer_radius_2": ("class_i", radii[:, 2], {"units": "m2", "long_name": "<R^2>"}),
                "outer_radius_3": ("class_i", radii[:, 3], {"units": "m3", "long_name": "<R^3>"}),
                "size_edges": (
                    "size_edge",
                    self.size_edges,
                    {"units": "1", "long_name": "first size of each class"},
                ),
                "class_size": ("class_i", self.class_size, {"units": "1", "long_name": "size class"}),
                "class_shape": (
                    "class_i",
                    self.class_shape,
                    {"units": "1", "long_name": "shape class, -1: only one"},
                ),
            },
            coords={
                "outcome": list(OUTCOMES),
                "kind": ["survived", "joined", "scattered"],
                "x": ("x", (np.arange(bins) + 0.5) / bins, {"units": "1", "long_name": "P_f / (P_i + P_j)"}),
            },
            attrs={
                **self.about,
                "title": "Outcomes of encounters of colloidal aggregates, by class",
                "format": WEIGHTED_FORMAT if self.records.weighted else FORMAT,
                "radius": self.radius,
                "shear_rate": self.shear_rate,
                "shape_name": self.shape_name,
            },
        )
        if self.records.weighted:
            note = {"units": "1", "long_name": "sums of the weights of the encounters of each outcome"}
            data["weight_sum"] = ((*pair, "outcome"), self.square(self.weight_sums), note)
        if self.shape_edges is not None:
            note = {"units": "1", "long_name": SHAPES[self.shape_name]}
            data["shape_edges"] = ("shape_edge", self.shape_edges, note)
        return data

    def save(self, path: Path | str) -> None:
        """Write the file, whole or not at all."""
        r = self.records
        columns = {}
        for name, (units, words) in COLUMNS.items():
            if name == "weight" and not r.weighted:
                continue
            value = getattr(r, name)
            dims: tuple[str, ...] = ("product",) if name.startswith("product_") else ("encounter",)
            if value.ndim == 2:
                dims += ("xy",) if name == "offset" else ("parent",)
            note: dict[str, Any] = {"units": units, "long_name": words}
            if name == "outcome":
                note |= {
                    "flag_values": np.arange(len(OUTCOMES)),
                    "flag_meanings": " ".join(o.replace(" ", "_") for o in OUTCOMES),
                }
            if name == "source":
                note |= {"flag_values": np.arange(len(SOURCES)), "flag_meanings": " ".join(SOURCES)}
            if name == "products":
                note |= {"sample_dimension": "product"}
            small = {"outcome": np.int8, "source": np.int8}.get(
                name, np.int32 if value.dtype.kind == "i" else "f4"
            )
            columns[name] = (dims, value.astype(small), note)
        # The index of a compressed variable takes as much as compression gains of a small one.
        pack = {name: {"zlib": True, "complevel": 4} for name, of in columns.items() if of[1].nbytes > SMALL}
        root = self.to_dataset()
        packed: dict[str, Any] = {str(v): {"zlib": True} for v in root.data_vars if root[v].nbytes > SMALL}
        FILES.write_dataset(
            path, TABLE, {"": root, "records": xr.Dataset(columns)}, {"": packed, "records": pack}
        )

    @classmethod
    def load(cls, path: Path | str) -> KernelTable:
        """Read a file that `save` wrote."""
        with FILES.reading(path, EXPECTED):
            with xr.open_dataset(path) as root, xr.open_dataset(path, group="records") as rows:
                root.load()
                rows.load()
            weighted = root.attrs.get("format") == WEIGHTED_FORMAT
            names = [name for name in COLUMNS if weighted or name != "weight"]
            missing = [name for name in names if name not in rows]
            if missing or "size_edges" not in root:
                raise PBEError(
                    f"{path}: no kernel table, lacks {', '.join(missing) or 'size_edges'}; expected {EXPECTED}"
                )
            if not weighted and root.attrs.get("format") != FORMAT:
                raise PBEError(
                    f"{path}: format {root.attrs.get('format')}, this version reads {FORMAT} and {WEIGHTED_FORMAT}"
                )
            records = Records(**{name: rows[name].values for name in names})
            if (records.products < 0).any() or records.products.sum() != len(records.product_size):
                raise ValueError("products of encounters and their numbers do not fit")
            own = ("title", "format", "radius", "shear_rate", "shape_name", "software", "checksum")
            return cls(
                records,
                root.size_edges.values,
                root.shape_edges.values if "shape_edges" in root else None,
                float(root.attrs["radius"]),
                float(root.attrs["shear_rate"]),
                str(root.attrs["shape_name"]),
                {k: v for k, v in root.attrs.items() if k not in own},
            )
        raise AssertionError  # the guard lets nothing pass in silence


def _kind(outcome: np.ndarray) -> np.ndarray:
    """0 survived, 1 joined, 2 scattered, -1 unresolved."""
    kind = np.full(len(OUTCOMES), -1)
    for k, members in enumerate((SURVIVED, JOINED, SCATTERED)):
        kind[list(members)] = k
    return kind[outcome]


kind_of = _kind
