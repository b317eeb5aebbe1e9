"""From the start of an encounter to its end.

Without shortcuts this is one loop over the steps of the chosen scheme, all primaries together (`time_loop`).  The
shortcuts (`Shortcuts`, each with an off) skip what cannot change the outcome:

  far approach     two rigid aggregates far apart approach as bodies with a stresslet (`passage`)
  sure miss        and pass each other as such, if no two of their primaries come close; nearer, with the far field of all their
                   primaries (`reflections`), as long as no two of these are close
  separate bodies  parts that surely do not come back to each other go on as smaller problems (`parting`)
  rigid rotation   an aggregate without floppy modes turns as a rigid body until its load nears its strength (`statics`)
  stable           a rigid aggregate that is mechanically stable in every orientation is done: nothing can happen to it alone

What is floppy, near something else, or near its strength is followed primary by primary.  The decisions are taken
here, a few in an encounter; every step is taken in compiled code.
"""

from __future__ import annotations

import math
import time as clock
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcdem.aggregates.aggregate import centre_of_mass
from mcdem.effects.sums import non_contact_force
from mcdem.encounter import frames as recording
from mcdem.encounter.frames import Frames
from mcdem.hydrodynamics.resistance import workspace
from mcdem.hydrodynamics.undisturbed_flow import UndisturbedFlow
from mcdem.integrators.bodies import centre_and_reach, label_bodies
from mcdem.integrators.pairs import find_gaps
from mcdem.integrators.parting import label_groups
from mcdem.integrators.scheme import scheme_of
from mcdem.integrators.state import (
    DONE,
    LOOSE,
    PARTED,
    PAUSED,
    SETTLED,
    TOO_MANY_STEPS,
    Group,
    Log,
    Motion,
    Physics,
    new_history,
)
from mcdem.integrators.time_loop import Bounds, follow_steps, new_watch
from mcdem.rigid_aggregates.passage import Limits, Pair, Passing, approach, pass_by
from mcdem.rigid_aggregates.reflections import (
    APART,
    LONGEST_STEP,
    OVER,
    NearPair,
    near_pair,
    pass_near,
    side,
)
from mcdem.rigid_aggregates.responses import ANSWERED, respond
from mcdem.rigid_aggregates.statics import (
    RIGID,
    RigidBody,
    analyse,
    rigid_modes,
    turn_rigidly,
    worst_load,
)
from mcdem.rigid_aggregates.statics_with_torques import analyse_with_torques, modes_with_turns

RIGID_STEP = 0.1
"""Step of rigid bodies in 1/g; their motion is smooth, and second order in it: critical offsets of two primaries at 1000 Pa are
within 6e-5 a of those at a quarter of it."""
LONGEST_PIECE = 0.5
"""About how long compiled code goes on by itself [s]."""
LOOSE_MARGINS = 2.0
"""Gap, over that below which primaries have to be followed, beyond which bodies pass as such again."""
STILL_FLOPPY = 2.0
"""What was not rigid is looked at again after this many quiet times."""
PIECE = 200_000
"""Steps of compiled code between two looks for signals, times the square of the number of primaries."""
WEAK = 0.01
"""Direct force [6 pi mu a^2 g] between two primaries that hardly moves them: by a hundredth of a radius in a strain of one."""


class Shortcuts(NamedTuple):
    """Which shortcuts are taken; lengths in R_i + R_j, loads in pull-off forces, times in 1/g."""

    far_approach: float  # centre distance up to which rigid aggregates approach as bodies; 0: off
    sure_miss: float  # gap in a between primaries beyond which rigid aggregates pass as bodies; 0: off
    separation: float  # centre distance beyond which parts that never turn back go on alone; 0: off
    rigid_rotation: bool
    end_stable: bool
    load_limit: float  # largest load at which an aggregate is taken as rigid
    quiet_time: float  # strain without a change of contacts before an aggregate is taken as rigid


class Posture(NamedTuple):
    """A rigid body where it is."""

    body: RigidBody
    turn: NDArray[np.float64]  # (3, 3) since it was analysed
    centre: NDArray[np.float64]  # (3,)


class Waiting(NamedTuple):
    """Primaries (m,) that are still to be followed, from a time on, and the body that they are if that is known.

    quiet_since : time since which their contacts have not changed
    """

    members: NDArray[np.intp]
    clock: float
    quiet_since: float
    posture: Posture | None = None


