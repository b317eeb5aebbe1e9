"""An encounter followed under observation: every step of a scheme is seen, no shortcut is taken.

What a step did to positions and contacts is judged at once and kept as extremes, so that a case of a hundred
thousand steps needs no more memory than one of ten.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mcdem.encounter.simulate import options_of, physics_of
from mcdem.integrators import state
from mcdem.integrators.pairs import find_gaps
from mcdem.integrators.scheme import scheme_of
from mcdem.integrators.time_loop import Bounds, follow_steps, new_watch

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.scene import Scene


@dataclass
class Watched:
    """What was seen.  Lengths in a, times in 1/g, forces in 6 pi mu a^2 g.

    positions, bonded : (N, 3), (N, N) at the end
    code : of `mcdem.integrators.state`;  strain : reached
    made_at : largest gap at which a contact was made;  lost_at : smallest gap at which one was lost
    kept_to : largest gap of a contact that was kept;  free_from : smallest gap of a pair left out of contact
    deepest : smallest gap of any pair, after a step
    finite : whether all positions were numbers
    states : (positions, bonded) at a few times
    """

    positions: NDArray[np.float64]
    bonded: NDArray[np.bool_]
    code: int = state.DONE
    strain: float = 0.0
    steps: int = 0
    changes: int = 0
    made_at: float = -np.inf
    lost_at: float = np.inf
    kept_to: float = -np.inf
    free_from: float = np.inf
    deepest: float = np.inf
    finite: bool = True
    states: list[tuple[NDArray[np.float64], NDArray[np.bool_]]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Start:
    """Primaries at a moment.

    positions : (N, 3) [m];  bonded : (N, N);  parent : (N,) the aggregate, 0 or 1, that each belongs to
    """

    positions: NDArray[np.float64]
    bonded: NDArray[np.bool_]
    parent: NDArray[np.int64]


def side_by_side(first: Aggregate, second: Aggregate, separation: Sequence[float]) -> Start:
    """Two aggregates as they are, the centre of the second at `separation` (3,) [m] from that of the first."""
    sizes = [first.size, second.size]
    bonded = np.zeros((sum(sizes), sum(sizes)), bool)
    bonded[: sizes[0], : sizes[0]] = first.contact_network()
    bonded[sizes[0] :, sizes[0] :] = second.contact_network()
    positions = np.concatenate([first.positions, second.positions + np.asarray(separation)])
    return Start(positions, bonded, np.repeat([0, 1], sizes))


def watch(scene: Scene, start: Start, strain: float, sampled: int = 4) -> Watched:
    """Follow primaries by the scheme of the scene for `strain`, and keep about `sampled` states on the way."""
    length = scene.reduced.length
    n = len(start.positions)
    motion = state.Motion(
        np.ascontiguousarray(start.positions) / length,
        (start.positions[:, [1]] / length) * np.array([0.0, 0.0, 1.0]),
        start.bonded.copy(),
        np.full((n, n), -np.inf),
        np.ones(n),
        start.parent.astype(np.int64),
    )
    flow, physics = physics_of(scene)
    options = options_of(scene)
    work = scheme_of(options).workspace(n, False)
    log, history = state.new_log(), state.new_history(motion)
    gaps = np.zeros((n, n))
    find_gaps(motion.positions, motion.radii, gaps)
    pairs = np.triu(np.ones((n, n), bool), 1)
    seen = Watched(motion.positions, motion.bonded)
    group = state.Group(motion, history, gaps, work)
    # Paused at once after each step; no bodies part, none settles.
    bounds = Bounds(0.0, np.inf, -1.0, strain, scene.numerics.most_steps)
    keeper = new_watch(log, 0.0)
    due = 0.0
    while log.time[0] < strain - 1e-12:
        if log.time[0] >= due:
            due += strain / sampled
            seen.states.append((motion.positions.copy(), motion.bonded.copy()))
        before = motion.bonded.copy()
        code = follow_steps(group, flow, physics, options, log, keeper, bounds)
        seen.code = state.DONE if code == state.PAUSED else code
        seen.finite &= bool(np.isfinite(motion.positions).all())
        if seen.code != state.DONE or not seen.finite:
            break
        look(seen, before, motion.bonded, gaps, pairs)
    seen.strain, seen.steps = float(log.time[0]), int(log.steps[0])
    seen.states.append((motion.positions.copy(), motion.bonded.copy()))
    return seen


def look(
    seen: Watched,
    before: NDArray[np.bool_],
    after: NDArray[np.bool_],
    gaps: NDArray[np.float64],
    pairs: NDArray[np.bool_],
) -> None:
    """Note what a step did; gaps (N, N) are those after it."""
    seen.deepest = min(seen.deepest, gaps.min(where=pairs, initial=np.inf))
    seen.free_from = min(seen.free_from, gaps.min(where=pairs & ~after, initial=np.inf))
    seen.kept_to = max(seen.kept_to, gaps.max(where=pairs & after, initial=-np.inf))
    changed = pairs & (before != after)
    if changed.any():
        seen.changes += int(changed.sum())
        seen.made_at = max(seen.made_at, gaps.max(where=changed & after, initial=-np.inf))
        seen.lost_at = min(seen.lost_at, gaps.min(where=changed & before, initial=np.inf))
