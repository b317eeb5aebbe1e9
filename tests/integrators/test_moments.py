"""Contacts that resist sliding, rolling and twisting, followed in an encounter: balance, limits, statics, a slow reference."""

from __future__ import annotations

import numpy as np
import pytest
from effects_family import kernel, scene
from following import Follow, free_draining, untwisted
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import mcdem
from mcdem.analysis.dataset import RunDataset
from mcdem.effects.sums import contact_equilibrium, contact_force
from mcdem.encounter.motion import analysed
from mcdem.encounter.simulate import physics_of, springs_of
from mcdem.errors import SceneError
from mcdem.hydrodynamics.grand_mobility import tensor_to_five
from mcdem.hydrodynamics.undisturbed_flow import UndisturbedFlow
from mcdem.monte_carlo.comparison import identical
from mcdem.monte_carlo.run_control import run
from mcdem.rigid_aggregates.statics import present_load, worst_load

MONOMER = mcdem.Aggregate.monomer()
ALL = ("sliding", "rolling", "twisting")
# Every combination of effects compiles its own steps, for a minute: one of them runs by default.
combinations = pytest.mark.parametrize(
    "names", [("rods", "twisting"), pytest.param(ALL, marks=pytest.mark.slow)], ids="+".join
)
WELDED = {  # limits that nothing reaches
    "effects.rods.largest_displacement": "400 nm",
    "effects.twisting.friction_coefficient": 1e6,
}


def settled_gap(scene_):
    return contact_equilibrium(1.0, physics_of(scene_)[1].contact)[0]


def chain(scene_, directions):
    """Positions (n, 3) of touching spheres at the unloaded gap, and their bonds."""
    length = 2.0 + settled_gap(scene_)
    steps = np.array(directions, float)
    steps *= length / np.linalg.norm(steps, axis=1)[:, None]
    positions = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return positions - positions.mean(axis=0), [(k, k + 1) for k in range(len(directions))]


BENT = [(0.0, 1.0, 0.3), (0.2, 0.3, 1.0), (0.7, 0.7, 0.2)]


def strained(rng, n, bonds, positions, size=1e-4):
    springs = np.zeros((n, n, 7))
    for low, high in bonds:
        normal = positions[high] - positions[low]
        normal /= np.linalg.norm(normal)
        spring = size * rng.normal(size=7)
        for m in (0, 3):
            spring[m : m + 3] -= spring[m : m + 3] @ normal * normal
        springs[high, low] = spring
    return springs


@combinations
def test_contacts_exert_no_force_and_no_torque_in_all(names):
    """In fluid at rest, each sphere dragged by itself: the drags of a step add to no force, and to no torque about anywhere."""
    rng, s = np.random.default_rng(1), free_draining(*names)
    positions, bonds = chain(s, BENT)
    f = Follow(s, positions, bonds, still=True, springs=strained(rng, 4, bonds, positions, 3e-3))
    before = f.motion.positions.copy()
    moved = 0.0
    for _ in range(5):
        start = f.motion.positions.copy()
        f.until(1e9, steps=1)
        displacement = f.motion.positions - start
        middle = 0.5 * (f.motion.positions + start)
        torque = np.cross(middle, displacement).sum(axis=0) + 4.0 / 3.0 * f.work.torques.turns.sum(axis=0)
        assert np.abs(displacement.sum(axis=0)).max() < 1e-13
        assert np.abs(torque).max() < 1e-11
        moved = max(moved, np.abs(f.work.torques.turns).max())
    assert moved > 1e-5 and not np.array_equal(before, f.motion.positions)


@combinations
def test_a_turned_observer_sees_the_same_turned(names):
    rng, s = np.random.default_rng(2), free_draining(*names)
    positions, bonds = chain(s, BENT)
    springs = strained(rng, 4, bonds, positions)
    turn = Rotation.random(rng=rng)
    seen = []
    for observer in (Rotation.identity(), turn):
        matrix = observer.as_matrix()
        turned = springs.copy()
        turned[..., :3], turned[..., 3:6] = springs[..., :3] @ matrix.T, springs[..., 3:6] @ matrix.T
        f = Follow(s, observer.apply(positions), bonds, springs=turned)
        gradient = matrix @ f.flow.gradient @ matrix.T
        strain = 0.5 * (gradient + gradient.T)
        five = np.empty(5)
        tensor_to_five(strain, five)
        f.flow = UndisturbedFlow(gradient, strain, five)
        end = observer.inv().apply(f.until(1.0))
        back = f.motion.springs.copy()
        back[..., :3], back[..., 3:6] = back[..., :3] @ matrix, back[..., 3:6] @ matrix
        seen.append((end, back))
    assert seen[0][0] == pytest.approx(seen[1][0], abs=1e-8)
    assert seen[0][1] == pytest.approx(seen[1][1], abs=1e-8)
    assert np.abs(seen[0][1]).max() > 1e-5


