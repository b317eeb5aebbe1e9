"""Aggregates by name or from a file: a straight chain of so many primaries, or the places of primaries in rows of text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mcdem.aggregates.aggregate import Aggregate
from mcdem.effects.sums import contact_equilibrium
from mcdem.errors import UserError

if TYPE_CHECKING:
    from mcdem.scene import Scene

LONGEST_CHAIN = 1000


def straight_chain(scene: Scene, count: int) -> Aggregate:
    """A straight chain along z, its contacts at rest.

    Parameters
    ----------
    scene : Scene
        Whose primaries and contact law are taken; without a contact law they touch.
    count : int
        Primaries, 1 to 1000.

    Returns
    -------
    Aggregate
        Positions (count, 3) [m] about the centre of mass.

    Raises
    ------
    UserError
        Of another count, or a scene whose primaries are of several radii.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.aggregates import straight_chain
    >>> chain = straight_chain(mcdem.load_scene("scenes/paper-1000Pa.toml"), 3)
    >>> chain.bonds.tolist()
    [[0, 1], [1, 2]]
    >>> [f"{z:.4e}" for z in chain.positions[:, 2]]
    ['-9.9968e-07', '0.0000e+00', '9.9968e-07']
    """
    if not 1 <= count <= LONGEST_CHAIN:
        raise UserError(f"expected 1 to {LONGEST_CHAIN} primaries")
    scene.require_one_radius(f"for {count} of several, give a file with rows x y z radius")
    rest, _ = contact_equilibrium(1.0, scene.kernels.contact)
    spacing = 2.0 * scene.suspension.radius * (1.0 + 0.5 * rest)
    return Aggregate.from_positions(scene, np.arange(count)[:, None] * [[0.0, 0.0, spacing]])


def read_aggregate(scene: Scene, path: Path | str) -> Aggregate:
    """The aggregate in a text file: a row x y z for each primary, in units of its radius.

    In a scene of several radii rows are x y z radius, in units of the largest.  Contacts are read off the gaps.

    Parameters
    ----------
    scene : Scene
        Whose primaries and contact law are taken.
    path : str or Path
        Text file of P rows.

    Returns
    -------
    Aggregate
        Positions (P, 3) [m] about the centre of mass, and its contacts.

    Raises
    ------
    UserError
        Of a file that cannot be read or holds no such table, and of primaries that overlap or fall apart.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.aggregates import read_aggregate
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> cluster = read_aggregate(scene, "scenes/clusters/rod-27.txt")
    >>> cluster.size, len(cluster.bonds), f"{2 * len(cluster.bonds) / cluster.size:.1f} contacts a primary"
    (27, 75, '5.6 contacts a primary')
    """
    radius, several = scene.suspension.radius, scene.suspension.radii is not None
    try:
        rows = np.loadtxt(Path(path), ndmin=2)
    except OSError as problem:
        raise UserError(f"cannot be read: {problem.strerror or problem}; or give a number") from None
    except ValueError as problem:
        raise UserError(f"not a table of numbers: {problem}") from None
    if rows.ndim != 2 or rows.shape[1] != (4 if several else 3) or len(rows) == 0:
        raise UserError(
            f"expected a row x y z{' radius' if several else ''} for each primary, found {rows.shape[1]} columns"
        )
    return Aggregate.from_positions(
        scene, rows[:, :3] * radius, radii=rows[:, 3] * radius if several else None
    )


def aggregate_of(scene: Scene, given: str, name: str = "aggregate") -> Aggregate:
    """A chain, of a number, or what a file holds, of anything else; raises `UserError` that begins with `name`."""
    try:
        if given.isdecimal():
            # A number of thousands of digits is as wrong as one of five, and is neither read nor shown.
            given = given[:5]
            return straight_chain(scene, int(given))
        return read_aggregate(scene, given)
    except UserError as problem:
        raise UserError(f"{name} {given}: {problem}") from None
