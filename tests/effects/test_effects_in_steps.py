"""Every kind of force in the steps of an encounter, against the motion of two spheres that their force alone strain_loads."""

from __future__ import annotations

import numpy as np
import pytest
from effects_family import scene
from following import Follow
from scipy.integrate import solve_ivp

from mcdem.effects.sums import contact_equilibrium, non_contact_force
from mcdem.integrators import SCHEMES

START = 4e-3
# Each compiles its own steps: one of them runs by default.
COMBINATIONS = [
    ("van_der_waals", "double_layer", "born", "steric"),
    *(
        pytest.param(names, marks=pytest.mark.slow)
        for names in (
            ("van_der_waals",),
            ("unretarded", "double_layer"),
            ("constant_charge", "jkr"),
            ("van_der_waals", "constant_charge", "born"),
            ("van_der_waals", "steric"),
            ("steric",),
        )
    ),
]


def two_spheres(names, scheme, gap, time):
    """Two primaries at a gap [a] in fluid at rest, each dragged by itself, that are to be followed for a time [1/g]."""
    s = scene(*names).with_changes(
        {"hydrodynamics.level": "free_draining", "numerics.scheme": scheme}
        | ({"numerics.implicit.max_step": time / 200.0} if scheme == "implicit" else {})
        | (
            {"numerics.explicit_euler.base_step": f"{float(time) / 4000.0 * 1e-4!r} s"}
            if scheme == "explicit_euler"
            else {}
        )
    )
    return Follow(s, np.array([[0.0, 0.0, 0.0], [1.2, 0.0, 1.6]]) * (1.0 + 0.5 * gap), [], still=True)


def gap_of(positions):
    return np.linalg.norm(positions[1] - positions[0]) - 2.0


# The default scheme by default, every other one slowly.
DEFAULT, *OTHERS = SCHEMES


@pytest.mark.parametrize("scheme", [DEFAULT, *(pytest.param(s, marks=pytest.mark.slow) for s in OTHERS)])
@pytest.mark.parametrize("names", COMBINATIONS, ids="+".join)
def test_a_gap_closes_or_opens_as_the_sum_of_the_forces_is(names, scheme):
    """Drag 6 pi mu a on each sphere: dh/dt = 2 F(h), integrated by another program until h has changed by a half."""
    physics = two_spheres(names, scheme, START, 1.0).physics

    def rate(_, h):
        force, _ = non_contact_force(h[0], 1.0, physics.pair_forces)
        return [2.0 * force]

    def half(_, h):
        return abs(h[0] - START) - 0.5 * START

    half.terminal = True
    found = solve_ivp(rate, (0.0, 1e6), [START], events=half, rtol=1e-10, atol=1e-14)
    (time,), end = found.t_events[0], found.y[0, -1]
    assert abs(end - START) == pytest.approx(0.5 * START, rel=1e-6)
    followed = gap_of(two_spheres(names, scheme, START, time).until(time))
    assert followed - START == pytest.approx(end - START, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("names", [("van_der_waals", "jkr"), ("van_der_waals", "dmt")], ids="+".join)
def test_spheres_that_attract_each_other_come_to_rest_in_the_contact_of_their_law(names, scheme):
    two = two_spheres(names, scheme, 1e-3, 0.05)
    rest, _ = contact_equilibrium(1.0, two.physics.contact)
    assert gap_of(two.until(0.5)) == pytest.approx(rest, rel=1e-6)
    assert two.motion.bonded[1, 0]
