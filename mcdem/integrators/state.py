"""What an encounter is while it runs: positions, contacts, and the log of what happened.  Reduced units.

Kernels return codes; `mcdem.encounter.simulate` turns them into words.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mcdem.compilation import compiled, separately_compiled

DONE = 0
PARTED = -1  # bodies recede from each other for good
SETTLED = -2  # one body whose contacts have not changed for a while
PAUSED = -3
LOOSE = -4  # two bodies with a wide gap between them, whose contacts have not changed for a while
NOT_POSITIVE_DEFINITE = 1  # the resistance could not be factorised
NOT_CONVERGED = 2  # the contact forces of a step could not be found, however small the step
TOO_MANY_STEPS = 3
NOT_FINITE = 4


class Motion(NamedTuple):
    """The moving primaries."""

    positions: np.ndarray  # (N, 3)
    velocities: np.ndarray  # (N, 3) mean over the last step
    bonded: np.ndarray  # (N, N) bool; contacts are carried, never read off the geometry
    born: np.ndarray  # (N, N) time at which a contact was made, -inf before the start
    radii: np.ndarray  # (N,)
    parent: np.ndarray  # (N,) 0 or 1: the aggregate a primary came with
    # (N, N, 7) at [i, j], i > j: history of the contact of j (sphere 1) and i (sphere 2), see `effects.tangential`; None where
    # contacts resist neither sliding, rolling nor twisting
    springs: np.ndarray | None = None


class History(NamedTuple):
    """The last two steps, newest first, for extrapolation; a step of 0 is none."""

    steps: np.ndarray  # (2,)
    positions: np.ndarray  # (2, N, 3) at the middle of the step
    velocities: np.ndarray  # (2, N, 3) mean over the step
    gaps: np.ndarray  # (2, N, N) before the last step and before the one before


class Physics(NamedTuple):
    """What acts on the primaries; what a scene does not call for is not there."""

    level: object  # parameters of the level of hydrodynamics (`hydrodynamics.level`)
    pair_forces: tuple[Any, ...]  # parameters of each force between spheres not in contact (`effects.sums`)
    contact: object  # those of the contact law, or None
    resistances: tuple[Any, ...]  # those of each resistance of contacts


class Log(NamedTuple):
    """Times and extremes, written as the encounter goes; one-element arrays."""

    time: np.ndarray
    steps: np.ndarray
    solves: np.ndarray
    first_contact: np.ndarray  # nan until the two aggregates touch
    last_bond_change: np.ndarray  # nan until a contact is made or lost
    first_bond_loss: np.ndarray
    largest_tension: np.ndarray
    smallest_gap: np.ndarray  # between primaries of different parents
    skipped: np.ndarray  # time not followed primary by primary, over all parts


class Group(NamedTuple):
    """Primaries that are followed together."""

    motion: Motion
    history: History
    gaps: np.ndarray  # (N, N) surface gaps now
    work: object  # work arrays of the scheme


def new_log() -> Log:
    """An empty log."""
    return Log(
        time=np.zeros(1),
        steps=np.zeros(1, np.int64),
        solves=np.zeros(1, np.int64),
        first_contact=np.full(1, np.nan),
        last_bond_change=np.full(1, np.nan),
        first_bond_loss=np.full(1, np.nan),
        largest_tension=np.zeros(1),
        smallest_gap=np.full(1, np.inf),
        skipped=np.zeros(1),
    )


@compiled
def harmonic_radius(a, b):
    """Harmonic mean of two radii, 2ab/(a + b)."""
    return a if a == b else 2.0 * a * b / (a + b)


@compiled
def relax_springs(springs, i, j):
    """A contact that is made or lost has no history."""
    if springs is not None:
        springs[i, j] = 0.0
        springs[j, i] = 0.0


@compiled
def note_contact_made(motion, log, i, j, time):
    """Note a contact that was just made."""
    motion.bonded[i, j] = motion.bonded[j, i] = True
    relax_springs(motion.springs, i, j)
    motion.born[i, j] = motion.born[j, i] = time
    log.last_bond_change[0] = time
    if motion.parent[i] != motion.parent[j] and np.isnan(log.first_contact[0]):
        log.first_contact[0] = time


@compiled
def note_contact_lost(motion, log, i, j, time):
    """Note a contact that was just lost."""
    motion.bonded[i, j] = motion.bonded[j, i] = False
    relax_springs(motion.springs, i, j)
    log.last_bond_change[0] = time
    if np.isnan(log.first_bond_loss[0]):
        log.first_bond_loss[0] = time


# A contact made at h = 0 starts at 0.889 of its pull-off force and relaxes within a hundredth of the shear time.
# That is no load: tensions are logged once a contact is this old.
SETTLING_TIME = 0.1


@compiled
def note_tension(motion, log, i, j, tension, time):
    """Note the tension of a contact that had time to settle."""
    if time >= motion.born[i, j] + SETTLING_TIME:
        log.largest_tension[0] = max(log.largest_tension[0], tension)


def new_history(motion: Motion) -> History:
    """No steps yet: extrapolation then uses the velocities given at the start."""
    n = motion.radii.shape[0]
    history = History(np.zeros(2), np.zeros((2, n, 3)), np.zeros((2, n, 3)), np.zeros((2, n, n)))
    history.positions[0] = motion.positions
    history.velocities[0] = motion.velocities
    return history


@separately_compiled()
def remember(history, motion, before, gaps, step):
    """Push the step that led from positions `before` and `gaps` to those of `motion`."""
    history.steps[1] = history.steps[0]
    history.steps[0] = step
    for i in range(before.shape[0]):
        for k in range(3):
            history.positions[1, i, k] = history.positions[0, i, k]
            history.velocities[1, i, k] = history.velocities[0, i, k]
            history.positions[0, i, k] = 0.5 * (before[i, k] + motion.positions[i, k])
            history.velocities[0, i, k] = motion.velocities[i, k]
        for j in range(before.shape[0]):
            history.gaps[1, i, j] = history.gaps[0, i, j]
            history.gaps[0, i, j] = gaps[i, j]


@compiled
def forget_older(history):
    """After a contact was made or lost the motion has a kink: extrapolate from the last step alone."""
    history.steps[1] = 0.0