class Ended(NamedTuple):
    """How primaries that were followed together ended.

    code : DONE, PARTED, or an error code
    alone : what of them is to be followed after they parted, where that is known
    """

    code: int
    quiet_since: float = -math.inf
    alone: list[Waiting] | None = None


@dataclass(frozen=True)
class Course:
    """All that stays the same while an encounter is followed, and its log.

    options : of the scheme (`integrators`)
    end, most_steps : time [1/g] and number of steps at which it ends;  frames : None unless it is recorded
    """

    flow: UndisturbedFlow
    physics: Physics
    options: NamedTuple
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
    """Integrate `motion` to the end of the encounter.  Returns a code of `state`.

    Parts that went on alone end at the same time, but the distances between them mean nothing any more.
    """
    whole = np.arange(len(motion.radii))
    parted = far_approach(motion, course) if course.shortcuts.far_approach > 0.0 else None
    waiting = [Waiting(whole, course.now, -math.inf)] if parted is None else parted
    while waiting:
        next_one = waiting.pop()
        course.log.time[0] = next_one.clock
        part = take(motion, next_one.members)
        ended = follow(part, next_one, course)
        put_back(part, next_one.members, motion)
        if ended.alone is not None:
            waiting.extend(ended.alone)
        elif ended.code == PARTED:
            waiting.extend(groups_apart(part, next_one.members, course, ended.quiet_since))
        elif ended.code != DONE:
            return ended.code
    course.log.time[0] = course.end
    return DONE


def groups_apart(
    part: Motion, members: NDArray[np.intp], course: Course, quiet_since: float
) -> list[Waiting]:
    """The groups of bodies that go on alone; a single primary is left out, unless it is to be watched."""
    labels, groups = np.empty((2, len(members)), np.int64)
    bodies, separation = label_bodies(part.bonded, labels), course.shortcuts.separation
    count = label_groups(part, labels, bodies, course.flow.gradient, separation, groups)
    alone = [members[groups == group] for group in range(count)]
    return [Waiting(m, course.now, quiet_since) for m in alone if len(m) > 1 or course.frames is not None]


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


