"""The laws, one function each: (margin, words).

A margin says what is left of an allowance: 1 untouched, 0 used up, negative where the law is broken.  What is
allowed is derived here, never fitted to what was found.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
import xarray as xr
from scipy import stats

from mcdem.effects.sums import contact_force, contact_pull_off_gap, non_contact_force
from mcdem.encounter.simulate import OUTCOMES, classify, physics_of
from mcdem.hydrodynamics import level as levels
from mcdem.hydrodynamics.resistance import measure, workspace
from mcdem.hydrodynamics.velocities import solve_velocities
from mcdem.integrators import state

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.encounter.simulate import EncounterResult
    from mcdem.monte_carlo.run_control import RunSummary
    from mcdem.scene import Scene
    from validation.hard_cases.case import Course, Suspension

Margin = tuple[float, str]

SECONDS = 60.0
"""Longest time of a case [s]."""
AGREEMENT = 1e-6
"""Distance [a] up to which images of a motion agree: rounding, grown by the motion, but far below any gap that decides."""


def below(value: float, allowed: float, words: str) -> Margin:
    """`value` must not exceed `allowed`."""
    return 1.0 - value / allowed, words


def yes(condition: bool, words: str) -> Margin:
    """A law without degrees."""
    return (1.0 if condition else -1.0), words


# Of the result of an encounter


class Followed(Protocol):
    """An encounter that has come to its end; `outcomes` are those that it may have, any if there are none."""

    scene: Scene
    first: Aggregate
    second: Aggregate
    outcomes: tuple[str, ...]

    @property
    def result(self) -> EncounterResult: ...


def ends(whole: Followed) -> Margin:
    """It ends with an outcome; one that is unresolved says why, and keeps where it stopped."""
    r = whole.result
    named = r.outcome in (whole.outcomes or OUTCOMES)
    if r.outcome == "unresolved":
        named &= bool(r.reason) and r.state is not None and bool(np.isfinite(r.state).all())
    return yes(named, r.outcome + (f": {r.reason}" if r.reason else ""))


def ends_in_time(whole: Followed) -> Margin:
    """It takes no longer than a minute."""
    return in_time(whole.result.cpu_time)


def in_time(seconds: float) -> Margin:
    """No case takes longer than a minute."""
    return below(seconds, SECONDS, f"{seconds:.2g} s")


def conserves(whole: Followed) -> Margin:
    """Every primary leaves in exactly one product, and the outcome is what their sets say."""
    r, first, second = whole.result, whole.first, whole.second
    total = first.size + second.size
    every = np.array_equal(np.sort(np.concatenate(r.members)), np.arange(total))
    sizes = [p.size for p in r.products] == [len(m) for m in r.members]
    named = r.outcome == "unresolved" or r.outcome == classify(r.members, first.size, r.contact)
    return yes(every and sizes and named, f"{total} primaries in {len(r.products)} products")


def is_finite(whole: Followed) -> Margin:
    """No product holds anything but numbers."""
    r = whole.result
    numbers = all(np.isfinite(p.positions).all() for p in r.products) and np.isfinite(r.centres).all()
    scalars = np.isfinite([r.simulated_time, r.largest_tension, r.cpu_time, *r.offset]).all()
    return yes(bool(numbers and scalars), "products, centres, times, tension")


def products_hold_together(whole: Followed) -> Margin:
    """Contacts of the products are no longer than the pull-off gap; centred, connected."""
    r, scene = whole.result, whole.scene
    reach = pull_off_gap(scene)
    longest = -math.inf
    for product in r.products if r.outcome != "unresolved" else ():
        if len(product.bonds):
            i, j = product.bonds.T
            centres = product.positions / scene.suspension.radius
            longest = max(longest, float((np.linalg.norm(centres[i] - centres[j], axis=1) - 2.0).max()))
    return below(longest, reach * (1.0 + 1e-9) + 1e-14, f"longest contact {longest:.3g} a of {reach:.3g} a")


# Of a course, step by step


def stays_finite(course: Course) -> Margin:
    """No position is ever anything but a number, and no step fails."""
    seen = course.seen
    return yes(seen.finite and seen.code == state.DONE, f"to strain {seen.strain:.3g}, code {seen.code}")


def factorises(course: Course) -> Margin:
    """The resistance matrix is positive definite by far more than rounding."""
    worst = math.inf
    for positions, _ in course.seen.states:
        values = np.linalg.eigvalsh(resistance(course.scene, positions))
        worst = min(worst, values[0] / values[-1])
    rounding = len(course.start.positions) * 6 * np.finfo(float).eps
    return 1.0 - rounding / worst if worst > 0.0 else -1.0, f"smallest over largest eigenvalue {worst:.2g}"


def dissipates(course: Course) -> Margin:
    """The particles take energy from the flow, never give it: F.(u - u_inf) + S:E >= 0.

    In units of what as many free spheres far apart dissipate, (20/3) pi mu a^3 E:E each.
    """
    flow, physics = physics_of(course.scene)
    n = len(course.start.positions)
    free = 10.0 / 9.0 * (flow.strain_five**2).sum() * n  # the same in the units of the engine
    worst = math.inf
    for positions, bonded in course.seen.states:
        forces, stresslet = direct_forces(course.scene, positions, bonded), np.empty((n, 5))
        code, linear, _ = solve_velocities(
            physics.level, workspace(n), positions, np.ones(n), flow, forces, np.zeros((n, 3)), stresslet
        )
        if code != 0:
            return -1.0, "the resistance matrix could not be factorised"
        power = (forces * (linear - positions @ flow.gradient.T)).sum() + (stresslet @ flow.strain_five).sum()
        worst = min(worst, power / free)
    return worst, f"at least {worst:.3g} of free spheres'"


def contacts_by_their_law(course: Course) -> Margin:
    """A contact is made where the gap has closed, and lost where it exceeds the pull-off gap: none else, none later."""
    seen, limit = course.seen, pull_off_gap(course.scene)
    rounding = 1e-12
    excess = max(
        seen.made_at,  # made at a gap above 0
        seen.kept_to - limit,  # kept beyond pull-off
        limit - seen.lost_at,  # lost before pull-off
        -seen.free_from if course.scene.effects.contact is not None else -math.inf,  # left out though closed
    )
    return yes(excess <= rounding, f"{seen.changes} made or lost")


def overlaps_as_contacts_bear(course: Course) -> Margin:
    """No overlap is deeper than that of a contact under the largest force there is."""
    if course.scene.effects.contact is None:
        return 1.0, "no contacts"
    load = largest_force(course)
    allowed = depth(course.scene, load)
    found = max(-course.seen.deepest, 0.0)
    return below(found, allowed, f"{found:.2g} a of {allowed:.2g} a under {load:.2g} x 6 pi mu a^2 g")


IMAGES = {
    "through the centre": np.diag([-1.0, -1.0, -1.0]),
    "across the shear plane": np.diag([-1.0, 1.0, 1.0]),
    "half a turn about the vorticity": np.diag([1.0, -1.0, -1.0]),
}
"""Isometries that leave the flow (0, 0, g y) as it is."""


def symmetric(course: Course) -> Margin:
    """The images of a start lead to the images of its end."""
    worst, where = 0.0, ""
    for name, image in IMAGES.items():
        other = course.image(replace(course.start, positions=course.start.positions @ image))
        apart = distance(course.compared.positions @ image, other.positions)
        if apart >= worst:
            worst, where = apart, name
    return below(worst, AGREEMENT, f"{worst:.2g} a apart {where}")


def numbering(course: Course) -> Margin:
    """The numbers that primaries bear do not matter."""
    order = np.random.default_rng(1).permutation(len(course.start.positions))
    start = course.start
    other = course.image(
        replace(
            start,
            positions=start.positions[order],
            bonded=start.bonded[np.ix_(order, order)],
            parent=start.parent[order],
        )
    )
    apart = distance(course.compared.positions[order], other.positions)
    return below(apart, AGREEMENT, f"{apart:.2g} a apart")


def translation(course: Course) -> Margin:
    """Neither does the place: elsewhere in the flow all is the same but for the speed of the frame."""
    start = course.start
    other = course.image(
        replace(start, positions=start.positions + np.array([3.0, -7.0, 11.0]) * course.radius)
    )
    apart = distance(*(p - p.mean(axis=0) for p in (course.compared.positions, other.positions)))
    return below(apart, AGREEMENT, f"{apart:.2g} a apart")


def converges(course: Course) -> Margin:
    """Half the step leaves less of the distance to the end state that a quarter of the step reaches."""
    half, quarter = course.refined(0.5), course.refined(0.25)
    coarse, fine = (
        distance(positions, quarter.positions) for positions in (course.seen.positions, half.positions)
    )
    # Where the contacts differ the end states have nothing to say of each other but that they do.
    words = f"{coarse:.2g} a, then {fine:.2g} a from the end at a quarter of the step"
    return below(fine, max(coarse, AGREEMENT), words)


# Of ensembles


def same_outcomes(coarse: Sequence[EncounterResult], fine: Sequence[EncounterResult]) -> Margin:
    """Outcomes are drawn from one law at both steps: chi-squared test on the table of counts, at 1 %."""
    table = np.array([[sum(r.outcome == o for r in rs) for o in OUTCOMES] for rs in (coarse, fine)])
    table = table[:, table.any(axis=0)]
    p = float(stats.chi2_contingency(table).pvalue) if table.shape[1] > 1 else 1.0
    agreeing = sum(a.outcome == b.outcome for a, b in zip(coarse, fine))
    return below(0.01, p, f"p = {p:.2g}, {agreeing} of {len(coarse)} alike")


def same_contacts(coarse: Sequence[EncounterResult], fine: Sequence[EncounterResult]) -> Margin:
    """So are the contacts of what comes out: paired differences within 3 standard errors of none."""
    counts = np.array([[sum(len(p.bonds) for p in r.products) for r in rs] for rs in (coarse, fine)])
    apart = (counts[0] - counts[1]).astype(float)
    error = max(float(apart.std(ddof=1)) / math.sqrt(len(apart)), 0.5 / len(apart))
    mean = abs(float(apart.mean()))
    return below(mean, 3.0 * error, f"{mean:.2g} contacts apart, standard error {error:.2g}")


def all_conserved(coarse: Sequence[EncounterResult], fine: Sequence[EncounterResult]) -> Margin:
    """Every primary leaves every encounter."""
    kept = all(
        np.array_equal(np.sort(np.concatenate(r.members)), np.arange(sum(p.size for p in r.products)))
        for r in (*coarse, *fine)
    )
    return yes(kept, f"{len(coarse) + len(fine)} encounters")


# Of runs


def of_a_run(path: Path, summary: RunSummary, case: Suspension) -> dict[str, Margin]:
    """What a run's dataset must say, and its steps."""
    with xr.open_datatree(path) as tree:
        series, events = tree.dataset.load(), tree["events"].dataset.load()
    sizes = series["mean_size"].values
    primaries = sizes * series["number_of_aggregates"].values
    doubled = series["volume"].values / float(series["volume"][0])
    numbers = [series[name].values for name in series.data_vars]
    unresolved = summary.outcomes["unresolved"]
    found = {
        "steps": (float(events["steps"].sum()), ""),
        "ends": yes(summary.ended_by in case.ended_by, f"{summary.ended_by} after {summary.events} events"),
        "finite": yes(all(np.isfinite(n).all() for n in numbers), f"{len(numbers)} series"),
        "conserves primaries": yes(
            bool(np.allclose(primaries, primaries[0] * doubled, rtol=1e-12)), f"{primaries[0]:.0f} primaries"
        ),
        "counts what it could not follow": yes(
            unresolved > 0 if case.unresolved else unresolved == 0,
            f"{unresolved} of {summary.events} unresolved",
        ),
    }
    if case.sticks is not None:
        stuck = bool(sizes.max() > 1.0)
        found["sticks" if case.sticks else "does not stick"] = yes(
            stuck == case.sticks, f"<P> up to {sizes.max():.3g}"
        )
    return found


