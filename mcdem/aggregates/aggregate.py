"""An aggregate: where its primary particles are and which of them touch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy

from mcdem.arguments import scene_at_door
from mcdem.errors import UserError
from mcdem.integrators.bodies import label_bodies
from mcdem.quantities.units import LENGTH, si

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mcdem.scene import Scene


@dataclass(frozen=True, eq=False)
class Aggregate:
    """Primary particles held together by contacts.

    positions : (P, 3) [m] centres about the centre of mass
    bonds : (B, 2) contacts i < j, sorted.  They are carried through everything that happens: a pair with a gap
        between 0 and the pull-off gap can be in contact or not, so geometry alone does not decide.
    springs : (B, 7) history of each contact between its spheres i (1) and j (2), lengths in radii of a primary, angles in
        radians, as `mcdem.effects.tangential` keeps it; None without one: contacts at rest, or of a scene without resistances
    radii : (P,) [m] of the primaries; None where the suspension has only one

    Examples
    --------
    >>> import numpy as np
    >>> import mcdem
    >>> doublet = mcdem.Aggregate(np.array([[0, 0, -0.5e-6], [0, 0, 0.5e-6]]), np.array([[0, 1]]))
    >>> doublet.size, f"{doublet.outer_radius(0.5e-6):.1e} m"
    (2, '1.0e-06 m')
    """

    positions: NDArray[np.float64]
    bonds: NDArray[np.int32]
    springs: NDArray[np.float64] | None = None
    radii: NDArray[np.float64] | None = None

    @property
    def size(self) -> int:
        """Number of primary particles P."""
        return self.positions.shape[0]

    def outer_radius(self, radius: float) -> float:
        """Outer radius R [m]: from the centre of mass to the furthest surface; `radius` [m] where all primaries have the same."""
        if self.radii is not None:
            return float((np.linalg.norm(self.positions, axis=1) + self.radii).max())
        return float(np.sqrt(self._furthest) + radius)

    @cached_property
    def _furthest(self) -> float:
        return float((self.positions**2).sum(axis=1).max())

    @classmethod
    def monomer(cls, radius: float | str | None = None) -> Aggregate:
        """A free primary particle; `radius` in a suspension of several, a number in m or with a unit."""
        radii = None if radius is None else np.array([si("radius", radius, LENGTH.positive)])
        return cls(np.zeros((1, 3)), np.zeros((0, 2), np.int32), radii=radii)

    @classmethod
    def from_contacts(
        cls,
        positions: NDArray[np.float64],
        bonded: NDArray[np.bool_],
        springs: NDArray[np.float64] | None = None,
        radii: NDArray[np.float64] | None = None,
    ) -> Aggregate:
        """The aggregate at `positions` (P, 3) [m] with the contact network `bonded` (P, P).

        springs : (P, P, 7) history of the contact of i < j at [j, i]
        """
        first, second = np.nonzero(np.triu(bonded, 1))
        centred = positions - centre_of_mass(positions, radii)
        bonds = np.column_stack([first, second]).astype(np.int32)
        return cls(centred, bonds, None if springs is None else springs[second, first], radii)

    @classmethod
    def from_positions(
        cls,
        scene: Scene,
        positions: ArrayLike,
        bonds: ArrayLike | None = None,
        radii: ArrayLike | None = None,
    ) -> Aggregate:
        """An aggregate from positions (P, 3) given by a user; `radii` (P,) in a suspension of several.

        Lengths are numbers in m, text with units, or quantities of pint.  Without `bonds` (B, 2), pairs up to the pull-off gap
        count as contacts.  Raises `UserError` for positions that are not finite, primaries that overlap by more than a contact
        can be compressed, bonds of primaries that are apart, or parts that do not touch.
        """
        scene_at_door(scene)
        points = si("positions", positions, LENGTH, (None, 3))
        if not 1 <= len(points) <= MOST_PRIMARIES:
            raise UserError(f"positions: found {len(points)} primaries, expected 1 to {MOST_PRIMARIES}")
        sizes, radius = radii_of(scene, radii, len(points)), scene.suspension.radius
        touching = 2.0 * radius if sizes is None else sizes[:, None] + sizes[None]
        gaps = np.linalg.norm(points[:, None] - points[None], axis=2) - touching
        np.fill_diagonal(gaps, np.inf)
        limit = overlap_limit(scene) * radius
        if gaps.min() < -limit:
            i, j = np.unravel_index(gaps.argmin(), gaps.shape)
            raise UserError(
                f"positions: primaries {i} and {j} overlap by {-gaps[i, j] / radius:.3g} radii, more than the "
                f"{limit / radius:.3g} that a contact allows: move them apart (are the positions in metres?)"
            )
        bonded = np.zeros(gaps.shape, bool)
        if bonds is None:
            contact = scene.effects.contact
            reach = contact.pull_off_gap(radius) if contact is not None else 0.0
            if sizes is None:
                bonded[gaps <= reach] = True
            else:
                # The pull-off gap grows with the cube root of the reduced radius (`effects.elastic_contact`).
                reduced = 2.0 * sizes[:, None] * sizes[None] / (touching * radius)
                bonded[gaps <= reach * np.cbrt(reduced)] = True
        else:
            pairs = _pairs(bonds, len(points))
            _refuse_apart(scene, points, sizes, pairs)
            bonded[pairs[:, 0], pairs[:, 1]] = bonded[pairs[:, 1], pairs[:, 0]] = True
        count, _ = scipy.sparse.csgraph.connected_components(bonded)
        if count > 1:
            raise UserError(
                f"positions: the primaries form {count} parts that do not touch, expected one aggregate: "
                "bring them into contact, or name the contacts as bonds"
            )
        return cls.from_contacts(points, bonded, radii=sizes)

    @classmethod
    def at_door(cls, scene: Scene, given: Aggregate | ArrayLike, name: str) -> Aggregate:
        """The aggregate that a user gave: an `Aggregate` of this suspension, or positions (P, 3).

        Raises `UserError` that starts with `name` for arrays that are not those of an aggregate of the scene.
        """
        try:
            if not isinstance(given, Aggregate):
                return cls.from_positions(scene, given)
            points, bonds = np.asarray(given.positions), np.asarray(given.bonds)
            if points.ndim != 2 or points.shape[1] != 3 or not len(points) or points.dtype != np.float64:
                raise UserError(
                    f"positions: expected floats (P, 3) in metres, found {points.dtype} of {points.shape}"
                )
            if not np.isfinite(points).all():
                raise UserError("positions: found a number that is not finite")
            pairs = _pairs(bonds, len(points))
            sizes = radii_of(scene, given.radii, len(points))
            _refuse_apart(scene, points, sizes, pairs)
            springs = given.springs
            if springs is not None and np.shape(springs) != (len(pairs), 7):
                raise UserError(f"springs: expected shape ({len(pairs)}, 7), found {np.shape(springs)}")
            return given
        except UserError as problem:
            raise UserError(f"aggregate {name}: {problem}") from None

    def contact_network(self) -> NDArray[np.bool_]:
        """Contacts as a symmetric matrix (P, P)."""
        bonded = np.zeros((self.size, self.size), bool)
        bonded[self.bonds[:, 0], self.bonds[:, 1]] = bonded[self.bonds[:, 1], self.bonds[:, 0]] = True
        return bonded

    def turned(self, rng: np.random.Generator) -> Aggregate:
        """The aggregate in a random orientation, uniform over all rotations."""
        if self.size == 1:
            return self
        turn = scipy.spatial.transform.Rotation.random(rng=rng)
        springs = self.springs
        if springs is not None and len(springs):
            springs = np.hstack([turn.apply(springs[:, :3]), turn.apply(springs[:, 3:6]), springs[:, 6:]])
        return Aggregate(turn.apply(self.positions), self.bonds, springs, self.radii)


def centre_of_mass(positions: NDArray[np.float64], radii: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Centre of mass (3,) of primaries at (P, 3) with radii (P,), or all the same if None."""
    if radii is None or (radii == radii[0]).all():
        return np.asarray(positions.mean(axis=0))
    return np.asarray(np.average(positions, axis=0, weights=radii**3))


