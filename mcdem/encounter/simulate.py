"""One encounter of two aggregates: where it starts, how long it lasts, and what came of it.

Frungieri & Vanni 2021, sections 2.1 and 2.2.3.  Aggregate i rests at the origin; j starts upstream inside the
circle of radius R_i + R_j with the flux of the undisturbed flow, both in random orientations, and all their
primaries are followed for the time of Eq. 21.  Flows other than simple shear: `inflow`.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import threadpoolctl

from mcdem.aggregates.aggregate import Aggregate, centre_of_mass, radii_of, split
from mcdem.arguments import generator_at_door, offset_at_door, real_number, scene_at_door
from mcdem.encounter.frames import Frames, new_frames
from mcdem.encounter.motion import Course, Shortcuts, integrate
from mcdem.errors import UserError
from mcdem.hydrodynamics import LEVELS
from mcdem.hydrodynamics.grand_mobility import tensor_to_five
from mcdem.hydrodynamics.undisturbed_flow import UndisturbedFlow
from mcdem.integrators import SCHEMES, state
from mcdem.integrators.scheme import Scales
from mcdem.quantities import linear_flows
from mcdem.quantities.units import shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mcdem.quantities.reduced_units import ReducedUnits
    from mcdem.scene import Scene

OUTCOMES = ("missed", "aggregation", "parted", "exchange", "fragmentation", "unresolved")
"""missed: no contact, the same two sets of primaries; aggregation: one product; parted: contact, the same two sets;
exchange: two products, other sets; fragmentation: three products or more; unresolved: the motion could not be followed."""

PAPER_BREAKUP = frozenset({"parted", "exchange", "fragmentation"})
"""Breakup as section 2.1 of the paper counts it: two fragments after a collision are one."""
STRICT_BREAKUP = frozenset({"exchange", "fragmentation"})
"""Breakup without pairs that touch and part as they came."""

ARRIVED = 1.0
"""Gap between primaries of both aggregates, over R_i + R_j, below which they have come to each other.  No two whose offset is
within the circle of R_i + R_j pass each other further apart; one starts at several times that."""

_REASONS = {
    state.NOT_POSITIVE_DEFINITE: "the resistance matrix could not be factorised",
    state.NOT_CONVERGED: "the contact forces of a step could not be found",
    state.TOO_MANY_STEPS: "more steps than numerics.most_steps",
    state.NOT_FINITE: "positions are no longer finite",
}


@dataclass
class Recorder:
    """Asks an encounter to keep its course: pass one as `record=`, read its arrays afterwards.

    interval : strain g t between two frames
    time : (F,) [s];  positions : (F, N, 3) [m];  tension : (F, N, N) [N], nan where there is no contact
    parent : (N,) 0 for primaries of i, 1 for those of j
    radii : (N,) [m] of the primaries, None where the suspension has only one

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> primary, course = mcdem.Aggregate.monomer(), mcdem.Recorder(interval=0.5)
    >>> result = mcdem.simulate_encounter(scene, primary, primary, offset=("0.1 um", "0.9 um"), seed=1, record=course)
    >>> course.positions.shape[1:]
    (2, 3)
    """

    interval: float = 0.25
    time: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    positions: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0, 3)))
    tension: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0, 0)))
    parent: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    radii: NDArray[np.float64] | None = None


def record_at_door(record: object) -> None:
    """Refuse what cannot keep the course of an encounter; raises `UserError`."""
    if not isinstance(record, Recorder):
        raise UserError(f"record = {shown(record)}: expected a Recorder, or None")
    real_number("record.interval", record.interval, 1e-6, 1e6)


@dataclass(frozen=True, eq=False)
class EncounterResult:
    """What came of an encounter.

    products : aggregates after it, about their own centres of mass
    members : identities of each product's primaries, numbered 0 .. P_i - 1 in i, then those of j
    centres : (products, 3) [m] centres of mass at the end
    offset : (x0, y0) [m] of j at the start
    contact : whether a primary of i touched one of j
    simulated_time, first_contact_time, last_bond_change_time, first_bond_loss_time : [s], nan if it never happened
    largest_tension : [N] of any contact at any time;  smallest_gap : [m] between primaries of different parents
    steps, solves : accepted steps, and evaluations of the hydrodynamics;  cpu_time : [s]
    reason : why it is unresolved, else empty; the products are then the parents as they were
    state : positions (N, 3) [m] at which an unresolved encounter stopped, else None
    machine : on what kind of machine it was followed (`mcdem.netcdf.origin`), where a run or a table asked for it

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> primary = mcdem.Aggregate.monomer()
    >>> result = mcdem.simulate_encounter(scene, primary, primary, offset=("0.1 um", "0.1 um"), seed=1)
    >>> result.products[0].size, result.contact
    (2, True)
    """

    outcome: str
    products: tuple[Aggregate, ...]
    members: tuple[NDArray[np.intp], ...]
    centres: NDArray[np.float64]
    offset: tuple[float, float]
    contact: bool
    simulated_time: float
    first_contact_time: float
    last_bond_change_time: float
    first_bond_loss_time: float
    largest_tension: float
    smallest_gap: float
    steps: int
    solves: int
    cpu_time: float
    reason: str = ""
    state: NDArray[np.float64] | None = None
    machine: str = ""


@lru_cache(maxsize=32)
def physics_of(scene: Scene) -> tuple[UndisturbedFlow, state.Physics]:
    """The compiled code's view of a scene: its flow, and what acts on the primaries, in reduced units."""
    gradient = linear_flows.gradient(scene.flow)
    strain = 0.5 * (gradient + gradient.T)
    five = np.empty(5)
    tensor_to_five(strain, five)
    hydrodynamics = scene.hydrodynamics
    level = LEVELS[hydrodynamics.level].build(
        hydrodynamics.lubrication_cutoff, hydrodynamics.cutoff_convention == "gap", scene.reduced_radii
    )
    kernels = scene.kernels
    centred: Literal[True] | None = None if scene.flow.kind == "simple_shear" else True
    return (
        UndisturbedFlow(gradient, strain, five, centred),
        state.Physics(level, kernels.pair_forces, kernels.contact, kernels.resistances),
    )


