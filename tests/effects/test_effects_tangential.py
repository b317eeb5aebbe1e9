"""Sliding, rolling, twisting and rods: objectivity, energy, limits and statics of chains, over every resistance."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from effects_family import kernel, scene
from scipy.spatial.transform import Rotation

from mcdem.effects import EFFECTS, Resistance
from mcdem.effects.kinds import Response, Turned
from mcdem.effects.sums import contact_resistance, fixed_in_spheres
from mcdem.effects.tangential import (
    ROLLS,
    SLIDES,
    STUCK,
    TWISTS,
    carry,
    relative_turns,
    spread,
    turn_map,
)

RESISTANCES = [
    ("sliding",),
    ("rolling",),
    ("twisting",),
    ("rods",),
    ("sliding", "rolling"),
    ("sliding", "twisting"),
    ("rolling", "twisting"),
    ("sliding", "rolling", "twisting"),
    ("rods", "twisting"),
]
NEVER = {"friction_coefficient": 1e9, "largest_angle": 1e9, "largest_displacement": 1e9}


def test_every_resistance_is_in_the_family():
    members = {name for name, effect in EFFECTS.items() if isinstance(effect, Resistance)}
    assert {name for names in RESISTANCES for name in names} == members


every_resistance = pytest.mark.parametrize("names", RESISTANCES, ids="+".join)


def laws(*names, **changes):
    """Parameters of the resistances of a scene with these effects, some of them changed."""
    whole = scene(*names)
    chosen = whole.kernels.resistances
    return tuple(
        k._replace(**{key: value for key, value in changes.items() if key in k._fields}) for k in chosen
    )


def law(laws_, name):
    """Those of one resistance."""
    return next(k for k in laws_ if isinstance(k, EFFECTS[name].kernel))


def resist(laws_, carried, q, normal, distance=2.0, share_1=0.5, radius=1.0, normal_force=0.0):
    """(code, spring, loads, tangent) of one evaluation."""
    spring, loads, tangent = np.empty(7), np.empty(7), np.empty((7, 7))
    turned = Turned(carried, q, normal, distance, share_1, radius, normal_force)
    code = contact_resistance(turned, laws_, Response(spring, loads, tangent))
    return code, spring, loads, tangent


def step(before, after, turn_1, turn_2, fixed=False):
    """(q, normals, spins, distance) of one motion."""
    q, normals, spins = np.empty(7), np.empty((3, 3)), np.empty(2)
    distance = relative_turns(before, after, turn_1, turn_2, fixed, q, normals, spins)
    return q, normals, spins, distance


def carried(spring, start, end, spins):
    out = np.empty(7)
    carry(spring, start, end, spins, out)
    return out


def move(laws_, history, before, after, turn_1, turn_2, **arguments):
    """One step as an integrator takes it: (q, history, result of `resist`)."""
    q, normals, spins, distance = step(before, after, turn_1, turn_2, fixed_in_spheres(laws_))
    start = carried(history, normals[0], normals[1], spins)
    result = resist(laws_, start, q, normals[1], distance, **arguments)
    return q, carried(result[1], normals[1], normals[2], spins), result


def rotation(turn):
    """The rotation whose midpoint form is dx = turn x (middle position)."""
    size = np.linalg.norm(turn)
    return Rotation.from_rotvec(turn * (2 * np.arctan(size / 2) / size))


def midpoint_turn(rotation_):
    vector = rotation_.as_rotvec()
    angle = np.linalg.norm(vector)
    return vector * (2 * np.tan(angle / 2) / angle)


def a_spring(rng, normal, size=1e-4):
    """Random springs across `normal`, and a twist."""
    spring = rng.normal(size=7) * size
    for m in (0, 3):
        spring[m : m + 3] -= spring[m : m + 3] @ normal * normal
    return spring


def turns(rng, normal, size=1e-4):
    return a_spring(rng, normal, size)


# Kinematics


def test_a_rigid_motion_turns_no_sphere_against_the_contact():
    """To round-off, however large the step; and it turns the springs as it turns the pair."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        before, turn = rng.normal(size=3) + [3, 0, 0], rng.normal(size=3)
        rigid = rotation(turn)
        q, normals, spins, distance = step(before, rigid.apply(before), turn, turn)
        assert np.abs(q).max() < 1e-14
        assert normals[1] * distance == pytest.approx((before + rigid.apply(before)) / 2, abs=1e-14)
        spring = a_spring(rng, normals[0], 1.0)
        end = carried(carried(spring, normals[0], normals[1], spins), normals[1], normals[2], spins)
        assert end[:3] == pytest.approx(rigid.apply(spring[:3]), abs=1e-13)
        assert end[3:6] == pytest.approx(rigid.apply(spring[3:6]), abs=1e-13)
        assert end[6] == spring[6]