def test_a_welded_doublet_turns_as_its_drag_says():
    """Free draining, in the shear plane: omega (2 (4/3) + r^2/2) = (4/3) + (r^2/2) n_y^2 about the vorticity axis."""
    s = free_draining("rods", "twisting", **WELDED, **{"numerics.implicit.max_step": 0.02})
    angle = 0.3
    positions, bonds = chain(s, [(0.0, np.sin(angle), np.cos(angle))])
    f = Follow(s, positions, bonds)
    end = f.until(2.0)
    r2 = (2.0 + settled_gap(s)) ** 2 / 2.0

    def rate(_, angle):
        # The flow turns from y to z: angles from the flow fall.
        return -(4.0 / 3.0 + r2 * np.sin(angle) ** 2) / (8.0 / 3.0 + r2)

    exact = solve_ivp(rate, (0.0, 2.0), [angle], rtol=1e-10, atol=1e-12).y[0, -1]
    axis = end[1] - end[0]
    assert np.arctan2(axis[1], axis[2]) == pytest.approx(exact, abs=2e-4)


def twin(s, positions, bonds, time):
    """The same by another way: rods as vectors fixed in spheres that turn, energy in place of springs, a stiff explicit solver.

    Forces and torques are differences of the energy (k_t/2) (xi_1^2 + xi_2^2) plus that of the contact, free draining.
    """
    k_t, contact = kernel(s, "rods").stiffness, physics_of(s)[1].contact
    n = len(positions)
    rods = []
    for i, j in bonds:
        r = positions[j] - positions[i]
        rods.append((i, j, r / np.linalg.norm(r)))

    def rates(_, state_):
        x, turn = state_[: 3 * n].reshape(n, 3), Rotation.from_quat(state_[3 * n :].reshape(n, 4))
        force = np.zeros((n, 3))
        torque = np.zeros((n, 3))
        for i, j, e in rods:
            r = x[j] - x[i]
            distance = np.linalg.norm(r)
            normal = r / distance
            F = contact_force(distance - 2.0, 1.0, contact)[0]
            force[i] -= F * normal
            force[j] += F * normal
            # The tip of the rod of i lies off the line of centres; xi its distance across it (rod of j: mirrored).
            for sphere, other, sign in ((i, j, 1.0), (j, i, -1.0)):
                arm = turn[sphere].apply(sign * e)
                line = sign * normal
                off = distance * (arm - arm @ line * line)
                pull = -k_t * off  # on the tip, which is `distance` away along the arm
                moment = np.cross(distance * line, pull)
                torque[sphere] += moment
                # The couple of forces that balances it.
                couple = np.cross(moment, line) / distance
                force[other] -= couple
                force[sphere] += couple
        x_rate = force + np.stack([np.zeros(n), np.zeros(n), x[:, 1]], axis=1)
        omega = 0.75 * torque + np.array([0.5, 0.0, 0.0])
        q = state_[3 * n :].reshape(n, 4)
        q_rate = np.empty((n, 4))
        q_rate[:, :3] = 0.5 * (q[:, 3:] * omega + np.cross(omega, q[:, :3]))
        q_rate[:, 3] = -0.5 * (omega * q[:, :3]).sum(axis=1)
        return np.concatenate([x_rate.ravel(), q_rate.ravel()])

    start = np.concatenate([positions.ravel(), np.tile([0.0, 0.0, 0.0, 1.0], n)])
    found = solve_ivp(rates, (0.0, time), start, method="LSODA", rtol=1e-8, atol=1e-10)
    return found.y[: 3 * n, -1].reshape(n, 3)


@pytest.mark.parametrize("shape", [BENT[:1], BENT[:2]], ids=["doublet", "triplet"])
def test_implicit_steps_agree_with_a_twin_that_keeps_rods_as_vectors(shape):
    """Soft bonds, so that they bend well; the error is small against what the bonds do."""
    s = free_draining("rods", "twisting", **WELDED, **{"effects.rods.stiffness": "0.2 N/m"})
    positions, bonds = chain(s, shape)
    expected = twin(s, positions, bonds, 1.5)
    found = [
        Follow(
            s.with_changes({"numerics.implicit.max_step": step}), positions, bonds, without_twist=True
        ).until(1.5)
        for step in (0.04, 0.01)
    ]
    free = Follow(free_draining("jkr"), positions, bonds).until(1.5)
    done = np.abs(free - expected).max()
    error = [np.abs(x - expected).max() for x in found]
    assert error[0] < 0.02 * done and error[1] < 0.005 * done