SMOOTH = 3e-4
"""Roughness over a, where no effect of the scene has a length that steps must resolve close to contact: the paper's."""


@lru_cache(maxsize=32)
def options_of(scene: Scene) -> NamedTuple:
    """The options of the scheme that the scene chooses, in reduced units."""
    name, length = scene.numerics.scheme, scene.effects.step_length
    roughness = SMOOTH if length is None else length / scene.suspension.radius
    scales = Scales(roughness, scene.flow.shear_rate)
    options: NamedTuple = SCHEMES[name].build(scene.numerics.own, scales)
    return options


def shortcuts_of(scene: Scene) -> Shortcuts:
    """The shortcuts that the scene takes: a reference scheme none, and no approach by stresslets where there are none."""
    numerics = scene.numerics
    taken = SCHEMES[numerics.scheme].shortcuts
    return Shortcuts(
        far_approach=numerics.far_approach
        if taken and LEVELS[scene.hydrodynamics.level].stresslet_couplings
        else 0.0,
        sure_miss=numerics.sure_miss if taken else 0.0,
        separation=numerics.separation if taken else 0.0,
        rigid_rotation=taken and numerics.rigid_rotation,
        end_stable=taken and numerics.end_stable,
        load_limit=numerics.rigid_load_limit,
        quiet_time=numerics.quiet_time,
    )


@lru_cache(maxsize=1)
def _linear_algebra() -> threadpoolctl.ThreadpoolController:
    """Holds the linear algebra to one thread: many for matrices this small wait for each other, up to a hundredfold."""
    return threadpoolctl.ThreadpoolController()