def follow(part: Motion, waiting: Waiting, course: Course) -> Ended:
    """Follow some primaries, a rigid body if a posture is given, to the end of the course or until they part."""
    log, shortcuts, members = course.log, course.shortcuts, waiting.members
    n = len(part.radii)
    if waiting.posture is not None and end_as_body(part, members, waiting.posture, course):
        return Ended(DONE)
    work = scheme_of(course.options).workspace(n, part.springs is not None)
    history, gaps = new_history(part), np.empty((n, n))
    find_gaps(part.positions, part.radii, gaps)
    # One that could not turn as a body to the end was just found to bear too much.
    found = n > 1 and waiting.posture is None
    watch = new_watch(log, waiting.quiet_since if found else course.now)
    piece = max(PIECE // n**2, 1)
    quiet_time = shortcuts.quiet_time if shortcuts.rigid_rotation or shortcuts.end_stable else math.inf
    while True:
        recording.keep(course.frames, part, members, course.physics, course.now)
        group = Group(part, history, gaps, work)
        while True:
            # In pieces, as compiled code hears no signal; where it is cut touches no bit.
            began = clock.monotonic()
            most = min(course.most_steps, int(log.steps[0]) + piece)
            bounds = Bounds(
                shortcuts.separation, quiet_time, course.next_frame, course.end, most, loose_gap(course)
            )
            code = follow_steps(group, course.flow, course.physics, course.options, log, watch, bounds)
            if code != TOO_MANY_STEPS or log.steps[0] >= course.most_steps:
                break
            piece = 2 * piece if clock.monotonic() - began < LONGEST_PIECE / 4 else max(piece // 2, 1)
        if code == PAUSED:
            continue
        if code not in (SETTLED, LOOSE):
            recording.keep(course.frames, part, members, course.physics, course.now)
            return Ended(int(code), float(watch.quiet_since[0]))
        started = course.now
        if code == LOOSE:
            rigid, ended = go_on_as_pair(part, members, course, work.labels)
        else:
            rigid, ended = go_on_as_body(part, members, course)
        if ended is not None:
            return ended
        if course.now > started:
            find_gaps(part.positions, part.radii, gaps)
            history = new_history(part)
        watch.look[0] = course.now + (1.0 if rigid else STILL_FLOPPY) * shortcuts.quiet_time


def go_on_as_body(part: Motion, members: NDArray[np.intp], course: Course) -> tuple[bool, Ended | None]:
    """Go on with one body; (whether it is rigid, None where it is to be followed by primaries, as its load became too large)."""
    body, centre = analysed(part, course.physics)
    if body is None:
        return False, None
    done = end_as_body(part, members, Posture(body, np.eye(3), centre), course)
    return True, Ended(DONE) if done else None


def go_on_as_pair(
    part: Motion, members: NDArray[np.intp], course: Course, labels: NDArray[np.int64]
) -> tuple[bool, Ended | None]:
    """Go on with two bodies, of which each primary has a label; as `go_on_as_body`."""
    pair = rigid_pair(part, members, labels, course.physics)
    if pair is None:
        return False, None
    ended = pass_near_each_other(pair, course)
    pair.put_back(part)
    return True, ended


def end_as_body(part: Motion, members: NDArray[np.intp], posture: Posture, course: Course) -> bool:
    """Whether a rigid part gets to the end of the course as a body; else it is where its load became too large."""
    shortcuts = course.shortcuts
    if shortcuts.end_stable and worst_load(posture.body, course.flow.strain_five) < shortcuts.load_limit:
        if course.frames is not None:
            turn_as_body(part, members, posture, course, math.inf)
        course.skip(course.end - course.now)
        return True
    return shortcuts.rigid_rotation and turn_as_body(part, members, posture, course, shortcuts.load_limit)


def analysed(part: Motion, physics: Physics) -> tuple[RigidBody | None, NDArray[np.float64]]:
    """The rigid body (None if it is not one) of a part that is connected, and its centre (3,)."""
    centre = centre_of_mass(part.positions, part.radii)
    n, about = len(part.radii), part.positions - centre
    if part.springs is not None:
        code, body = analyse_with_torques(workspace(n), about, part.bonded, part.springs, part.radii, physics)
        return (body if code == RIGID else None), centre
    if n > 1 and np.count_nonzero(part.bonded) // 2 < max(3 * n - 6, 1):
        return None, centre
    code, body = analyse(workspace(n), about, part.bonded, part.radii, physics)
    return (body if code == RIGID else None), centre


def place(
    part: Motion,
    body: RigidBody,
    turn: NDArray[np.float64],
    centre: NDArray[np.float64],
    gradient: NDArray[np.float64],
    springs: NDArray[np.float64] | None,
    rates: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> None:
    """Put the primaries of a rigid body where it is, and its `springs`, as analysed, with them.

    rates : its velocity and angular velocity (3,); those of the flow, for a start, if None
    """
    if springs is not None:
        assert part.springs is not None
        part.springs[..., :3], part.springs[..., 3:6] = springs[..., :3] @ turn.T, springs[..., 3:6] @ turn.T
    about = body.positions @ turn.T
    part.positions[:] = centre + about
    if rates is None:
        spin = np.array([0.5 * (gradient[k - 1, k - 2] - gradient[k - 2, k - 1]) for k in range(3)])
        rates = gradient @ centre, spin
    velocity, (a, b, c) = rates
    # omega x r, written out: np.cross takes ten times as long for few primaries.
    x, y, z = about.T
    part.velocities[:] = np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1) + velocity


def turn_as_body(
    part: Motion, members: NDArray[np.intp], posture: Posture, course: Course, limit: float
) -> bool:
    """Turn a rigid part until the end or until its load exceeds `limit`; whether it reached the end."""
    flow, (body, turn, centre) = course.flow, posture
    springs = None if part.springs is None else part.springs.copy()
    stopped, home = False, centre.copy()
    while not stopped and course.now < course.end - 1e-12:
        duration = min(course.end, course.next_frame) - course.now
        elapsed, load, stopped = turn_rigidly(body, turn, centre, flow, duration, RIGID_STEP, limit)
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


@dataclass(frozen=True)
class RigidPair:
    """Two rigid aggregates on their way, and what they turn about.

    within : where their primaries are in the motion that they are parts of;  members : among all primaries
    turns (2, 3, 3) and centres (2, 3) are where they are now; reaches (2,) : R_i and R_j
    """

    parts: list[Motion]
    within: list[NDArray[np.intp]]
    members: list[NDArray[np.intp]]
    bodies: list[RigidBody]
    turns: NDArray[np.float64]
    centres: NDArray[np.float64]
    springs: list[NDArray[np.float64] | None]
    reaches: NDArray[np.float64]

    @property
    def on_their_way(self) -> Pair:
        """What compiled code carries along."""
        return Pair(self.bodies[0], self.bodies[1], self.turns, self.centres)

    def passing(self, shortcuts: Shortcuts) -> Passing:
        """When they surely miss each other."""
        radii = [part.radii for part in self.parts]
        return Passing(radii[0], radii[1], self.reaches, shortcuts.sure_miss, shortcuts.separation)

    def near(self, physics: Physics) -> NearPair | None:
        """The same near each other, None if they cannot be treated so."""
        sides = []
        for part, body in zip(self.parts, self.bodies, strict=True):
            modes = rigid_modes(body.positions) if part.springs is None else modes_with_turns(body.positions)
            work = workspace(len(part.radii))
            code, response = respond(work, body.positions, modes, part.radii, physics.level)
            if code != ANSWERED:
                return None
            sides.append(side(body, response, part.radii))
        return near_pair(sides[0], sides[1], self.turns, self.centres)

    def note(self, log: Log, load: float) -> None:
        """Log the largest ratio of tension to pull-off force of both."""
        for body in self.bodies:
            note_load(log, body, load)

    def show(self, course: Course) -> None:
        """Write the frames that are due."""
        for part, members, body, turn in zip(self.parts, self.members, self.bodies, self.turns, strict=True):
            recording.keep(
                course.frames, part, members, course.physics, course.now, body, turn, course.flow.strain
            )

    def place(self, course: Course, rates: NearPair | None = None) -> None:
        """Put the primaries where their bodies are; rates : what knows how these move, the flow if None."""
        for which, part in enumerate(self.parts):
            known = None if rates is None else (rates.velocities[which], rates.spins[which])
            turn, centre, springs = self.turns[which], self.centres[which], self.springs[which]
            place(part, self.bodies[which], turn, centre, course.flow.gradient, springs, known)

    def put_back(self, motion: Motion) -> None:
        """Write both back into the motion that they are parts of."""
        for part, within in zip(self.parts, self.within, strict=True):
            put_back(part, within, motion)

    def alone(self, course: Course) -> list[Waiting]:
        """What is to be followed after they parted; a single primary is left out, unless it is to be watched."""
        return [
            Waiting(members, course.now, course.now, Posture(body, turn, centre))
            for members, body, turn, centre in zip(
                self.members, self.bodies, self.turns, self.centres, strict=True
            )
            if len(members) > 1 or course.frames is not None
        ]


def rigid_pair(
    motion: Motion, members: NDArray[np.intp], labels: NDArray[np.int64], physics: Physics
) -> RigidPair | None:
    """The two bodies of a motion, labelled 0 and 1, as rigid ones; None if one of them is not."""
    within = [np.nonzero(labels == which)[0] for which in (0, 1)]
    parts = [take(motion, m) for m in within]
    bodies, centres, reaches = [], np.empty((2, 3)), np.empty(2)
    for which, part in enumerate(parts):
        body, centres[which] = analysed(part, physics)
        if body is None:
            return None
        bodies.append(body)
        reaches[which] = centre_and_reach(
            part.positions, part.radii, np.zeros(len(part.radii), np.int64), 0, np.empty(3)
        )
    springs = [None if part.springs is None else part.springs.copy() for part in parts]
    return RigidPair(
        parts,
        within,
        [members[m] for m in within],
        bodies,
        np.stack([np.eye(3)] * 2),
        centres,
        springs,
        reaches,
    )


def far_approach(motion: Motion, course: Course) -> list[Waiting] | None:
    """Let two rigid aggregates approach as bodies; what is still to be followed if they miss each other as such, else None."""
    pair = rigid_pair(motion, np.arange(len(motion.radii)), motion.parent, course.physics)
    if pair is None:
        return None
    flow, shortcuts = course.flow, course.shortcuts
    going = True
    while going:
        pair.show(course)
        duration = min(course.end, course.next_frame) - course.now
        limits = Limits(duration, RIGID_STEP, shortcuts.load_limit)
        elapsed, load = approach(pair.on_their_way, flow, shortcuts.far_approach * pair.reaches.sum(), limits)
        course.skip(elapsed)
        going = course.frames is not None and elapsed >= duration - 1e-9 and course.now < course.end - 1e-9
        pair.note(course.log, load)
        pair.place(course)
    parted: list[Waiting] | None = None
    if passes_as_bodies(course):
        parted = miss(pair, course)
        if parted is None:
            ended = pass_near_each_other(pair, course)
            parted = None if ended is None else ended.alone or []
    pair.put_back(motion)
    return parted


def passes_as_bodies(course: Course) -> bool:
    """Whether two rigid aggregates pass each other as bodies.

    What happens to an aggregate after that is its own affair, so this needs that parts are let go on alone; and what acts
    between primaries that are not in contact must have faded at the margin.
    """
    shortcuts = course.shortcuts
    if min(shortcuts.far_approach, shortcuts.sure_miss, shortcuts.separation) <= 0.0:
        return False
    force, _ = non_contact_force(shortcuts.sure_miss, 1.0, course.physics.pair_forces)
    return bool(abs(force) <= WEAK)


def loose_gap(course: Course) -> float:
    """Gap beyond which two bodies that were followed primary by primary pass as such again."""
    return LOOSE_MARGINS * course.shortcuts.sure_miss if passes_as_bodies(course) else math.inf


def pass_near_each_other(pair: RigidPair, course: Course) -> Ended | None:
    """Let two rigid aggregates pass each other as bodies near each other; None, where they have to be followed by primaries."""
    near = pair.near(course.physics)
    if near is None:
        return None
    passing, code, began = pair.passing(course.shortcuts), OVER, course.now
    # In pieces, as in `follow`.
    piece = max(PIECE // sum(len(part.radii) for part in pair.parts) ** 2, 1)
    while code == OVER and course.now < course.end - 1e-9:
        duration = min(course.end, course.next_frame) - course.now
        limits = Limits(duration, LONGEST_STEP, course.shortcuts.load_limit)
        code, elapsed, load, gap = pass_near(near, course.physics.level, course.flow, passing, limits, piece)
        course.skip(elapsed)
        course.log.smallest_gap[0] = min(course.log.smallest_gap[0], gap)
        pair.note(course.log, load)
        pair.place(course, near)
        pair.show(course)
    if code == APART or code == OVER:
        return Ended(PARTED, began, pair.alone(course) if code == APART else [])
    return None


def miss(pair: RigidPair, course: Course) -> list[Waiting] | None:
    """What is to be followed after two rigid aggregates surely missed each other; None, and they stay, if they may not."""
    before = pair.turns.copy(), pair.centres.copy()
    surely, elapsed, load, gap = passage(pair, course, course.end - course.now)
    if not surely:
        pair.turns[:], pair.centres[:] = before
        return None
    if course.frames is None:
        course.skip(elapsed)
    else:
        pair.turns[:], pair.centres[:] = before
        show_passage(pair, course, course.now + elapsed)
    course.log.smallest_gap[0] = min(course.log.smallest_gap[0], gap)
    pair.note(course.log, load)
    pair.place(course)
    return pair.alone(course)


def passage(pair: RigidPair, course: Course, duration: float) -> tuple[bool, float, float, float]:
    """`passage.pass_by` by the shortcuts taken."""
    limits = Limits(duration, RIGID_STEP, course.shortcuts.load_limit)
    found: tuple[bool, float, float, float] = pass_by(
        pair.on_their_way, course.flow, pair.passing(course.shortcuts), limits
    )
    return found


def show_passage(pair: RigidPair, course: Course, end: float) -> None:
    """Pass once more, to `end`, and write the frames on the way."""
    while course.now < end - 1e-9:
        _, elapsed, _, _ = passage(pair, course, min(end, course.next_frame) - course.now)
        if elapsed == 0.0:
            course.skip(end - course.now)
        course.skip(elapsed)
        pair.place(course)
        pair.show(course)