@every_resistance
def test_a_doublet_tumbling_for_many_turns_gathers_no_history(names):
    """1000 steps of 0.1 rad about an axis askew to it, each sphere turning with it; its springs turn with it."""
    rng = np.random.default_rng(2)
    kernels, turn = laws(*names, **NEVER), np.array([0.08, -0.04, 0.045])
    for start in (np.zeros(7), a_spring(rng, np.array([0.0, 0.8, 0.6]))):
        kept = resist(kernels, start, np.zeros(7), np.array([0.0, 0.8, 0.6]))[1]  # what these laws keep
        history, r, whole = start.copy(), np.array([0.0, 1.6, 1.2]), Rotation.identity()
        for _ in range(1000):
            after = rotation(turn).apply(r)
            _, history, _ = move(kernels, history, r, after, turn, turn)
            r, whole = after, rotation(turn) * whole
        expected = np.concatenate([whole.apply(kept[:3]), whole.apply(kept[3:6]), kept[6:]])
        # A thousand roundings of a turn of 0.1.
        assert history == pytest.approx(expected, abs=1e-13)


def test_turns_do_not_see_a_rotation_of_the_observer():
    """Motion of the contact on top of a rotation of everything: the same turns, carried along, to second order in the step."""
    rng, error = np.random.default_rng(3), []
    before = np.array([0.3, 1.9, -0.6])
    small = [1e-6 * rng.normal(size=3) for _ in range(3)]
    for angle in (0.2, 0.1, 0.05):
        observer = Rotation.from_rotvec(angle * np.array([0.48, 0.6, 0.64]))
        q, normals, _, _ = step(before, before + small[0], small[1], small[2])
        seen, turned, spins, _ = step(
            before,
            observer.apply(before + small[0]),
            midpoint_turn(observer * rotation(small[1])),
            midpoint_turn(observer * rotation(small[2])),
        )
        expected = carried(q, normals[1], turned[1], spins)
        error.append(np.abs(seen - expected).max() / np.abs(q).max())
    assert error[2] < 1e-3
    assert error[0] / error[1] == pytest.approx(4, rel=0.1) and error[1] / error[2] == pytest.approx(
        4, rel=0.1
    )


def test_the_map_is_the_derivative_of_the_turns_and_spreads_the_loads():
    rng = np.random.default_rng(4)
    r = np.array([0.5, -1.7, 0.8])
    distance = np.linalg.norm(r)
    normal, B = r / distance, np.empty((7, 12))
    turn_map(normal, distance, B)
    motion = 1e-7 * rng.normal(size=12)
    q = step(
        r - 0.5 * (motion[6:9] - motion[:3]), r + 0.5 * (motion[6:9] - motion[:3]), motion[3:6], motion[9:12]
    )[0]
    assert q == pytest.approx(B @ motion, rel=1e-7)  # differences of r lose eight digits
    loads = a_spring(rng, normal, 1.0)
    force_2, torque_1, torque_2 = np.empty(3), np.empty(3), np.empty(3)
    spread(loads, normal, distance, force_2, torque_1, torque_2)
    assert np.concatenate([-force_2, torque_1, force_2, torque_2]) == pytest.approx(B.T @ loads, abs=1e-15)
    assert torque_1 + torque_2 + np.cross(r, force_2) == pytest.approx(np.zeros(3), abs=1e-15)