def start_of(
    scene: Scene, reach: float, offset: tuple[float, float]
) -> tuple[NDArray[np.float64], float, bool]:
    """(centre of j at the start (3,) [m], g t_sim, whether the approach may be cut) for an offset [m].

    g t_sim is the strain of the approach to the nearest point, |z0|/|y0| in simple shear, at most `longest_approach`, and
    4 pi N_rot (Eq. 21).  That is how long the undisturbed flow takes; two bodies draw each other in sooner where y0 is near 0.
    """
    numerics = scene.numerics
    if scene.flow.kind == "simple_shear":
        x0, y0 = offset
        z0 = -math.copysign(numerics.start_distance * reach, y0)
        start = np.array([x0, y0, z0])
        approach = abs(z0) / abs(y0) if y0 != 0.0 else math.inf
    else:
        entry = linear_flows.entry_of(scene.flow, reach, offset)
        start, approach = linear_flows.upstream(
            linear_flows.gradient(scene.flow), entry, numerics.start_distance * reach
        )
    longest = numerics.longest_approach
    return start, min(approach, longest) + 4.0 * math.pi * numerics.rotations, approach > longest


def simulate_encounter(
    scene: Scene,
    aggregate_i: Aggregate | NDArray[np.float64],
    aggregate_j: Aggregate | NDArray[np.float64],
    offset: tuple[float, float] | None = None,
    seed: int | np.random.Generator | None = None,
    record: Recorder | None = None,
    orient: bool = True,
) -> EncounterResult:
    """Follow one encounter to its end.

    Parameters
    ----------
    scene : Scene
        Flow, effects, hydrodynamics and numerics.
    aggregate_i, aggregate_j : Aggregate or array_like, (P, 3) [m]
        What meets; of positions contacts are read off the gaps.
    offset : tuple of two floats or str
        (x0, y0) of j's centre at the start, in other flows than simple shear as `inflow` says; numbers in m, text or quantities
        of pint with a unit; drawn by the flux if None.
    seed : int or numpy.random.Generator
        Of the orientations and the offset.
    record : Recorder
        Keeps the course of the encounter.
    orient : bool
        False leaves the aggregates in the orientations given.

    Returns
    -------
    EncounterResult
        Outcome, products, times and loads.

    Raises
    ------
    UserError
        Of what is no scene, aggregates that overlap grossly or fall apart, an offset outside the start's distance, and a seed or
        a recorder that cannot be.

    References
    ----------
    Frungieri & Vanni (2021), Powder Technol. 388, 357-370, Sec. 2.3.

    Examples
    --------
    Two primaries that nearly collide head-on:

    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> primary = mcdem.Aggregate.monomer()
    >>> mcdem.simulate_encounter(scene, primary, primary, offset=("0.1 um", "0.1 um"), seed=1).outcome
    'aggregation'
    >>> mcdem.simulate_encounter(scene, primary, primary, offset=("0.1 um", "0.9 um"), seed=1).outcome
    'missed'
    """
    scene_at_door(scene)
    rng = generator_at_door(seed)
    if record is not None:
        record_at_door(record)
    pair = [Aggregate.at_door(scene, a, name) for name, a in (("i", aggregate_i), ("j", aggregate_j))]
    if orient:
        pair = [a.turned(rng) for a in pair]
    radii, units = radii_of_pair(scene, pair), scene.reduced
    reach = sum(a.outer_radius(scene.suspension.radius) for a in pair)
    if offset is None:
        x0, y0 = linear_flows.draw_offset(scene.flow, reach, rng)
    else:
        x0, y0 = offset_at_door(scene, offset, reach)
    start, strain, cut = start_of(scene, reach, (x0, y0))
    # In the order of rows whatever the parents' layout: the compiled code exists for one layout only.
    positions = np.ascontiguousarray(np.concatenate([pair[0].positions, pair[1].positions + start]))
    sizes = [a.size for a in pair]
    bonded = np.zeros((sum(sizes), sum(sizes)), bool)
    bonded[: sizes[0], : sizes[0]] = pair[0].contact_network()
    bonded[sizes[0] :, sizes[0] :] = pair[1].contact_network()
    parent = np.repeat([0, 1], sizes)
    flow, physics = physics_of(scene)

    motion = state.Motion(
        positions / units.length,
        (positions / units.length) @ flow.gradient.T,
        bonded.copy(),
        np.full(bonded.shape, -np.inf),
        np.ones(sum(sizes)) if radii is None else radii / units.length,
        parent,
        springs_of(pair) if scene.effects.resisting else None,
    )
    log = state.new_log()
    frames = new_frames(record.interval, strain, sum(sizes)) if record is not None else None
    course = Course(
        flow, physics, options_of(scene), shortcuts_of(scene), log, strain, scene.numerics.most_steps, frames
    )
    started = time.process_time()
    with _linear_algebra().limit(limits=1, user_api="blas"):
        code = integrate(motion, course)
    cpu_time = time.process_time() - started
    if record is not None and frames is not None:
        _keep(record, frames, units, parent)
        record.radii = radii

    def seconds(value: NDArray[np.float64]) -> float:
        return float(value[0]) * units.time

    reason, kept = _REASONS.get(code, ""), None
    members: tuple[NDArray[np.intp], ...]
    contact = not math.isnan(log.first_contact[0])
    arrived = contact or float(log.smallest_gap[0]) * units.length < ARRIVED * reach
    if not reason and cut and not arrived:
        reason = "the approach is longer than numerics.longest_approach"
    if reason:
        outcome, products = "unresolved", tuple(pair)
        members = (np.arange(sizes[0]), np.arange(sizes[0], sum(sizes)))
        centres = np.array([np.zeros(3), start])
        kept = motion.positions * units.length
    else:
        members = tuple(split(motion.bonded))
        final = motion.positions * units.length
        products = tuple(
            Aggregate.from_contacts(
                final[m],
                motion.bonded[np.ix_(m, m)],
                None if motion.springs is None else motion.springs[np.ix_(m, m)],
                None if radii is None else radii[m],
            )
            for m in members
        )
        centres = np.array([centre_of_mass(final[m], motion.radii[m]) for m in members])
        outcome = classify(members, sizes[0], contact)
    return EncounterResult(
        outcome=outcome,
        products=products,
        members=members,
        centres=centres,
        offset=(x0, y0),
        contact=contact,
        simulated_time=seconds(log.time),
        first_contact_time=seconds(log.first_contact),
        last_bond_change_time=seconds(log.last_bond_change),
        first_bond_loss_time=seconds(log.first_bond_loss),
        largest_tension=float(log.largest_tension[0]) * units.force,
        smallest_gap=float(log.smallest_gap[0]) * units.length,
        steps=int(log.steps[0]),
        solves=int(log.solves[0]),
        cpu_time=cpu_time,
        reason=reason,
        state=kept,
    )


