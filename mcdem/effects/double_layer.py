"""Electric double-layer repulsion of two spheres of equal surface potential.

Source: Hogg, Healy & Fuerstenau (1966), Trans. Faraday Soc. 62, 1638: the linear Poisson-Boltzmann equation between plates,
carried to spheres by Derjaguin's approximation; constant charge after Wiese & Healy (1970).  With x = exp(-kappa h),

    F = 2 pi eps psi^2 a_eff kappa x/(1 + x)   at constant potential,
    F = 2 pi eps psi^2 a_eff kappa x/(1 - x)   at constant charge.

Valid (M) for kappa a >> 1, here >= 10, and for surface potentials low against kT/e = 25.7 mV; the authors find it good to
60 mV.  At constant charge F diverges as 1/h: charges are kept `minimum_approach` apart at contact (C).

Limiting test: the exact linear Poisson-Boltzmann solution for two spheres, which it approaches as 1/(kappa a).  At kappa a = 20
and kappa h = 0.3, 1, 3 it is off by -0.6, -0.1, 5 % (constant potential) and by 22, 7, 6 % (constant charge).
"""

from __future__ import annotations

from math import exp, pi, sqrt
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from mcdem.compilation import compiled
from mcdem.effects.kinds import Companions, EffectTable, PairForce
from mcdem.errors import SceneError
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.toml_tables import FROM_THE_OTHERS
from mcdem.quantities.units import CONCENTRATION, DIMENSIONLESS, LENGTH, POTENTIAL, TEMPERATURE

VACUUM_PERMITTIVITY = 8.8541878128e-12  # [F/m], CODATA 2018
LARGEST_POTENTIAL = 0.060  # [V], Hogg, Healy & Fuerstenau (1966)
SMALLEST_KAPPA_A = 10.0
BOLTZMANN = 1.380649e-23  # [J/K]
ELEMENTARY_CHARGE = 1.602176634e-19  # [C]
AVOGADRO = 6.02214076e23  # [1/mol]

_POTENTIAL = POTENTIAL.between("-1 V", "1 V")


