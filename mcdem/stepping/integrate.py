"""From the start of an encounter to its end.

Without shortcuts this is one loop over the steps of the chosen scheme, all primaries together (`march`).  The
shortcuts (`Shortcuts`, each with an off) skip what cannot change the outcome:

  far approach     two rigid aggregates come together as bodies with a stresslet (`approach`)
  separate bodies  parts that recede from each other go on as smaller problems
  rigid rotation   an aggregate without floppy modes turns as a rigid body until its load nears its strength (`rigid`)
  inert            a rigid aggregate that bears its worst orientation is done: nothing can happen to it alone

What is floppy, near something else, or near its strength is followed primary by primary.  The decisions are taken
here, a few in an encounter; every step is taken in compiled code.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcdem.hydrodynamics import stokesian
from mcdem.stepping import frames as recording
from mcdem.stepping.approach import approach
from mcdem.stepping.bodies import centre_and_reach, label_bodies
from mcdem.stepping.frames import Frames
from mcdem.stepping.implicit import ImplicitOptions, find_gaps, scratch
from mcdem.stepping.march import march, new_watch
from mcdem.stepping.paper_euler import PaperOptions
from mcdem.stepping.rigid import RIGID, RigidBody, analyse, tumble, worst_load
from mcdem.stepping.rigid_moments import analyse_with_moments
from mcdem.stepping.state import DONE, PARTED, PAUSED, SETTLED, Flow, Log, Motion, Physics, new_history

RIGID_STEP = 0.1
"""Step of rigid bodies in 1/g; their motion is smooth, and second order in it."""


class Shortcuts(NamedTuple):
    """Which shortcuts are taken; lengths in R_i + R_j, loads in pull-off forces, times in 1/g."""

    far_approach: float  # centre distance up to which rigid aggregates approach as bodies; 0: off
    separation: float  # centre distance beyond which receding parts go on alone; 0: off
    rigid_rotation: bool
    inert: bool
    load_limit: float  # largest load at which an aggregate is taken as rigid
    quiet_time: float  # strain without a change of contacts before an aggregate is taken as rigid


@dataclass(frozen=True)
class Course:
    """All that stays the same while an encounter is followed, and its log.

    implicit, paper : options of the stepping scheme; exactly one is given
    end, most_steps : time [1/g] and number of steps at which it ends;  frames : None unless it is recorded
    """

    flow: Flow
    physics: Physics
    implicit: ImplicitOptions | None
    paper: PaperOptions | None
    shortcuts: Shortcuts
    log: Log
    end: float
    most_steps: int
    frames: Frames | None = None

    @property
    def now(self) -> float:
        return float(self.log.time[0])

    @property
    def next_frame(self) -> float:
        """Time [1/g] of the next frame, inf if nothing is recorded."""
        if self.frames is None:
            return math.inf
        return self.frames.interval * (math.floor(self.now / self.frames.interval + 1e-9) + 1)

    def skip(self, elapsed: float) -> None:
        """Time goes on without steps."""
        self.log.time[0] += elapsed
        self.log.skipped[0] += elapsed


def integrate(motion: Motion, course: Course) -> int:
    """Advance `motion` to the end of the course.  Returns a code of `state`.

    Parts that went on alone end at the same time, but the distances between them mean nothing any more.
    """
    n = len(motion.radii)
    if course.shortcuts.far_approach > 0.0:
        come_near(motion, course)
    waiting = [(np.arange(n), course.now)]
    while waiting:
        members, clock = waiting.pop()
        course.log.time[0] = clock
        part = take(motion, members)
        code = follow(part, members, course)
        put_back(part, members, motion)
        if code == PARTED:
            labels = np.empty(len(members), np.int64)
            for body in range(label_bodies(part.bonded, labels)):
                alone = members[labels == body]
                if len(alone) > 1 or course.frames is not None:
                    waiting.append((alone, course.now))
        elif code != DONE:
            return code
    course.log.time[0] = course.end
    return DONE


def take(motion: Motion, members: NDArray[np.intp]) -> Motion:
    """A copy of some primaries (m,) as a motion of their own."""
    within = np.ix_(members, members)
    return Motion(
        motion.positions[members],
        motion.velocities[members],
        motion.bonded[within],
        motion.born[within],
        motion.radii[members],
        motion.parent[members],
        None if motion.springs is None else motion.springs[within],
    )


def put_back(part: Motion, members: NDArray[np.intp], motion: Motion) -> None:
    """Write a part back; contacts across its border are gone already."""
    within = np.ix_(members, members)
    motion.positions[members], motion.velocities[members] = part.positions, part.velocities
    motion.bonded[within], motion.born[within] = part.bonded, part.born
    if motion.springs is not None:
        motion.springs[within] = part.springs


def follow(part: Motion, members: NDArray[np.intp], course: Course) -> int:
    """Follow some primaries to the end of the course; DONE, PARTED, or an error code."""
    log, shortcuts = course.log, course.shortcuts
    n = len(part.radii)
    work, history, gaps = scratch(n, part.springs is not None), new_history(part), np.empty((n, n))
    find_gaps(part.positions, part.radii, gaps)
    # An aggregate as it was found has had all the time to settle.
    rested = n > 1 and log.steps[0] == 0
    watch = new_watch(log, course.now - shortcuts.quiet_time if rested else course.now)
    quiet_time = shortcuts.quiet_time if shortcuts.rigid_rotation or shortcuts.inert else math.inf
    while True:
        recording.keep(course.frames, part, members, course.physics, course.now)
        code = march(
            part,
            history,
            gaps,
            work,
            course.flow,
            course.physics,
            course.implicit,
            course.paper,
            log,
            watch,
            shortcuts.separation,
            quiet_time,
            course.next_frame,
            course.end,
            course.most_steps,
        )
        if code == PAUSED:
            continue
        if code != SETTLED:
            recording.keep(course.frames, part, members, course.physics, course.now)
            return int(code)
        body, centre = analysed(part, course.physics)
        if body is None:
            watch.look[0] = course.now + 2.0 * shortcuts.quiet_time
            continue
        if shortcuts.inert and worst_load(body, course.flow.strain_five) < shortcuts.load_limit:
            if course.frames is not None:
                roll_on(part, members, body, centre, course, math.inf)
            course.skip(course.end - course.now)
            return DONE
        if shortcuts.rigid_rotation:
            if roll_on(part, members, body, centre, course, shortcuts.load_limit):
                return DONE
            find_gaps(part.positions, part.radii, gaps)
            history = new_history(part)
            watch.look[0] = course.now + shortcuts.quiet_time


def analysed(part: Motion, physics: Physics) -> tuple[RigidBody | None, NDArray[np.float64]]:
    """The rigid body (None if it is not one) of a part that is connected, and its centre (3,)."""
    centre = part.positions.mean(axis=0)
    if part.springs is not None:
        code, body = analyse_with_moments(
            stokesian.workspace(len(part.radii)),
            part.positions - centre,
            part.bonded,
            part.springs,
            part.radii,
            physics,
            physics.coupled,
            physics.stresslets,
            physics.table,
        )
        return (body if code == RIGID else None), centre
    if len(part.radii) > 1 and np.count_nonzero(part.bonded) // 2 < max(3 * len(part.radii) - 6, 1):
        return None, centre
    code, body = analyse(
        stokesian.workspace(len(part.radii)),
        part.positions - centre,
        part.bonded,
        part.radii,
        physics.cutoff,
        physics.shifted,
        physics.coupled,
        physics.stresslets,
        physics.table,
        physics.van_der_waals,
        physics.double_layer,
        physics.short_range,
        physics.jkr,
        physics.dmt,
    )
    return (body if code == RIGID else None), centre


def place(part: Motion, body: RigidBody, turn, centre, gradient, springs) -> None:
    """Put the primaries of a rigid body where it is, and its `springs`, as analysed, with them.

    Velocities are those of the flow, for a start.
    """
    if springs is not None:
        assert part.springs is not None
        part.springs[..., :3], part.springs[..., 3:6] = springs[..., :3] @ turn.T, springs[..., 3:6] @ turn.T
    about = body.positions @ turn.T
    part.positions[:] = centre + about
    spin = 0.5 * np.array(
        [gradient[2, 1] - gradient[1, 2], gradient[0, 2] - gradient[2, 0], gradient[1, 0] - gradient[0, 1]]
    )
    part.velocities[:] = np.cross(spin, about) + gradient @ centre


def roll_on(part: Motion, members, body: RigidBody, centre, course: Course, limit: float) -> bool:
    """Turn a rigid part until the end or until its load exceeds `limit`; whether it reached the end."""
    flow, turn = course.flow, np.eye(3)
    springs = None if part.springs is None else part.springs.copy()
    stopped, home = False, centre.copy()
    while not stopped and course.now < course.end - 1e-12:
        duration = min(course.end, course.next_frame) - course.now
        elapsed, load, stopped = tumble(
            body, turn, centre, flow.gradient, flow.strain, duration, RIGID_STEP, limit
        )
        if flow.centred is not None:
            centre[:] = home
        course.skip(elapsed)
        note_load(course.log, body, load)
        place(part, body, turn, centre, flow.gradient, springs)
        recording.keep(course.frames, part, members, course.physics, course.now, body, turn, flow.strain)
    return not stopped


def note_load(log: Log, body: RigidBody, load: float) -> None:
    """Log the largest tension of a body whose largest ratio of tension to pull-off force was `load`."""
    if body.contacts:
        strongest = body.strength[: body.contacts].max()
        log.largest_tension[0] = max(log.largest_tension[0], load * strongest)


def come_near(motion: Motion, course: Course) -> None:
    """Let two rigid aggregates approach as bodies."""
    sides = [np.nonzero(motion.parent == which)[0] for which in (0, 1)]
    parts = [take(motion, members) for members in sides]
    bodies, centres, reach = [], np.empty((2, 3)), 0.0
    for which, part in enumerate(parts):
        body, centres[which] = analysed(part, course.physics)
        if body is None:
            return
        bodies.append(body)
        reach += centre_and_reach(
            part.positions, part.radii, np.zeros(len(part.radii), np.int64), 0, np.empty(3)
        )
    springs = [None if part.springs is None else part.springs.copy() for part in parts]
    turns = np.stack([np.eye(3), np.eye(3)])
    flow, shortcuts = course.flow, course.shortcuts
    going = True
    while going:
        for part, members, body, turn in zip(parts, sides, bodies, turns, strict=True):
            recording.keep(course.frames, part, members, course.physics, course.now, body, turn, flow.strain)
        duration = min(course.end, course.next_frame) - course.now
        elapsed, load = approach(
            bodies[0],
            bodies[1],
            turns,
            centres,
            flow.gradient,
            flow.strain,
            shortcuts.far_approach * reach,
            duration,
            RIGID_STEP,
            shortcuts.load_limit,
        )
        course.skip(elapsed)
        going = course.frames is not None and elapsed >= duration - 1e-9 and course.now < course.end - 1e-9
        for part, body, turn, centre, kept in zip(parts, bodies, turns, centres, springs, strict=True):
            note_load(course.log, body, load)
            place(part, body, turn, centre, flow.gradient, kept)
    for part, members in zip(parts, sides, strict=True):
        put_back(part, members, motion)