def angle_of(positions):
    first, second = positions[1] - positions[0], positions[2] - positions[1]
    return np.degrees(np.arccos(first @ second / np.linalg.norm(first) / np.linalg.norm(second)))


def test_a_bent_chain_keeps_its_angle_where_contacts_bear_moments_and_folds_where_not():
    shape = [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    stiff = free_draining("rods", "twisting", **WELDED, **{"effects.rods.stiffness": "50 N/m"})
    positions, bonds = chain(stiff, shape)
    assert angle_of(Follow(stiff, positions, bonds).until(4.0)) == pytest.approx(90.0, abs=0.5)
    loose = free_draining("jkr")
    assert abs(angle_of(Follow(loose, positions, bonds).until(4.0)) - 90.0) > 20.0


@combinations
def test_a_straight_chain_in_shear_stays_straight(names):
    # Rolling is soft: at 1000 Pa the couples on the spheres exceed by far the moment that it bears, 4 F_adh xi_crit.
    weak = {"flow.shear_rate": "10 1/s"} if "rolling" in names else {}
    s = free_draining(*names, **weak)
    positions, bonds = chain(s, [(0.1, 0.6, 0.7)] * 3)
    end = Follow(s, positions, bonds).until(2.0)
    off = end - end.mean(axis=0)
    values = np.linalg.svd(off, compute_uv=False)
    # The couples on its spheres bend it, elastically, by as much as the bonds give way: 1e-4.
    assert values[0] < 1.2 * np.linalg.svd(positions, compute_uv=False)[0]
    assert values[1] < 2e-4 * values[0]


@pytest.mark.slow
@pytest.mark.parametrize("names", [("sliding",), ("rolling",), ("twisting",), ("rods",), ALL], ids="+".join)
def test_a_resistance_of_strength_zero_is_one_that_is_absent(names):
    """To the tolerance of the iteration: turns are then solved for, not eliminated."""
    present, absent = free_draining(*names), free_draining("jkr")
    positions, bonds = chain(present, BENT)
    f = Follow(present, positions, bonds)
    zero = tuple(law._replace(stiffness=0.0) for law in f.physics.resistances)
    assert len(zero) == len(names)
    f.physics = f.physics._replace(resistances=zero)
    assert f.until(1.0) == pytest.approx(Follow(absent, positions, bonds).until(1.0), abs=1e-7)


# Statics


def analysed_chain(s, shape, springs=None):
    positions, bonds = chain(s, shape)
    f = Follow(s, positions, bonds, springs=springs)
    return f, analysed(f.motion, f.physics)[0]


def test_a_chain_is_rigid_where_contacts_bear_moments_and_floppy_where_not():
    assert analysed_chain(free_draining("rods", "twisting"), BENT)[1] is not None
    assert analysed_chain(free_draining("van_der_waals", "jkr"), BENT)[1] is None
    # Twist about the inner bond moves the ends of a bent chain, and rods do not resist it; in a bent triplet it moves nothing.
    for shape, rigid in ((BENT, False), (BENT[:2], True)):
        f, _ = analysed_chain(free_draining("rods", "twisting"), shape)
        assert (analysed(f.motion, untwisted(f.physics))[0] is not None) == rigid


def test_statics_say_what_a_welded_doublet_bears():
    """Free draining: the tension is that of two spheres dragged apart, 2 F/a = r.E.r/r, and friction bears the rest."""
    s = free_draining("rods", "twisting", **WELDED)
    f, body = analysed_chain(s, [(0.0, 1.0, 1.0)])
    seen = f.flow.strain_five
    load = body.rest + body.response @ seen
    r = 2.0 + settled_gap(s)
    assert body.contacts == 1
    assert load[0] == pytest.approx(0.5 * r * 0.5, rel=1e-6)
    # Across at 45 degrees the doublet turns with the vorticity: neither sphere is turned against the bond.
    assert np.abs(load[1:33]).max() < 1e-9
    f, body = analysed_chain(s, [(0.0, 0.0, 1.0)])
    # Along the flow: the pair turns by omega, the fluid by 1/2: each sphere feels (4/3)(1/2 - omega).
    omega = (4.0 / 3.0) / (8.0 / 3.0 + r * r / 2.0)
    torque = 4.0 / 3.0 * (0.5 - omega)
    spring = torque / (kernel(s, "rods").stiffness * r)
    load = body.rest + body.response @ seen
    assert load[1:17].max() == pytest.approx(spring, rel=1e-6)
    assert load[17:33].max() == pytest.approx(spring, rel=1e-6)


@pytest.mark.parametrize("level", ["free_draining", pytest.param("stokesian", marks=pytest.mark.slow)])
def test_statics_agree_with_the_springs_that_steps_lead_to(level):
    """Springs of a stiff chain followed in shear, against what statics says of its present orientation."""
    s = scene("rods", "twisting").with_changes(
        WELDED
        | {
            "hydrodynamics.level": level,
            "numerics.implicit.max_step": 0.01,
            "effects.rods.stiffness": "500 N/m",
        }
    )
    f, _ = analysed_chain(s, BENT[:2])
    f.until(0.5)
    body, _ = analysed(f.motion, f.physics)
    load = body.rest + body.response @ f.flow.strain_five
    tension = load[: body.contacts]
    for b, (i, j) in enumerate([(1, 0), (2, 1)]):
        gap = np.linalg.norm(f.motion.positions[i] - f.motion.positions[j]) - 2.0
        now = -contact_force(gap, 1.0, f.physics.contact)[0]
        assert tension[b] == pytest.approx(now, abs=0.02 * np.abs(tension).max())
        rows = load[body.contacts + b * 34 : body.contacts + b * 34 + 16]
        assert rows.max() == pytest.approx(np.linalg.norm(f.motion.springs[i, j, :3]), rel=0.05)


def test_the_worst_load_bounds_every_orientation():
    s = scene("rods", "twisting").with_changes({"hydrodynamics.level": "free_draining"})
    f, body = analysed_chain(s, BENT)
    worst = worst_load(body, f.flow.strain_five)
    met = 0.0
    for turn in Rotation.random(2000, rng=np.random.default_rng(3)).as_matrix():
        five = np.empty(5)
        tensor_to_five(turn.T @ f.flow.strain @ turn, five)
        met = max(met, present_load(body, five)[0])
    assert 0.9 * worst < met <= worst * (1 + 1e-12)


# In encounters and runs


def test_histories_go_with_aggregates():
    s = scene("rods", "twisting").with_changes({"hydrodynamics.level": "free_draining"})
    doublet = mcdem.simulate_encounter(s, MONOMER, MONOMER, offset=(0.0, 2e-7), seed=1).products[0]
    assert doublet.springs.shape == (1, 7) and np.abs(doublet.springs).max() > 1e-6
    turned = doublet.turned(np.random.default_rng(4))
    axis, after = (a.positions[1] - a.positions[0] for a in (doublet, turned))
    for m in (0, 3):
        assert turned.springs[0, m : m + 3] @ after == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(turned.springs[0, m : m + 3]) == pytest.approx(
            np.linalg.norm(doublet.springs[0, m : m + 3])
        )
    assert np.linalg.norm(axis) == pytest.approx(np.linalg.norm(after))
    both = springs_of([doublet, turned])
    assert np.array_equal(both[1, 0], doublet.springs[0]) and np.array_equal(both[3, 2], turned.springs[0])
    assert np.count_nonzero(np.abs(both).sum(axis=2)) == 2


def test_a_run_keeps_histories_and_goes_on_from_them(tmp_path):
    s = scene("rods", "twisting").with_changes(
        {"hydrodynamics.level": "free_draining", "population.initial": 12, "run.snapshot_every": "1 s"}
    )
    run(s, tmp_path / "whole.nc", events=30, seed=3)
    run(s, tmp_path / "parts.nc", events=14, seed=3)
    run(s, tmp_path / "parts.nc", events=30, resume=True)
    assert identical(tmp_path / "whole.nc", tmp_path / "parts.nc")
    springs = [a.springs for a in RunDataset(tmp_path / "whole.nc").aggregates() if a.size > 1]
    assert springs and max(np.abs(one).max() for one in springs) > 1e-6


def test_the_explicit_scheme_refuses_resistances():
    with pytest.raises(SceneError, match=r'numerics.scheme = "explicit_euler" follows no torques'):
        scene("rods").with_changes({"numerics.scheme": "explicit_euler"})