def radii_of_pair(scene: Scene, pair: list[Aggregate]) -> NDArray[np.float64] | None:
    """Radii (N,) [m] of the primaries of two aggregates side by side; None where the suspension has only one."""
    first, second = (radii_of(scene, a.radii, a.size) for a in pair)
    return None if first is None or second is None else np.concatenate([first, second])


def springs_of(pair: list[Aggregate]) -> NDArray[np.float64]:
    """Histories (N, N, 7) of the contacts of two aggregates side by side, in the order of `state.Motion`."""
    total = sum(a.size for a in pair)
    springs = np.zeros((total, total, 7))
    first = 0
    for aggregate in pair:
        if aggregate.springs is not None:
            low, high = aggregate.bonds.T
            springs[first + high, first + low] = aggregate.springs
        first += aggregate.size
    return springs


def classify(members: tuple[NDArray[np.intp], ...], size_i: int, contact: bool) -> str:
    """The outcome, from the products as sets of identities and whether the two aggregates touched."""
    if len(members) == 1:
        return "aggregation"
    if len(members) > 2:
        return "fragmentation"
    same = all((m < size_i).all() or (m >= size_i).all() for m in members)
    if not same:
        return "exchange"
    return "parted" if contact else "missed"


def _keep(record: Recorder, frames: Frames, units: ReducedUnits, parent: NDArray[np.int64]) -> None:
    count = int(frames.written.min())
    record.time = frames.time[:count] * units.time
    record.positions = frames.positions[:count] * units.length
    record.tension = frames.tension[:count] * units.force
    record.parent = parent