class DoubleLayer(EffectTable):
    """Electric double-layer repulsion in the linear Poisson-Boltzmann approximation."""

    title: ClassVar[str] = "double layer"

    instead_of_each_other: ClassVar[tuple[tuple[frozenset[str], ...], ...]] = (
        (frozenset({"debye_length"}), frozenset({"salt_concentration", "temperature"})),
        (frozenset({"surface_potential"}), frozenset({"zeta_potential"})),
    )

    surface_potential: Annotated[float, _POTENTIAL] = FROM_THE_OTHERS
    """Potential psi of an isolated surface, at most 60 mV either way; or its zeta_potential."""
    zeta_potential: Annotated[float, _POTENTIAL] | None = None
    """Measured zeta potential, taken as the surface potential in its stead."""
    debye_length: Annotated[float, LENGTH.positive.between("1 pm", "1 mm", '"10 nm"')] = FROM_THE_OTHERS
    """Thickness 1/kappa of the double layer, at most a tenth of the (smallest) primary radius; or the salt that sets it."""
    salt_concentration: Annotated[float, CONCENTRATION.positive.between("1e-12 M", "10 M")] | None = None
    """Concentration of a 1:1 salt, or the ionic strength of another: with `temperature` instead of debye_length."""
    temperature: Annotated[float, TEMPERATURE.positive.between("1 K", "5000 K")] | None = None
    """Absolute temperature, where the debye_length follows from the salt."""
    relative_permittivity: Annotated[float, DIMENSIONLESS.positive.between("1", "1e4", "78.5")]
    """Permittivity of the medium over that of vacuum."""
    condition: Literal["constant_potential", "constant_charge"]
    """What surfaces keep while they approach."""
    minimum_approach: Annotated[float, LENGTH.positive.between("1e-15 m", "1 mm", '"0.165 nm"')] | None = None
    """Distance of the planes of charge at contact; for constant charge only, which would be singular without it."""

    @model_validator(mode="after")
    def _one_potential_and_one_thickness(self) -> Self:
        given = self.model_fields_set
        potentials = given & {"surface_potential", "zeta_potential"}
        if len(potentials) != 1:
            raise ValueError(
                'give surface_potential, such as "-25 mV", or zeta_potential '
                f"(found {' and '.join(sorted(potentials)) or 'neither'})"
            )
        if self.zeta_potential is not None:
            self.__dict__["surface_potential"] = self.zeta_potential
        thickness = given & {"debye_length", "salt_concentration", "temperature"}
        if thickness not in ({"debye_length"}, {"salt_concentration", "temperature"}):
            raise ValueError(
                'give debye_length, such as "10 nm", or salt_concentration and temperature, such as "1 mM" and "298 K" '
                f"(found {' and '.join(sorted(thickness)) or 'none of them'})"
            )
        if self.salt_concentration is not None and self.temperature is not None:
            # 1/kappa of a 1:1 salt (Debye & Hueckel 1923; Israelachvili 2011, section 14.7).
            charge = 2.0 * AVOGADRO * self.salt_concentration * ELEMENTARY_CHARGE**2
            energy = VACUUM_PERMITTIVITY * self.relative_permittivity * BOLTZMANN * self.temperature
            self.__dict__["debye_length"] = sqrt(energy / charge)
        return self

    @model_validator(mode="after")
    def _potential_is_low(self) -> Self:
        if abs(self.surface_potential) > LARGEST_POTENTIAL:
            raise ValueError(
                f"surface_potential = {self.surface_potential * 1e3:g} mV is beyond the linear Poisson-Boltzmann "
                f"equation; expected at most {LARGEST_POTENTIAL * 1e3:g} mV either way"
            )
        return self

    @model_validator(mode="after")
    def _charges_keep_apart(self) -> Self:
        if self.condition == "constant_charge" and self.minimum_approach is None:
            raise ValueError('condition = "constant_charge" needs minimum_approach, such as "0.165 nm"')
        if self.condition == "constant_potential" and self.minimum_approach is not None:
            raise ValueError('minimum_approach belongs to condition = "constant_charge": remove it')
        return self

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> DoubleLayerKernel:
        """The parameters in reduced units; raises `SceneError` if the double layer is thick against the radius."""
        kappa_a = units.length / self.debye_length
        smallest = min(suspension.species)
        thinness = smallest / self.debye_length
        if thinness < SMALLEST_KAPPA_A:
            raise SceneError(
                f"[effects.double_layer] debye_length = {self.debye_length * 1e9:g} nm makes "
                f"kappa a = {thinness:.3g}; expected at least {SMALLEST_KAPPA_A:g}, a debye_length of at most "
                f"{smallest / SMALLEST_KAPPA_A * 1e9:g} nm, for the sphere formula to hold"
            )
        permittivity = VACUUM_PERMITTIVITY * self.relative_permittivity
        return DoubleLayerKernel(
            strength=2.0 * pi * permittivity * self.surface_potential**2 / units.force,
            wavenumber=kappa_a,
            sign=1.0 if self.condition == "constant_potential" else -1.0,
            minimum_approach=(self.minimum_approach or 0.0) / units.length,
        )


class DoubleLayerKernel(NamedTuple):
    """Parameters of `force`; the formulas hold in any consistent units."""

    strength: float
    """2 pi eps psi^2 [force]"""
    wavenumber: float
    """kappa [1/length]"""
    sign: float
    """+1 at constant potential, -1 at constant charge"""
    minimum_approach: float
    """[length]"""


@compiled
def force(h, radius, p):
    """Force (F, dF/dh) at gap `h` between spheres of harmonic mean radius `radius`; F > 0 repels.

    An overlap (h < 0) is read as touching: the force at contact, with no stiffness.
    """
    x = exp(-p.wavenumber * (p.minimum_approach + max(h, 0.0)))
    share = 1.0 / (1.0 + p.sign * x)
    value = p.strength * (p.wavenumber * radius) * x * share
    if h < 0.0:
        return value, 0.0
    return value, -p.wavenumber * value * share


EFFECT = PairForce(DoubleLayer, DoubleLayerKernel, force)