def test_slip_of_the_surfaces_is_the_sliding_displacement():
    """Two spheres of unequal radius: (u2 - u1) - (arm1 w1 + arm2 w2) x n, of a spring that was at rest."""
    rng = np.random.default_rng(5)
    a1, a2 = 1.0, 0.4
    r = (a1 + a2) * np.array([0.6, 0.0, 0.8])
    du, w1, w2 = 1e-6 * rng.normal(size=(3, 3))
    _, _, (_, spring, _, _) = move(
        laws("sliding", **NEVER), np.zeros(7), r - du / 2, r + du / 2, w1, w2, share_1=a1 / (a1 + a2)
    )
    normal = r / np.linalg.norm(r)
    slip = du - np.cross(a1 * w1 + a2 * w2, normal)
    assert spring[:3] == pytest.approx(slip - slip @ normal * normal, rel=1e-9)


def test_gears_that_roll_do_not_slide_and_a_turning_pair_does_not_roll():
    r, turn, both = np.array([0.0, 0.0, 2.0]), np.array([1e-5, 0.0, 0.0]), laws("sliding", "rolling")
    _, _, (_, spring, _, _) = move(both, np.zeros(7), r, r, turn, -turn)
    assert np.abs(spring[:3]).max() < 1e-19 and spring[3:6] == pytest.approx(-2 * turn, abs=1e-19)
    _, _, (_, spring, _, _) = move(both, np.zeros(7), r, r, turn, turn)
    assert np.abs(spring[3:6]).max() < 1e-19 and np.linalg.norm(spring[:3]) == pytest.approx(2e-5)


# Every resistance


@every_resistance
@pytest.mark.parametrize("size", [1e-6, 0.1], ids=["stuck", "at the limit"])
def test_the_tangent_is_the_derivative_of_the_loads(names, size):
    rng, normal = np.random.default_rng(6), np.array([0.36, 0.48, 0.8])
    start, q = a_spring(rng, normal, size), turns(rng, normal, size)
    arguments = dict(distance=2.1, share_1=0.35, radius=0.8, normal_force=0.01)
    code, _, loads, tangent = resist(laws(*names), start, q, normal, **arguments)
    assert (code == STUCK) == (size == 1e-6)
    assert loads[:3] @ normal == pytest.approx(0, abs=1e-12) and loads[3:6] @ normal == pytest.approx(
        0, abs=1e-12
    )
    for _ in range(10):
        dq = turns(rng, normal, 1e-6 * size)
        ahead, back = (resist(laws(*names), start, q + s * dq, normal, **arguments)[2] for s in (1, -1))
        error = np.abs((back - ahead) / 2 - tangent @ dq).max()
        assert error < 1e-8 * np.abs(loads).max() * 1e-6 + 1e-15 * np.abs(loads).max()
    assert np.all(np.linalg.eigvalsh(tangent) >= -1e-12 * np.abs(tangent).max())
    assert tangent == pytest.approx(tangent.T)


