"""The course of an encounter, recorded frame by frame where the caller asked for it.  Reduced units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcdem.effects.sums import contact_force
from mcdem.integrators.rotations import turn_back
from mcdem.integrators.state import Motion, Physics, harmonic_radius
from mcdem.rigid_aggregates.statics import RigidBody


class Frames(NamedTuple):
    """Recorded states, one every `interval`."""

    interval: float
    written: NDArray[np.int64]  # (N,) count of frames of each primary
    time: NDArray[np.float64]  # (F,)
    positions: NDArray[np.float64]  # (F, N, 3)
    tension: NDArray[np.float64]  # (F, N, N), nan where there is no contact


def new_frames(interval: float, duration: float, n: int) -> Frames:
    """Room for the frames of n primaries over `duration`."""
    count = int(np.ceil(duration / interval)) + 2
    return Frames(
        interval,
        np.zeros(n, np.int64),
        interval * np.arange(count, dtype=float),
        np.zeros((count, n, 3)),
        np.full((count, n, n), np.nan),
    )


def keep(
    frames: Frames | None,
    part: Motion,
    members: NDArray[np.intp],
    physics: Physics,
    time: float,
    body: RigidBody | None = None,
    turn: NDArray[np.float64] | None = None,
    strain: NDArray[np.float64] | None = None,
) -> None:
    """Write the state of some primaries (m,) to every frame whose time has come.

    A step may end later than a frame; the positions are those within the step, along its velocities.  The tensions are
    those of the contacts' gaps; of a rigid body turned by `turn` (3, 3) in the strain (3, 3), what statics says of it:
    its gaps are frozen.
    """
    if frames is None:
        return
    first, second = np.nonzero(np.tril(part.bonded, -1))
    if body is not None and turn is not None and strain is not None:
        seen = np.empty(5)
        turn_back(turn, strain, seen)
        tension = (body.rest + body.response @ seen)[: body.contacts]
    else:
        distances = np.linalg.norm(part.positions[first] - part.positions[second], axis=1)
        tension = np.array(
            [
                -contact_force(
                    distance - part.radii[i] - part.radii[j],
                    harmonic_radius(part.radii[i], part.radii[j]),
                    physics.contact,
                )[0]
                for i, j, distance in zip(first, second, distances, strict=True)
            ]
        )
    while True:
        k = frames.written[members[0]]
        if k >= len(frames.time) or time < frames.interval * k - 1e-9:
            return
        frames.written[members] = k + 1
        late = time - frames.time[k] if body is None else 0.0
        frames.positions[k, members] = part.positions - late * part.velocities
        frames.tension[k, members[first], members[second]] = tension
        frames.tension[k, members[second], members[first]] = tension
