"""PySDM (super-droplets): collision kernel, coalescence efficiency and fragmentation by pair, from the table.

PySDM takes the objects that its `Collision` is made of: a kernel and efficiencies with `register(particulator)` and
`__call__(output, is_first_in_pair)`, and a fragmentation with `__call__(nf, frag_mass, u01,
is_first_in_pair)`: one size of fragments per
event.  A fragment size drawn by its share of the mass, and as many of it as the mass allows, has the
expected numbers of the table.
"""

from __future__ import annotations

import numpy as np

from pbekit.export.arrays import arrays_of, packed
from pbekit.export.target import MARK, HandOver, Target

MODULE = f'''"""{MARK}: collisions of PySDM with the rates of a table.

    from kernels_pysdm import collision
    builder.add_dynamic(collision(primary_mass))     # [kg] of one primary

Mass counts primaries; a mass between classes is taken for the nearest class, one beyond the last for the last.
"""

from pathlib import Path

import numpy as np

DATA = np.load(Path(__file__).with_name("kernels.npz"))
SIZES, K, B, BELOW = DATA["P"], DATA["K"], DATA["B"], DATA["mass_below"]
MIDDLE = np.sqrt(SIZES[1:] * SIZES[:-1])


class _OfPairs:
    """What is looked up for each candidate pair."""

    def __init__(self, primary_mass):
        self.primary_mass, self.particulator = primary_mass, None

    def register(self, particulator):
        self.particulator = particulator

    def _pairs(self, is_first_in_pair):
        """Places of the first of each pair, and the masses [primaries] of both."""
        first = np.flatnonzero(is_first_in_pair.indicator.to_ndarray()[: self.particulator.attributes.super_droplet_count])
        mass = self.particulator.attributes["water mass"]
        order, raw = mass.idx.to_ndarray(), mass.to_ndarray(raw=True)
        m = raw[order] / self.primary_mass
        return first, m[first], m[first + 1]

    @staticmethod
    def _class(mass):
        return np.searchsorted(MIDDLE, mass)

    @staticmethod
    def _put(output, first, value):
        held = np.zeros(output.shape)
        held[first // 2] = value
        output.upload(held)


class EncounterKernel(_OfPairs):
    """K + B [m^3/s]: every encounter that changes sizes."""

    def __call__(self, output, is_first_in_pair):
        first, i, j = self._pairs(is_first_in_pair)
        self._put(output, first, (K + B)[self._class(i), self._class(j)])


class AggregationKernel(EncounterKernel):
    """K [m^3/s] alone, for `Coalescence` without breakup, which ignores its efficiency."""

    def __call__(self, output, is_first_in_pair):
        first, i, j = self._pairs(is_first_in_pair)
        self._put(output, first, K[self._class(i), self._class(j)])


class CoalescenceEfficiency(_OfPairs):
    """K/(K + B); what does not coalesce breaks."""

    def __call__(self, output, is_first_in_pair):
        first, i, j = self._pairs(is_first_in_pair)
        a, b = self._class(i), self._class(j)
        self._put(output, first, K[a, b] / (K + B)[a, b])


class Fragments(_OfPairs):
    """One size of fragments per event, drawn by its share of the mass.

    By its own random numbers: PySDM 3 seeds those that it gives here like those that decide between
    coalescence and breakup, so that
    of the fragments of pairs that break only some would ever be drawn.
    """

    def __init__(self, primary_mass, seed=0):
        super().__init__(primary_mass)
        self.rng = np.random.default_rng(seed)

    def __call__(self, nf, frag_mass, u01, is_first_in_pair):
        first, i, j = self._pairs(is_first_in_pair)
        a, b = self._class(i), self._class(j)
        u = self.rng.random(first.size)
        drawn = SIZES[np.minimum((BELOW[a, b] < u[:, None]).sum(axis=1), SIZES.size - 1)]
        drawn = np.minimum(drawn, np.maximum(i + j - 1, 1))
        self._put(frag_mass, first, drawn * self.primary_mass)
        self._put(nf, first, (i + j) / drawn)


def collision(primary_mass, seed=0, **options):
    """PySDM's `Collision` with the table's rates; `seed` of the fragments, `options` are its own."""
    from PySDM.dynamics import Collision
    from PySDM.dynamics.collisions.breakup_efficiencies import ConstEb

    return Collision(
        collision_kernel=EncounterKernel(primary_mass),
        coalescence_efficiency=CoalescenceEfficiency(primary_mass),
        breakup_efficiency=ConstEb(1.0),
        fragmentation_function=Fragments(primary_mass, seed),
        **options,
    )
'''


def files(given: HandOver) -> dict[str, str | bytes]:
    """The module and its arrays."""
    arrays = arrays_of(given)
    p = arrays["P"]
    mass = np.cumsum(arrays["daughters"] * p, axis=2)
    kept = {name: arrays[name] for name in ("P", "K", "B", "a", "g", "n0")}
    return {
        "kernels_pysdm.py": MODULE,
        "kernels.npz": packed({**kept, "mass_below": mass / mass[..., -1:]}),
    }


TARGET = Target(
    title="PySDM (super-droplets)",
    files=files,
    notes={
        "kernels_pysdm.py": "collision(primary_mass) for builder.add_dynamic; keep it beside kernels.npz",
        "kernels.npz": "its arrays: P, K, B [m^3/s], and the share of the daughters' mass up to each class",
    },
    cannot=(
        "Fragments of several sizes in one event: each event gives one size, so that expected numbers are "
        "the table's while single "
        "events are not.",
        "Whole multiplicities: PySDM rounds numbers of fragments, which loses a little mass to round-off in "
        "numbers or is warned of.",
        "Efficiency without breakup: its Coalescence ignores the efficiency (issue 1945 of PySDM); take AggregationKernel there.",
        "Shapes.",
    ),
    check="A box of 2^12 super-droplets of one primary each, from n0 of the table, in steps in which the mean "
    "size changes by a few per "
    "cent at most: the mean size must follow course.csv, within its band and the scatter of the method (some per cent).",
)