@every_resistance
def test_within_its_limit_a_resistance_conserves_energy(names):
    """Work of the mean of the loads before and after each step is the loss of elastic energy, on any path of a turning pair."""
    rng, kernels = np.random.default_rng(7), laws(*names, **NEVER)
    r, history, work = np.array([0.0, 1.2, 1.6]), np.zeros(7), 0.0
    for _ in range(200):
        rigid, loose = 0.1 * rng.normal(size=3), 1e-4 * rng.normal(size=(3, 3))
        after = rotation(rigid).apply(r) + loose[0]
        q, normals, spins, distance = step(
            r, after, rigid + loose[1], rigid + loose[2], fixed_in_spheres(kernels)
        )
        start = carried(history, normals[0], normals[1], spins)
        before = resist(kernels, start, np.zeros(7), normals[1], distance)[2]
        code, spring, loads, tangent = resist(kernels, start, q, normals[1], distance)
        assert code == STUCK
        work += 0.5 * (before + loads) @ q
        r, history = after, carried(spring, normals[1], normals[2], spins)
    energy = 0.5 * loads @ np.linalg.pinv(tangent, rcond=1e-10) @ loads
    assert work == pytest.approx(-energy, rel=1e-10)


@every_resistance
def test_at_its_limit_a_resistance_dissipates_and_comes_back_elastic(names):
    rng, normal = np.random.default_rng(8), np.array([0.36, 0.48, 0.8])
    kernels, spring = laws(*names), np.zeros(7)
    push = turns(rng, normal, 1e-4)
    for _ in range(4000):
        code, spring, loads, _ = resist(kernels, spring, push, normal)
        assert loads @ push <= 0
    assert code == sum(
        {"sliding": SLIDES, "rolling": ROLLS, "twisting": TWISTS, "rods": ROLLS}[name] for name in names
    )
    again = resist(kernels, spring, push, normal)
    assert again[2] == pytest.approx(loads, rel=1e-12, abs=1e-12 * np.abs(loads).max())
    code, _, released, tangent = resist(kernels, spring, -1e-3 * push, normal)
    assert code == STUCK
    assert released - loads == pytest.approx(
        tangent @ (1e-3 * push), rel=1e-9, abs=1e-12 * np.abs(loads).max()
    )


@every_resistance
def test_absent_is_stiffness_zero(names):
    rng, normal = np.random.default_rng(9), np.array([0.0, 0.6, 0.8])
    q, start = turns(rng, normal), a_spring(rng, normal)
    for other in (["sliding", "twisting"], ["rods"], []):
        if (
            set(names) & set(other)
            or ("rods" in names and "sliding" in other)
            or ("rods" in other and "twisting" not in names)
        ):
            continue
        zero = tuple(k._replace(stiffness=0.0) for k in laws(*names))
        without = laws(*other)
        with_zero = (*without, *zero)
        for a, b in zip(resist(with_zero, start, q, normal)[2:], resist(without, start, q, normal)[2:]):
            assert np.array_equal(a, b)


@pytest.mark.parametrize("radius", [0.4, 1.7])
@pytest.mark.parametrize("names", [("sliding",), ("rolling",), ("twisting",)])
@pytest.mark.parametrize("size", [1e-6, 0.1], ids=["stuck", "at the limit"])
def test_two_spheres_of_one_radius_are_the_scene_of_that_radius(names, radius, size):
    """Torques scale by the cube, lengths by the radius; rods have no law for other radii."""
    rng, normal = np.random.default_rng(10), np.array([0.0, 0.6, 0.8])
    q = turns(rng, normal, size)
    whole = scene(*names, radius=radius * 500e-9)
    own = resist(whole.kernels.resistances, np.zeros(7), q, normal)
    common = resist(laws(*names), np.zeros(7), q, normal, distance=2.0 * radius, radius=radius)
    assert common[2] == pytest.approx(own[2] * radius**3, rel=1e-12, abs=1e-12 * np.abs(common[2]).max())
    assert common[3] == pytest.approx(own[3] * radius**3, rel=1e-12, abs=1e-12 * np.abs(common[3]).max())


# Truths


