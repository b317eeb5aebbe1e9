"""The slow reference for an encounter of two primaries: exact two-sphere mobilities, integrated by a library to tight tolerance.

Batchelor & Green 1972: two free spheres of radius 1 at r = r2 - r1 in a linear flow, gap xi = r - 2, central force F > 0
pushing them apart (units a, 1/g, 6 pi mu a^2 g),

    dr/dt = omega x r + E.r - [A nn + B (1 - nn)].E.r + G F n,     G = 2/(XA11 - XA12)
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from mcdem.hydrodynamics.two_sphere import tables as two_sphere
from mcdem.hydrodynamics.two_sphere import tensors as pair_tensors

NEAREST, FURTHEST = 1e-7, 60.0


@cache
def mobility_functions():
    """Splines in ln xi of (1 - A)(1 + xi)/xi, B and G (1 + xi)/xi: smooth from contact to infinity."""
    gaps = np.concatenate([np.geomspace(NEAREST, 1.0, 240), np.geomspace(1.0, FURTHEST, 120)[1:]])
    exact = two_sphere.exact(gaps)
    values = np.empty((len(gaps), 3))
    for k, gap in enumerate(gaps):
        resistance = pair_tensors.assemble(
            np.array([0, 0, 1.0]), {name: value[k] for name, value in exact.items()}
        )
        for column, (component, axis) in enumerate(
            [(1, 2), (3, 0)]
        ):  # uniaxial about z; in the plane of x and z
            strain = np.zeros(10)
            strain[[component, 5 + component]] = 1.0
            motion = np.linalg.solve(resistance[:12, :12], resistance[:12, 12:] @ strain)
            ambient = (2.0 + gap) * pair_tensors.STRAIN_BASIS[component][axis, 2]
            values[k, column] = -(motion[3 + axis] - motion[axis]) / ambient
    bounded = (1.0 + gaps) / gaps
    columns = [
        (1.0 - values[:, 0]) * bounded,
        values[:, 1],
        2.0 / (exact["XA11"] - exact["XA12"]) * bounded,
    ]
    return CubicSpline(np.log(gaps), np.column_stack(columns))


def relative_velocity(r, force):
    """dr/dt (3,) at separation r (3,)."""
    distance = np.sqrt(r @ r)
    gap = max(distance - 2.0, NEAREST)
    one_minus_a, b, g = mobility_functions()(np.log(gap))
    squeeze = gap / (1.0 + gap)
    n = r / distance
    strained = 0.5 * np.array([0.0, r[2], r[1]])
    along = n @ strained
    return (
        np.array([0.0, -0.5 * r[2], 0.5 * r[1]])
        + (one_minus_a * squeeze * along + g * squeeze * force(gap)) * n
        + (1.0 - b) * (strained - along * n)
    )


def trajectory(x0, y0, z0=-10.0, leave=10.0, duration=400.0, force=lambda gap: 0.0):
    """The solution of `solve_ivp`, ended at z = `leave` or when the spheres meet (`.met`)."""

    def meet(_, r):
        return r @ r - (2.0 + 10 * NEAREST) ** 2

    def pass_by(_, r):
        return r[2] - leave

    for event in (meet, pass_by):
        event.terminal = True  # type: ignore[attr-defined]  # what scipy looks for
    solution = solve_ivp(
        lambda _, r: relative_velocity(r, force),
        (0.0, duration),
        np.array([x0, y0, z0]),
        method="DOP853",
        rtol=1e-9,
        atol=1e-11,
        events=[meet, pass_by],
        dense_output=True,
    )
    solution.met = len(solution.t_events[0]) > 0
    return solution


def van_der_waals(scene):
    """gap [a] -> force [6 pi mu a^2 g] of the paper's Eq. 11, retarded as Schenkel & Kitchener (1960) did; written from them."""
    law, units = scene.effects.get("van_der_waals"), scene.reduced

    def force(gap):
        distance = gap * units.length + law.minimum_approach
        p = 2.0 * np.pi * distance / law.london_wavelength
        near = (1.0 + 3.54 * p) / (1.0 + 1.77 * p) ** 2
        retarded = near if p < 0.5709 else 0.98 / p - 0.434 / p**2 + 0.0674 / p**3
        return -law.hamaker_constant * units.length / (12.0 * distance**2) * retarded / units.force

    return force


# Uniaxial extension u = e (-x/2, -y/2, z), where trajectories lie in planes through the axis


def meets_in_extension(height: float, start: float, force) -> bool:
    """Whether two spheres meet whose streamline enters the sphere of contact, r = 2 a, at `height` [a] along the axis.

    start : distance [a] from which they are followed, on the undisturbed streamline r^3 sin^2 cos = const;  rate e = 1
    """
    cosine = 0.5 * height
    stream = 8.0 * cosine * (1.0 - cosine**2) / start**3
    from_axis = np.arccos(brentq(lambda c: c * (1.0 - c * c) - stream, 0.0, np.sqrt(1.0 / 3.0)))

    def velocity(_, place):
        distance, angle = place
        gap = max(distance - 2.0, NEAREST)
        one_minus_a, b, g = mobility_functions()(np.log(gap))
        squeeze = gap / (1.0 + gap)
        cosine = np.cos(angle)
        return [
            squeeze * (one_minus_a * distance * (1.5 * cosine**2 - 0.5) + g * force(gap)),
            -(1.0 - b) * 1.5 * np.sin(angle) * cosine,
        ]

    def meet(_, place):
        return place[0] - (2.0 + 10 * NEAREST)

    def part(_, place):
        # Past the cone on which the flow turns from inward to outward, and on the way out.
        return place[0] - 4.0 if np.cos(place[1]) ** 2 > 1.0 / 3.0 else -1.0

    for event in (meet, part):
        event.terminal = True  # type: ignore[attr-defined]  # what scipy looks for
    solution = solve_ivp(
        velocity,
        (0.0, 200.0),
        [start, from_axis],
        method="DOP853",
        rtol=1e-9,
        atol=1e-11,
        events=[meet, part],
    )
    return len(solution.t_events[0]) > 0


def extension_efficiency(force, start: float, tolerance: float = 2e-5) -> float:
    """Share of what flows into the sphere of contact that meets, by bisection of the height to `tolerance` [a]."""
    low, high = 0.0, 2.0 / np.sqrt(3.0)
    while high - low > tolerance:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if meets_in_extension(middle, start, force) else (low, middle)
    return inflow_below(0.5 * (low + high))


def inflow_below(height: float) -> float:
    """Share of the inflow of extension through r = 2 a that enters at less than `height` [a] from the plane z = 0."""
    cosine = 0.5 * height
    return float(1.5 * np.sqrt(3.0) * cosine * (1.0 - cosine**2))


def hamaker(attraction: float):
    """gap [a] -> force [6 pi mu a^2 e] of the unretarded attraction of two spheres (Hamaker 1937), by its C_A."""

    def force(gap):
        s = gap + 2.0
        q = s * s - 4.0
        return -attraction * (4.0 * s / q**2 + 4.0 / s**3 - 2.0 * s / q + 2.0 / s)

    return force
