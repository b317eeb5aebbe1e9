"""Where encounters come from, in any of the steady linear flows u = G r that a scene may have.

Aggregate i rests at the origin, where the flow stagnates.  Another one meets it by crossing the sphere of radius R_i + R_j about
it: where, is drawn by the flux of the undisturbed flow into that sphere, and from there it is traced upstream.  The rate is

    K g (R_i + R_j)^3,   K = integral over the unit sphere of max(-n.G n, 0),

which takes the strain alone: 4/3 in simple shear (Smoluchowski 1917; Frungieri & Vanni 2021, Eq. 2), and

    planar, u = g (0, alpha z, y)                4/3 (1 + alpha): a strain of (1 + alpha)/2 of that of u = g (0, z, y)
    uniaxial extension, u = g (-x/2, -y/2, z)    4 pi/(3 sqrt(3)): what flows in between the cones of cos^2 = 1/3
    biaxial extension, the reverse               the same: as much flows out as in
    linear, any G                                over one angle in closed form, over the other by quadrature

That every point of entry has one point upstream, from which the streamline comes without turning back, needs r^2 to be convex
in time along streamlines: with the strain E and the vorticity W of G = E + W, that d^2(r^2)/dt^2 = 2 r.(2 E^2 + EW - WE) r is
nowhere below zero (`turns_back`).  It holds for every strain without vorticity, and for simple shear with equality somewhere;
with more vorticity there are streamlines that circle, on which no encounter has a beginning.

In simple shear the point of entry (x, y) has the density of the paper's Fig. 3, g y inside the half circle, since the flow is
along z; the point upstream has the same (x, y).  An `offset` is two lengths that say where j enters, the rest by symmetry:

    planar flows    (x, y): along vorticity and gradient;  z of the opposite sign to y
    uniaxial        (0, z): the height along the axis of stretching, |z| < (R_i + R_j)/sqrt(3)
    biaxial         (0, y): the distance from the axis of compression, y < (R_i + R_j) sqrt(2/3)
    linear          (z, s): the height along z, |z| < R_i + R_j, and the arc (R_i + R_j) times the azimuth from x to y
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
import scipy
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from mcdem.errors import UserError
from mcdem.quantities.toml_tables import FROM_THE_OTHERS, Table, quantity_at
from mcdem.quantities.units import DIMENSIONLESS, RATE, STRESS, VISCOSITY

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

LONGEST = 1e4
"""Strain after which a streamline is no longer followed."""


_ENTRY = DIMENSIONLESS.between("-1e6", "1e6")


class Flow(Table):
    """The undisturbed flow: simple shear u = (0, 0, g y), with gradient along y and vorticity along x, or another linear flow.

    The file gives exactly two of `shear_rate`, `viscosity` and `shear_stress`; the third follows.

    Examples
    --------
    >>> import mcdem
    >>> flow = mcdem.load_scene("scenes/paper-1000Pa.toml").flow
    >>> flow.kind, flow.shear_rate, flow.viscosity, flow.shear_stress
    ('simple_shear', 10000.0, 0.1, 1000.0)
    """

    kind: Literal[
        "simple_shear", "planar", "planar_extension", "uniaxial_extension", "biaxial_extension", "linear"
    ] = "simple_shear"
    """"simple_shear": u = g (0, 0, y); "planar": u = g (0, alpha z, y); "planar_extension": the same with alpha = 1;
    "uniaxial_extension": u = g (-x/2, -y/2, z), stretching along z; "biaxial_extension": the reverse;
    "linear": any other, by its `gradient`."""
    alpha: Annotated[float, DIMENSIONLESS.positive.between("1e-12", "1")] | None = None
    """Share of extension in a planar flow, between simple shear (0) and planar extension (1); its kind alone has it."""
    gradient: (
        Annotated[
            tuple[Annotated[tuple[Annotated[float, _ENTRY], ...], Field(strict=False)], ...],
            Field(strict=False),
        ]
        | None
    ) = None
    """Rows of the velocity gradient over g of a linear flow, u = g G r: three of three numbers, of trace 0; such as
    [[-0.7, 0, 0], [0, -0.3, 0], [0, 0, 1]], between planar and uniaxial extension."""
    shear_rate: Annotated[float, RATE.positive.between("1e-9 1/s", "1e12 1/s")] = FROM_THE_OTHERS
    """Rate g of the flow: the shear rate, or in extension the rate of stretching."""
    viscosity: Annotated[float, VISCOSITY.positive.between("1e-9 Pa s", "1e9 Pa s")] = FROM_THE_OTHERS
    """Viscosity mu of the medium."""
    shear_stress: Annotated[float, STRESS.positive.between("1e-12 Pa", "1e12 Pa")] = FROM_THE_OTHERS
    """Shear stress mu g of the undisturbed flow."""

    @property
    def extension_share(self) -> float:
        """alpha of a planar flow."""
        if self.alpha is not None:
            return self.alpha
        return 1.0 if self.kind == "planar_extension" else 0.0

    @property
    def equivalent_shear_rate(self) -> float:
        """Shear rate [1/s] of the simple shear in which aggregates meet as often."""
        return self.shear_rate * (0.75 * inflow_constant(self))

    @model_validator(mode="after")
    def _alpha_is_of_planar_flows(self) -> Self:
        if self.kind == "planar" and self.alpha is None:
            raise ValueError('kind = "planar" needs alpha, its share of extension: above 0 and up to 1')
        if self.kind != "planar" and self.alpha is not None:
            raise ValueError(f'kind = "{self.kind}" has no alpha: remove it, or use kind = "planar"')
        return self

    @model_validator(mode="after")
    def _gradient_is_of_linear_flows(self) -> Self:
        if (self.kind == "linear") != (self.gradient is not None):
            raise ValueError(
                'kind = "linear" and gradient go together: give both, or another kind and no gradient'
            )
        if self.gradient is None:
            return self
        if [len(row) for row in self.gradient] != [3, 3, 3]:
            raise ValueError("gradient: expected three rows of three numbers")
        G = np.array(self.gradient)
        size = float(np.abs(G).max())
        if size < 1e-6:
            raise ValueError(
                f"gradient has entries of at most {size:g}, expected some of order 1: it is the velocity gradient over the rate"
            )
        if abs(np.trace(G)) > 1e-9 * size:
            raise ValueError(
                f"gradient has the trace {np.trace(G):g}, expected 0: the fluid keeps its volume"
            )
        if not np.abs(G + G.T).max() > 1e-9 * size:
            raise ValueError(
                "gradient is a rotation alone, expected one that strains: nothing meets otherwise"
            )
        if turns_back(G):
            raise ValueError(
                "gradient has streamlines that turn back, more vorticity than simple shear has for its strain: expected one in "
                "which every streamline comes from far away, for an encounter to have a beginning"
            )
        return self

    @model_validator(mode="after")
    def _two_give_the_third(self) -> Self:
        given = self.model_fields_set & {"shear_rate", "viscosity", "shear_stress"}
        if len(given) != 2:
            found = " and ".join(sorted(given)) or "none"
            raise ValueError(f"give exactly two of shear_rate, viscosity and shear_stress (found {found})")
        if "shear_stress" not in given:
            self.__dict__["shear_stress"] = self.viscosity * self.shear_rate
        elif "viscosity" not in given:
            self.__dict__["viscosity"] = self.shear_stress / self.shear_rate
        else:
            self.__dict__["shear_rate"] = self.shear_stress / self.viscosity
        third = next(iter({"shear_rate", "viscosity", "shear_stress"} - given))
        quantity = quantity_at(Flow, (third,))
        assert quantity is not None
        try:
            quantity.to_si(getattr(self, third))
        except PydanticCustomError as problem:
            raise ValueError(
                f"{third} = {getattr(self, third):g} {quantity.si}, which follows from the two given, {problem.message()}"
            ) from None
        return self


def gradient(flow: Flow) -> NDArray[np.float64]:
    """G/g (3, 3), u_inf = G r."""
    if flow.gradient is not None:
        return np.array(flow.gradient)
    if flow.kind == "uniaxial_extension":
        return np.diag([-0.5, -0.5, 1.0])
    if flow.kind == "biaxial_extension":
        return np.diag([0.5, 0.5, -1.0])
    return np.array([[0.0, 0.0, 0.0], [0.0, 0.0, flow.extension_share], [0.0, 1.0, 0.0]])


def inflow_constant(flow: Flow) -> float:
    """K of the rate K g (R_i + R_j)^3."""
    if flow.gradient is not None:
        return _inflow_of_gradient(flow.gradient)
    if flow.kind in ("uniaxial_extension", "biaxial_extension"):
        return 4.0 * math.pi / (3.0 * math.sqrt(3.0))
    return 4.0 / 3.0 * (1.0 + flow.extension_share)


@lru_cache(maxsize=32)
def _inflow_of_gradient(gradient: tuple[tuple[float, ...], ...]) -> float:
    G = np.array(gradient)
    return inflow_of(np.linalg.eigvalsh(0.5 * (G + G.T)))


def inflow_of(strains: NDArray[np.float64]) -> float:
    """K of the principal rates of strain (3,): the integral over the unit sphere of max(-n.E n, 0).

    At the height c = cos(theta) along the last axis n.E n = A + B cos(2 phi), whose negative part has a closed integral.
    """
    first, second, third = (float(e) for e in strains)

    def over_azimuth(c: float) -> float:
        mean = 0.5 * (first + second) * (1.0 - c * c) + third * c * c
        swing = abs(0.5 * (first - second) * (1.0 - c * c))
        if abs(mean) >= swing:
            return max(-2.0 * math.pi * mean, 0.0)
        from_there = math.acos(-mean / swing)
        return 2.0 * swing * math.sin(from_there) - 2.0 * mean * (math.pi - from_there)

    # n.E n changes its sign at these heights along the two meridians of the other axes.
    kinks = [math.sqrt(e / (e - third)) for e in (first, second) if e * third < 0.0]
    value, _ = scipy.integrate.quad(
        over_azimuth, 0.0, 1.0, points=sorted(kinks) or None, epsabs=1e-12, limit=200
    )
    return 2.0 * value


def turns_back(G: NDArray[np.float64]) -> bool:
    """Whether r^2 is not convex along some streamline of u = G r, so that it may come back (see above)."""
    E, W = 0.5 * (G + G.T), 0.5 * (G - G.T)
    return bool(np.linalg.eigvalsh(2.0 * E @ E + E @ W - W @ E)[0] < -1e-9 * np.abs(G).max() ** 2)


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
    if flow.gradient is not None:
        return z, float(np.linalg.norm(entry)) * math.atan2(y, x)
    if flow.kind == "uniaxial_extension":
        return 0.0, z
    if flow.kind == "biaxial_extension":
        return 0.0, math.hypot(x, y)
    return x, abs(y)


def entry_of(flow: Flow, reach: float, offset: tuple[float, float]) -> NDArray[np.float64]:
    """Point (3,) [m] at which j enters the sphere of radius `reach`; raises `UserError` where nothing flows in."""
    x, y = offset
    if flow.gradient is not None:
        return entry_of_linear(flow.gradient, reach, offset)
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


def entry_of_linear(
    gradient: tuple[tuple[float, ...], ...], reach: float, offset: tuple[float, float]
) -> NDArray[np.float64]:
    """`entry_of` in a flow of given gradient."""
    z, arc = offset
    across = math.sqrt(max(reach * reach - z * z, 0.0))
    entry = np.array([across * math.cos(arc / reach), across * math.sin(arc / reach), z])
    if not (abs(z) < reach and abs(arc) <= math.pi * reach * (1.0 + 1e-12)):
        raise UserError(
            f"offset: ({z:g}, {arc:g}) m, expected a height below {reach:.4g} m and an arc of at most {math.pi * reach:.4g} m"
        )
    if not float(entry @ np.array(gradient) @ entry) < 0.0:
        raise UserError(
            f"offset: ({z:g}, {arc:g}) m, expected a place on the sphere of radius {reach:.4g} m where fluid flows in: elsewhere "
            "j cannot meet i"
        )
    return entry


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
        return np.asarray(scipy.linalg.expm(strain * G) @ scaled)

    def beyond(strain: float) -> float:
        return float(np.linalg.norm(position(-strain))) - distance / size

    def receding(strain: float) -> float:
        r = position(strain)
        return float(r @ G @ r)

    ends = [_bracket(beyond), _bracket(receding)]
    if beyond(ends[0]) < 0.0 or receding(ends[1]) < 0.0:
        return size * position(-ends[0]), math.inf
    started = scipy.optimize.brentq(beyond, 0.0, ends[0], xtol=1e-12)
    nearest = scipy.optimize.brentq(receding, 0.0, ends[1], xtol=1e-12) if receding(0.0) < 0.0 else 0.0
    return size * position(-started), float(started + nearest)


def _bracket(function: Callable[[float], float]) -> float:
    """A strain at which a function that begins below 0 is above."""
    strain = 1.0
    while function(strain) < 0.0 and strain < LONGEST:
        strain *= 2.0
    return strain