# What they measure


def distance(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Largest distance [a] between the places of a primary in two states (N, 3)."""
    return float(np.linalg.norm(one - other, axis=1).max())


def pull_off_gap(scene: Scene) -> float:
    """Gap [a] beyond which a contact is lost."""
    return float(contact_pull_off_gap(1.0, physics_of(scene)[1].contact))


def resistance(scene: Scene, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Resistance (6N, 6N) of spheres at positions (N, 3) [a], as the engine factorises it; reduced units."""
    flow, physics = physics_of(scene)
    n = len(positions)
    work, radii = workspace(n), np.ones(n)
    measure(positions, work.directions, work.distances)
    if levels.resistance(physics.level, work, radii) != 0:
        return np.diag(np.r_[-1.0, np.ones(6 * n - 1)])  # not positive definite either
    levels.strain_load(physics.level, work, flow.strain_five)
    levels.two_body(physics.level, work, radii, flow.strain)
    lower = np.tril(work.resistance)
    return lower + np.tril(lower, -1).T


def direct_forces(
    scene: Scene, positions: NDArray[np.float64], bonded: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Direct forces (N, 3) on primaries at positions (N, 3) [a], in 6 pi mu a^2 g."""
    _, p = physics_of(scene)
    forces = np.zeros_like(positions)
    for i in range(len(positions)):
        for j in range(i):
            apart = positions[i] - positions[j]
            r = float(np.linalg.norm(apart))
            if bonded[i, j]:
                value, _ = contact_force(r - 2.0, 1.0, p.contact)
            elif r < 3.0:
                value, _ = non_contact_force(r - 2.0, 1.0, p.pair_forces)
            else:
                continue
            forces[i] += value * apart / r
            forces[j] -= value * apart / r
    return forces


def largest_force(course: Course) -> float:
    """Upper estimate of the compression of a contact, in 6 pi mu a^2 g.

    All that the straining flow exerts on the primaries, pressing through one contact: half the distance of each from
    the centre; and the attraction at contact of six neighbours, half of those that a sphere can have.
    """
    positions = course.start.positions / course.radius
    span = 0.0
    for parent in (0, 1):
        own = positions[course.start.parent == parent]
        span = max(span, float(np.linalg.norm(own - own.mean(axis=0), axis=1).max()) + 1.0)
    _, physics = physics_of(course.scene)
    pull, _ = non_contact_force(0.0, 1.0, physics.pair_forces)
    return 0.5 * span * len(positions) + 6.0 * max(-pull, 0.0)


def depth(scene: Scene, load: float) -> float:
    """Overlap [a] of a contact under a compression, by bisection of the law itself."""
    _, physics = physics_of(scene)
    low, high = 0.0, 2.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        force, _ = contact_force(-middle, 1.0, physics.contact)
        low, high = (middle, high) if force < load else (low, middle)
    return high


OF_RESULTS = {
    "ends": ends,
    "ends in time": ends_in_time,
    "conserves primaries": conserves,
    "finite": is_finite,
    "products hold together": products_hold_together,
}
OF_COURSES = {
    "every step finite": stays_finite,
    "positive definite": factorises,
    "dissipates": dissipates,
    "contacts by their law": contacts_by_their_law,
    "overlap bounded": overlaps_as_contacts_bear,
    "symmetric": symmetric,
    "numbering": numbering,
    "translation": translation,
    "converges": converges,
}
OF_REGULAR_MOTION = {"converges"}
"""Laws that say nothing of chaotic trajectories, nor of a scheme whose step is fixed."""
OF_ENSEMBLES = {
    "same outcomes": same_outcomes,
    "same contacts": same_contacts,
    "conserves primaries": all_conserved,
}