def radii_of(scene: Scene, radii: ArrayLike | None, count: int) -> NDArray[np.float64] | None:
    """Radii (count,) [m] given by a user, as those of the scene; None where the scene has only one.

    Raises `UserError` where there are several and none are given, or given ones are not of the scene.
    """
    species = np.array(scene.suspension.species)
    known = " and ".join(f"{r:g} m" for r in species)
    if radii is None:
        if len(species) == 1:
            return None
        raise UserError(f"radii: the suspension has several, {known}: give that of each primary")
    given = si("radii", radii, LENGTH, (None,))
    if given.shape != (count,):
        raise UserError(f"radii: expected one for each of {count} primaries, found {len(given)}")
    nearest = np.abs(given[:, None] - species).argmin(axis=1)
    off = ~np.isclose(given, species[nearest], rtol=1e-6, atol=0.0)
    if off.any():
        row = int(off.argmax())
        raise UserError(
            f"radii: primary {row} has {given[row]:g} m, expected {known.replace(' and ', ' or ')}"
        )
    return None if len(species) == 1 else species[nearest]


MOST_PRIMARIES = 10_000
"""Of an aggregate that a user gives: all its pairs are looked at."""
APART = 0.1
"""Gap in radii beyond which two primaries that are named as a contact cannot be one, unless they are so soft
that they hold over twice the pull-off gap."""