def test_stiffness_and_limits_in_si():
    """Mindlin, Dominik & Tielens and Marshall for the paper's spheres, from their own formulas."""
    whole = scene("sliding", "rolling", "twisting")
    unit = whole.reduced
    sliding, rolling, twisting = (kernel(whole, name) for name in ("sliding", "rolling", "twisting"))
    gamma, E, nu, a = 4.7e-3, 3.4e9, 0.5, 500e-9
    b0 = (9 * pi * gamma * a**2 * (1 - nu**2) / (2 * E)) ** (1 / 3)
    adhesion = 1.5 * pi * gamma * a
    shear = 1 / (2 * (2 - nu) / (E / (2 * (1 + nu))))
    assert sliding.stiffness * unit.stiffness == pytest.approx(8 * shear * b0, rel=1e-12)
    assert 8 * shear * b0 == pytest.approx(46.6, abs=0.05)
    assert rolling.stiffness * unit.energy == pytest.approx(4 * adhesion * a / 2, rel=1e-12)
    assert twisting.stiffness * unit.energy == pytest.approx(8 * shear * b0 * b0**2 / 2, rel=1e-12)
    x = np.array([0.0, 0.0, 1.0])
    for load in (-adhesion, 0.0, 3 * adhesion):
        far = np.array([0.1, 0, 0, -0.1, 0.2, 0, 0.5])
        laws_ = (sliding, rolling, twisting)
        code, _, loads, _ = resist(laws_, np.zeros(7), far, x, normal_force=load / unit.force)
        assert code == SLIDES | ROLLS | TWISTS
        friction = 0.3 * (load + 2 * adhesion)
        # The mean torque is that of friction at the contact, half the difference that of rolling.
        assert np.linalg.norm(loads[:3] + loads[3:6]) * unit.energy == pytest.approx(
            2 * a * friction, rel=1e-12
        )
        assert abs(loads[6]) * unit.energy == pytest.approx(2 / 3 * b0 * friction, rel=1e-12)
        assert np.linalg.norm(loads[3:6] - loads[:3]) / 2 * unit.energy == pytest.approx(
            4 * adhesion * 0.5e-9, rel=1e-12
        )


def clamped_chain(laws_, n, load, torque):
    """Motion (6,) of the last of n + 1 touching unit spheres, the first one clamped, under a small `load` and `torque` on it."""
    axis = np.array([0.36, 0.48, 0.8])
    tangent, B = resist(laws_, np.zeros(7), np.zeros(7), axis)[3], np.empty((7, 12))
    turn_map(axis, 2.0, B)
    stretch = np.concatenate([-axis, np.zeros(3), axis, np.zeros(3)])
    bond = B.T @ tangent @ B + np.abs(tangent).max() * np.outer(stretch, stretch)
    stiffness = np.zeros((6 * n + 6, 6 * n + 6))
    for i in range(n):
        stiffness[6 * i : 6 * i + 12, 6 * i : 6 * i + 12] += bond
    push = np.zeros(6 * n)
    push[-6:] = [*load, *torque]
    return np.linalg.solve(stiffness[6:, 6:], push)[-6:]


ACROSS = np.array([0.8, -0.6, 0.0])  # to the axis of the chain


@pytest.mark.parametrize("n", [1, 2, 5, 20])
def test_a_clamped_chain_of_rods_bends_as_its_energy_demands(n):
    """Moments m r F and (m + 1) r F at the ends of the m-th bond: deflection (F/k_t) n (2 n^2 + 1)/3, in the limit a beam."""
    kernels = laws("rods", "twisting")
    motion = clamped_chain(kernels, n, ACROSS, np.zeros(3))
    assert motion[:3] * law(kernels, "rods").stiffness == pytest.approx(
        n * (2 * n**2 + 1) / 3 * ACROSS, rel=1e-7, abs=1e-7 * n**3
    )


