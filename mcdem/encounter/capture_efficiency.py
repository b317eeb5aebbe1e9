"""Capture of one primary by another: which offsets end in a doublet, and the efficiency eta_11 of their encounters.

Two primaries without internal state have one outcome for each offset (x0, y0), so the efficiency is an integral and needs no
sampling.  The captured part of the circle of radius 2a is bounded by the distance s from its centre, a smooth function of the
angle theta from the vorticity axis.  Its flux g y0 dx0 dy0, over that of the whole circle (Smoluchowski 1917), is

    eta_11 = integral over c in (0, 1) of (s(c)/2a)^3 dc,   c = cos theta,

which is the integral of y_c^2/2 over x0, y_c(x0) being the critical offset, divided by its value (2a)^3/3 for the circle.

Offsets near y0 = 0 need care.  From a start z0 upstream, those below y0 = (4/3) a (a/z0)^(3/2) (0.042 a at 10 a) lie in the zone
of closed orbits (Batchelor & Green 1972, eq. 5.3 with the far-field B = (16/3)(a/r)^5).  A pair that passes may lose so much of
its offset to the attraction that it enters this zone, turns back and is caught later, if the simulated time allows: without a
cut-off at 750 Pa these later captures are 2 % of all.  Where they end the boundary has a kink, which is what the quadrature error
is made of.  Below y0 = z0/longest_approach encounters are not followed: they are taken to end as those just above, and all
their flux is an error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mcdem.aggregates.aggregate import Aggregate
from mcdem.arguments import scene_at_door, whole_number
from mcdem.encounter.simulate import simulate_encounter
from mcdem.errors import UserError
from mcdem.quantities.units import LENGTH, si

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mcdem.scene import Scene

RAYS = 16
"""Directions in the quarter circle along which the boundary is sought."""
TOLERANCE = 2e-5
"""Distance, in primary radii, to which a boundary is known."""
SCANNED = 13
"""Offsets tried along a line before its boundaries are bracketed; captured stretches shorter than 2a over this can be missed."""


@dataclass(frozen=True, eq=False)
class PairEfficiency:
    """eta_11 of a scene and what it is made of.

    efficiency : captured flux over the flux through the circle of radius 2a, at half the step of the scene
    error : sum of the magnitudes below
    quadrature_error : change from half as many rays
    step_error : twice the change on halving the step, twice what is left if convergence were of first order
    bisection_error : width of the brackets
    unresolved_error : flux of the offsets whose approach is longer than `numerics.longest_approach`
    angles : (rays,) [rad] from the vorticity axis;  distances : (rays,) [m] from the centre to the boundary of capture
    encounters : how many were followed

    Examples
    --------
    >>> import mcdem
    >>> found = mcdem.pair_efficiency(mcdem.load_scene("scenes/paper-1000Pa.toml"), rays=2)
    >>> found.distances.shape, bool(found.error < found.efficiency)
    ((2,), True)
    """

    efficiency: float
    error: float
    quadrature_error: float
    step_error: float
    bisection_error: float
    unresolved_error: float
    angles: NDArray[np.float64]
    distances: NDArray[np.float64]
    encounters: int


def pair_efficiency(
    scene: Scene, rays: int = RAYS, progress: Callable[[str, float], None] = lambda state, share: None
) -> PairEfficiency:
    """eta_11 of two primaries of the scene, with its numerical error.

    Parameters
    ----------
    scene : Scene
        What is sheared; one radius.
    rays : int
        Even number of directions in the quarter circle.
    progress : callable
        Called with where it stands, in words, and the share done.

    Returns
    -------
    PairEfficiency
        eta_11 with its numerical error, both without a unit.

    Raises
    ------
    UserError
        Of a scene in which nothing can stick.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> found = mcdem.pair_efficiency(scene, rays=2)
    >>> f"eta_11 = {found.efficiency:.3f}"
    'eta_11 = 0.073'
    """
    scene_at_door(scene)
    if whole_number("rays", rays, 2, 1000) % 2:
        raise UserError(f"rays = {rays}: expected an even number, at least 2")
    angles, weights = fejer(rays)

    def report(encounters: int) -> None:
        # A ray is scanned and its one boundary bisected, then followed with half the step.
        progress(f"{encounters} encounters", min(encounters / (rays * (SCANNED + 30.0)), 1.0))

    capture = Capture(scene, report)
    segments, by_ray = capture.along(angles)
    at_step = float(weights @ by_ray)
    # Every second ray is a node of the rule with half as many.
    _, coarse = fejer(rays // 2)
    quadrature = abs(float(coarse @ by_ray[1::2]) - at_step)

    finer = Capture(_half_step(scene), lambda encounters: report(capture.encounters + encounters))
    moved = np.array(
        [
            sum(
                finer.follow(ray_at(angle), out) ** 3 - finer.follow(ray_at(angle), into) ** 3
                for into, out in found
            )
            for angle, found in zip(angles, segments)
        ]
    )
    efficiency = float(weights @ moved) / 8.0
    steps = 2.0 * abs(efficiency - at_step)
    edges = [sum(out**2 + into**2 for into, out in found) for found in segments]
    bisection = float(weights @ edges) * 3.0 / 8.0 * 0.5 * TOLERANCE
    # Flux g y dx dy of the strip over that of the quarter circle, 8/3.
    unresolved = 2.0 * capture.lowest_y**2 / 2.0 * 3.0 / 8.0
    return PairEfficiency(
        efficiency=efficiency,
        error=quadrature + steps + bisection + unresolved,
        quadrature_error=quadrature,
        step_error=steps,
        bisection_error=bisection,
        unresolved_error=unresolved,
        angles=angles,
        distances=np.array([max((out for _, out in found), default=0.0) for found in segments])
        * scene.suspension.radius,
        encounters=capture.encounters + finer.encounters,
    )


def critical_offset(scene: Scene, x0: float | str) -> float:
    """Critical offset y_c [m] at x0, a number in m or with a unit: the largest y0 at which two primaries end as a doublet.

    0 if there is none.

    Found by bisection to 2e-5 a.  Raises `UserError` for x0 outside the circle of radius 2a.

    Parameters
    ----------
    scene : Scene
        What is sheared.
    x0 : float or str
        Offset along the vorticity, a number in m or with a unit.

    Returns
    -------
    float
        y_c [m].

    Raises
    ------
    UserError
        Of x0 outside the circle of radius 2a.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> f"{mcdem.critical_offset(scene, '0.1 um') / scene.suspension.radius:.3f} radii"
    '0.808 radii'
    """
    scene_at_door(scene)
    radius = scene.suspension.radius
    place = si("x0", x0, LENGTH)
    across = place / radius
    if not abs(across) < 2.0:
        raise UserError(f"x0 = {place:g} m: expected a length below 2a = {2.0 * radius:g} m")
    capture = Capture(scene)
    line = lambda y: (across, y)
    found = capture.segments(line, capture.lowest_y, math.sqrt(4.0 - across**2))
    return radius * max((out for _, out in found), default=0.0)


def van_de_ven_mason(scene: Scene, factor: float = 0.95) -> float:
    """eta_11 = f (A_H/36 pi mu g a^3)^0.18 (van de Ven & Mason 1977; Frungieri & Vanni 2021, Eq. 23).

    nan without attraction, and for primaries of several radii.  `factor` f is 0.95 for a London wavelength of 0.2 a.

    Parameters
    ----------
    scene : Scene
        With a van der Waals attraction; of its flow the shear stress counts.
    factor : float
        f [-], 0.95 for a London wavelength of 0.2 a.

    Returns
    -------
    float
        eta_11 [-].

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.encounter import van_de_ven_mason
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> round(van_de_ven_mason(scene), 4)
    0.0738
    """
    attraction = attraction_number(scene)
    holds = attraction > 0.0 and scene.suspension.radii is None
    return factor * attraction**0.18 if holds else math.nan


def attraction_number(scene: Scene) -> float:
    """C_A = A_H/(36 pi mu g a^3), van der Waals attraction over the pull of the flow; 0 without attraction.

    Parameters
    ----------
    scene : Scene
        With a van der Waals attraction, or without.

    Returns
    -------
    float
        C_A [-].

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.encounter import attraction_number
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> f"{attraction_number(scene):.2e}"
    '6.86e-07'
    """
    attraction = scene.effects.attraction
    if attraction is None:
        return 0.0
    return float(attraction.number(scene.flow.shear_stress, scene.suspension.radius))


def initial_growth(scene: Scene, efficiency: float) -> float:
    """d<P>/dt [1/s] of a suspension of primaries, (4/pi) eta_11 phi g (Frungieri & Vanni 2021, Eq. 22).

    Parameters
    ----------
    scene : Scene
        Of which the volume fraction and the shear rate count.
    efficiency : float
        eta_11 [-].

    Returns
    -------
    float
        Growth of the mean number of primaries [1/s].

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.encounter import initial_growth
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> round(initial_growth(scene, 0.0730), 4)
    0.0929
    """
    return 4.0 / math.pi * efficiency * scene.suspension.volume_fraction * scene.flow.equivalent_shear_rate


Line = Callable[[float], tuple[float, float]]
"""Offset (x0, y0) in primary radii at a distance along a line through the circle."""


class Capture:
    """Which offsets end in a doublet.  Lengths in primary radii."""

    def __init__(self, scene: Scene, progress: Callable[[int], None] = lambda encounters: None):
        if scene.flow.kind != "simple_shear":
            raise UserError(
                f"{scene.name}: eta_11 is an integral over the offsets of simple shear, the scene has flow.kind = "
                f'"{scene.flow.kind}": count the outcomes of drawn encounters instead (mcdem run)'
            )
        scene.require_one_radius(
            "eta_11 is that of two equal primaries; count the outcomes of drawn encounters instead (mcdem run)"
        )
        if scene.effects.contact is None:
            raise UserError(
                f"{scene.name}: no law of contact, so nothing sticks and eta_11 has no meaning: add "
                f"{' or '.join(f'[effects.{law}]' for law in scene.effects.contact_laws)}"
            )
        self.scene = scene
        self.monomer = Aggregate.monomer()
        self.encounters = 0
        self._progress = progress
        # A little above the bound, so that rounding does not decide.
        self.lowest_y = 1.001 * 2.0 * scene.numerics.start_distance / scene.numerics.longest_approach

    def lowest(self, angle: float) -> float:
        """Distance from the centre below which an offset at `angle` is not followed."""
        return self.lowest_y / math.sin(angle)

    def captured(self, offset: tuple[float, float]) -> bool:
        """Whether the encounter at `offset` ends as a doublet."""
        radius = self.scene.suspension.radius
        self.encounters += 1
        self._progress(self.encounters)
        result = simulate_encounter(
            self.scene,
            self.monomer,
            self.monomer,
            (radius * offset[0], radius * offset[1]),
            seed=0,
            orient=False,
        )
        if result.outcome == "unresolved":
            raise UserError(
                f"the encounter of two primaries at offset x0 = {offset[0]:g} a, y0 = {offset[1]:g} a could not be "
                f"followed: {result.reason}"
            )
        return result.outcome == "aggregation"

    def along(
        self, angles: NDArray[np.float64]
    ) -> tuple[list[list[tuple[float, float]]], NDArray[np.float64]]:
        """Captured stretches of the rays at `angles` (K,), and the share of the flux through each that is captured, (K,)."""
        segments = [self.segments(ray_at(angle), self.lowest(angle)) for angle in angles]
        share = np.array([sum(out**3 - into**3 for into, out in found) for found in segments]) / 8.0
        return segments, share

    def segments(self, line: Line, lowest: float, highest: float = 2.0) -> list[tuple[float, float]]:
        """Captured stretches of a line between the distances `lowest` and `highest`; the first may reach to 0."""
        places = np.linspace(lowest, highest, SCANNED)
        hits = [self.captured(line(place)) for place in places[:-1]]
        # The last place is on the circle, where spheres on straight paths would just touch.
        hits.append(False)
        edges = [0.0] if hits[0] else []
        for k in range(SCANNED - 1):
            if hits[k] != hits[k + 1]:
                edges.append(self.bisect(line, places[k], places[k + 1], hits[k]))
        return list(zip(edges[::2], edges[1::2]))

    def bisect(self, line: Line, low: float, high: float, hit_low: bool) -> float:
        """The boundary between two places of which one is captured."""
        while high - low > TOLERANCE:
            middle = 0.5 * (low + high)
            if self.captured(line(middle)) == hit_low:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)

    def follow(self, line: Line, place: float) -> float:
        """A boundary that was at `place` under other numerics."""
        if place == 0.0:
            return 0.0
        width = 2e-3
        while True:
            low, high = max(place - width, 1e-3 * place), place + width
            hit_low = self.captured(line(low))
            if hit_low != self.captured(line(high)):
                return self.bisect(line, low, high, hit_low)
            if width > 0.5:
                raise ArithmeticError("the boundary of capture does not converge with the step")
            width *= 4.0


def ray_at(angle: float) -> Line:
    """The line from the centre of the circle at `angle` [rad] from the vorticity axis."""
    return lambda distance: (distance * math.cos(angle), distance * math.sin(angle))


def _half_step(scene: Scene) -> Scene:
    numerics = scene.numerics
    return scene.model_copy(update={"numerics": numerics.with_step(0.5 * numerics.step)})


def fejer(rays: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angles and weights of Fejer's second rule for an even function of cos(angle), on (0, 1); nested on doubling `rays`."""
    intervals = 2 * rays
    k = np.arange(1, rays + 1)
    angles = k * math.pi / intervals
    odd = 2 * np.arange(1, rays + 1) - 1
    weights = 4.0 * np.sin(angles) / intervals * (np.sin(np.outer(angles, odd)) / odd).sum(axis=1)
    weights[-1] *= 0.5  # the ray along the gradient is its own mirror image
    return angles, weights