def _pairs(bonds: object, count: int) -> NDArray[np.int64]:
    """Contacts (B, 2) named by a user among `count` primaries; raises `UserError`."""
    try:
        pairs = np.asarray(bonds)
    except ValueError:
        raise UserError("bonds: expected whole numbers (B, 2), two primaries for each contact") from None
    if pairs.shape in ((0,), (0, 2)):
        return np.zeros((0, 2), np.int64)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise UserError(
            f"bonds: expected whole numbers (B, 2), two primaries for each contact, found {pairs.dtype} of shape {pairs.shape}"
        )
    if pairs.min() < 0 or pairs.max() >= count or (pairs[:, 0] == pairs[:, 1]).any():
        raise UserError(f"bonds: expected pairs of different numbers from 0 to {count - 1}")
    return pairs.astype(np.int64)


def _refuse_apart(
    scene: Scene, points: NDArray[np.float64], sizes: NDArray[np.float64] | None, pairs: NDArray[np.int64]
) -> None:
    """Refuse contacts of primaries that do not touch; raises `UserError`."""
    if not len(pairs):
        return
    radius = scene.suspension.radius
    touching = 2.0 * radius if sizes is None else sizes[pairs].sum(axis=1)
    gaps = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) - touching
    if gaps.max() <= APART * radius:
        return
    contact = scene.effects.contact
    reach = (
        2.0 * contact.pull_off_gap(radius) if contact is not None else 0.0
    )  # of soft contacts beyond APART
    if gaps.max() > reach:
        i, j = pairs[gaps.argmax()]
        raise UserError(
            f"bonds: primaries {i} and {j} are a gap of {gaps.max() / radius:.3g} radii apart, expected touching ones: bring "
            "them into contact, or remove the bond (are the positions in metres?)"
        )


def overlap_limit(scene: Scene) -> float:
    """Largest overlap h/a accepted at the door, a the largest radius: well beyond what a contact bears, at least a hundredth."""
    contact, radius = scene.effects.contact, scene.suspension.radius
    return 0.01 if contact is None else max(0.01, 10.0 * (contact.contact_radius(radius) / radius) ** 2)


def split(bonded: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Members of the connected components of the contact network, each sorted, in the order of their first member."""
    labels = np.empty(len(bonded), np.int64)
    count = label_bodies(np.ascontiguousarray(bonded), labels)
    return [np.flatnonzero(labels == part) for part in range(count)]
