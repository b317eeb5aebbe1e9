"""Where encounters come from, in any of the steady linear flows u = G r that a scene may have.

Aggregate i rests at the origin, where the flow stagnates.  Another one meets it by crossing the sphere of radius R_i + R_j about
it: where, is drawn by the flux of the undisturbed flow into that sphere, and from there it is traced upstream.  The rate is

    K g (R_i + R_j)^3,   K = integral over the unit sphere of max(-n.G n, 0),

which takes the strain alone: 4/3 in simple shear (Smoluchowski 1917; Frungieri & Vanni 2021, Eq. 2), and

    planar, u = g (0, alpha z, y)                4/3 (1 + alpha): a strain of (1 + alpha)/2 of that of u = g (0, z, y)
    uniaxial extension, u = g (-x/2, -y/2, z)    4 pi/(3 sqrt(3)): what flows in between the cones of cos^2 = 1/3
    biaxial extension, the reverse               the same: as much flows out as in

In simple shear the point of entry (x, y) has the density of the paper's Fig. 3, g y inside the half circle, since the flow is
along z; the point upstream has the same (x, y).  An `offset` is two lengths that say where j enters, the rest by symmetry:

    planar flows    (x, y): along vorticity and gradient;  z of the opposite sign to y
    uniaxial        (0, z): the height along the axis of stretching, |z| < (R_i + R_j)/sqrt(3)
    biaxial         (0, y): the distance from the axis of compression, y < (R_i + R_j) sqrt(2/3)
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from mcdem.errors import UserError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mcdem.scene import Flow

LONGEST = 1e4
"""Strain after which a streamline is no longer followed."""


def gradient(flow: Flow) -> NDArray[np.float64]:
    """G/g (3, 3), u_inf = G r."""
    if flow.kind == "uniaxial_extension":
        return np.diag([-0.5, -0.5, 1.0])
    if flow.kind == "biaxial_extension":
        return np.diag([0.5, 0.5, -1.0])
    return np.array([[0.0, 0.0, 0.0], [0.0, 0.0, flow.extension_share], [0.0, 1.0, 0.0]])


def inflow_constant(flow: Flow) -> float:
    """K of the rate K g (R_i + R_j)^3."""
    if flow.kind in ("uniaxial_extension", "biaxial_extension"):
        return 4.0 * math.pi / (3.0 * math.sqrt(3.0))
    return 4.0 / 3.0 * (1.0 + flow.extension_share)


def draw_offset(flow: Flow, reach: float, rng: np.random.Generator) -> tuple[float, float]:
    """The offset of an encounter, by the flux into the sphere of radius `reach` [m]."""
    if flow.kind == "simple_shear":
        # By symmetry y > 0; the density of x is uniform and that of y linear, inside the circle (paper, Fig. 3).
        while True:
            x = reach * (2.0 * rng.random() - 1.0)
            y = reach * math.sqrt(rng.random())
            if x * x + y * y <= reach * reach and y > 0.0:
                return x, y
    return offset_of(flow, reach * draw_direction(gradient(flow), rng))


def draw_direction(G: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A point (3,) of the unit sphere, by the flux of u = G r into it."""
    strongest = -float(np.linalg.eigvalsh(0.5 * (G + G.T))[0])
    while True:
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        if rng.random() * strongest < -float(n @ G @ n):
            return n


def offset_of(flow: Flow, entry: NDArray[np.float64]) -> tuple[float, float]:
    """The offset of a point of entry (3,), up to the symmetries of the flow."""
    x, y, z = (float(c) for c in entry)
    if flow.kind == "uniaxial_extension":
        return 0.0, z
    if flow.kind == "biaxial_extension":
        return 0.0, math.hypot(x, y)
    return x, abs(y)


def entry_of(flow: Flow, reach: float, offset: tuple[float, float]) -> NDArray[np.float64]:
    """Point (3,) [m] at which j enters the sphere of radius `reach`; raises `UserError` where nothing flows in."""
    x, y = offset
    if flow.kind in ("uniaxial_extension", "biaxial_extension"):
        uniaxial = flow.kind == "uniaxial_extension"
        bound = reach * (math.sqrt(1.0 / 3.0) if uniaxial else math.sqrt(2.0 / 3.0))
        if x != 0.0 or not abs(y) < bound:
            what = "height along" if uniaxial else "distance from"
            raise UserError(
                f"offset: ({x:g}, {y:g}) m, expected (0, {what} the axis below {bound:.4g} m): elsewhere j cannot meet i"
            )
        rest = -math.sqrt(reach * reach - y * y)
        return np.array([0.0, rest, y]) if uniaxial else np.array([0.0, y, rest])
    if not x * x + y * y < reach * reach or y == 0.0:
        raise UserError(
            f"offset: ({x:g}, {y:g}) m, expected within the circle of radius {reach:.4g} m and y0 not 0: elsewhere j cannot "
            "meet i"
        )
    return np.array([x, y, -math.copysign(math.sqrt(reach * reach - x * x - y * y), y)])


def upstream(
    G: NDArray[np.float64], entry: NDArray[np.float64], distance: float
) -> tuple[NDArray[np.float64], float]:
    """Where the streamline through `entry` (3,) was at `distance` from the origin, and the strain from there to its nearest.

    Along a streamline of these flows r^2 is convex in time: there is one such point upstream, and one nearest point.  A
    streamline that does not reach it within LONGEST, next to a plane of stagnant fluid, is given where it was then, and inf.
    """
    size = float(np.linalg.norm(entry))
    scaled = entry / size

    def position(strain: float) -> NDArray[np.float64]:
        return np.asarray(expm(strain * G) @ scaled)

    def beyond(strain: float) -> float:
        return float(np.linalg.norm(position(-strain))) - distance / size

    def receding(strain: float) -> float:
        r = position(strain)
        return float(r @ G @ r)

    ends = [_bracket(beyond), _bracket(receding)]
    if beyond(ends[0]) < 0.0 or receding(ends[1]) < 0.0:
        return size * position(-ends[0]), math.inf
    started = brentq(beyond, 0.0, ends[0], xtol=1e-12)
    nearest = brentq(receding, 0.0, ends[1], xtol=1e-12) if receding(0.0) < 0.0 else 0.0
    return size * position(-started), float(started + nearest)


def _bracket(function) -> float:
    """A strain at which a function that begins below 0 is above."""
    strain = 1.0
    while function(strain) < 0.0 and strain < LONGEST:
        strain *= 2.0
    return strain