@pytest.mark.parametrize("n", [1, 2, 5, 20])
def test_a_clamped_chain_of_sliding_and_rolling_contacts_bends_as_its_energy_demands(n):
    """Each contact shears by F/k_T and bends by its moment (m + 1/2) r F over k_R: F [n/k_T + r^2 n (4 n^2 - 1)/(12 k_R)]."""
    kernels = laws("sliding", "rolling", "twisting")
    motion = clamped_chain(kernels, n, ACROSS, np.zeros(3))
    expected = (
        n / law(kernels, "sliding").stiffness
        + 4 * n * (4 * n**2 - 1) / 12 / law(kernels, "rolling").stiffness
    )
    assert motion[:3] == pytest.approx(expected * ACROSS, rel=1e-7, abs=1e-7 * expected)
    axis = np.array([0.36, 0.48, 0.8])
    motion = clamped_chain(kernels, n, np.zeros(3), axis)
    assert motion[3:] == pytest.approx(n / law(kernels, "twisting").stiffness * axis, rel=1e-7)


class RodsInSpheres:
    """Becker & Briesen's rods, literally: unit vectors that turn with their spheres, springs from their tips to the centres."""

    def __init__(self, r, stiffness):
        self.rods, self.stiffness = [r / np.linalg.norm(r), -r / np.linalg.norm(r)], stiffness

    def turn(self, turn_1, turn_2):
        self.rods = [rotation(turn_1).apply(self.rods[0]), rotation(turn_2).apply(self.rods[1])]

    def energy(self, r):
        """k_t/2 of the squared displacement of each tip across the line of centres, rods as long as the distance."""
        n = r / np.linalg.norm(r)
        tips = [np.linalg.norm(r) * (d - d @ n * n) for d in self.rods]
        return 0.5 * self.stiffness * sum(t @ t for t in tips)

    def force_2(self, r):
        n, length = r / np.linalg.norm(r), np.linalg.norm(r)
        tips = [length * (d - d @ n * n) for d in self.rods]
        return self.stiffness * (tips[0] - tips[1])

    def torques(self, r):
        n, length = r / np.linalg.norm(r), np.linalg.norm(r)
        return [
            self.stiffness * length**2 * (self.rods[0] @ n) * np.cross(self.rods[0], n),
            self.stiffness * length**2 * (self.rods[1] @ -n) * np.cross(self.rods[1], -n),
        ]


def test_rods_are_those_of_their_slow_twin():
    """A pair that rotates as a body by whole turns while its spheres twist freely and turn against each other by some 1e-3."""
    rng, kernels = np.random.default_rng(11), laws("rods", **NEVER)
    r = np.array([0.0, 1.2, 1.6])
    twin, history = RodsInSpheres(r, law(kernels, "rods").stiffness), np.zeros(7)
    drift = 1e-5 * rng.normal(size=(3, 3))
    for _ in range(400):
        rigid = np.array([0.03, -0.01, 0.02])
        observer = rotation(rigid)
        spin = 5e-3 * r  # free twisting, by four radians in all
        turn_1, turn_2 = (
            midpoint_turn(observer * rotation(d)) for d in (drift[1] + spin, drift[2] - 0.4 * spin)
        )
        after = observer.apply(r + drift[0])
        after *= 2.0 / np.linalg.norm(after)
        _, history, _ = move(kernels, history, r, after, turn_1, turn_2)
        r = after
        twin.turn(turn_1, turn_2)
        drift = np.array([observer.apply(d) for d in drift])
    _, _, loads, _ = resist(kernels, history, np.zeros(7), r / 2.0)
    force_2, torque_1, torque_2 = np.empty(3), np.empty(3), np.empty(3)
    spread(loads, r / 2.0, 2.0, force_2, torque_1, torque_2)
    scale = np.linalg.norm(twin.force_2(r))
    assert np.linalg.norm(history[:6]) > 1e-3
    # Springs are linear in the angle, the twin in its sine; a step of 0.04 rad turns the drift to second order.
    assert force_2 == pytest.approx(twin.force_2(r), abs=1e-3 * scale)
    assert torque_1 == pytest.approx(twin.torques(r)[0], abs=2e-3 * scale)
    assert torque_2 == pytest.approx(twin.torques(r)[1], abs=2e-3 * scale)
