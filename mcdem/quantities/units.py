"""Quantities with units at the edge of the program, SI floats inside.

A field declared with one of the types below accepts text with a unit ("500 nm", "100 mPa s", "1e4 1/s") and holds
the SI value as a float.  A wrong dimension, a missing unit, NaN and infinity are refused; `Positive...` refuses
zero and below, `NonNegative...` refuses what is below zero.  Only a dimensionless quantity may be a bare number.

    class JKR(Table):
        surface_energy: PositiveSurfaceEnergy
        '''Work to make a unit area of surface, half the work of adhesion.'''
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache
from numbers import Real
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic_core import PydanticCustomError, core_schema

if TYPE_CHECKING:
    import pint


@dataclass(frozen=True)
class Quantity:
    """What a field of a scene expects: a dimension, its SI unit, and how one would write it."""

    dimension: str
    si: str
    example: str
    sign: Literal["any", "positive", "non-negative"] = "any"

    @property
    def positive(self) -> Quantity:
        """The same quantity, above zero."""
        return replace(self, sign="positive")

    @property
    def non_negative(self) -> Quantity:
        """The same quantity, zero included."""
        return replace(self, sign="non-negative")

    @property
    def kind(self) -> str:
        """In words: 'a positive length'."""
        words = self.dimension if self.sign == "any" else f"{self.sign} {self.dimension}"
        return f"{'an' if words[0] in 'aeiou' else 'a'} {words}"

    @property
    def expected(self) -> str:
        """What to write: 'a positive length, such as "500 nm"'."""
        return f"{self.kind}, such as {self.example}"

    def to_si(self, given: object) -> float:
        """SI value of `given` (text with a unit, a pint quantity, or a bare number if dimensionless).

        Raises `PydanticCustomError` (a ValueError) that says what was wrong and what is expected.
        """
        value = self._magnitude(given)
        if not math.isfinite(value):
            raise self._refusal("is not finite")
        if self.sign == "positive" and value <= 0.0:
            raise self._refusal("is not positive")
        if self.sign == "non-negative" and value < 0.0:
            raise self._refusal("is negative")
        return value

    def _magnitude(self, given: object) -> float:
        if isinstance(given, Real) and not isinstance(given, bool):
            if self.si:
                raise self._refusal("has no unit")
            return float(given)
        try:
            quantity: Any = _read(given) if isinstance(given, str) else given
            found = quantity.units
        except Exception as problem:  # pint raises a dozen unrelated classes on text that it cannot read
            raise self._refusal("is not a number with a unit that can be read") from problem
        unit = self.si or "dimensionless"
        if not quantity.is_compatible_with(unit):
            raise self._refusal(f"has the wrong dimension ({found:~C})" if f"{found:~C}" else "has no unit")
        return float(quantity.m_as(unit))

    def _refusal(self, reason: str) -> PydanticCustomError:
        return PydanticCustomError(
            "quantity", "{reason}; expected {expected}", {"reason": reason, "expected": self.expected}
        )

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.to_si)


@cache
def unit_registry() -> pint.UnitRegistry[Any]:
    """The one registry of units; built when the first text with a unit is read, for that takes a third of a second."""
    import pint

    # Decimal prefixes: 500 nm is the float 5e-7 that one would type, not its neighbour.
    return pint.UnitRegistry(non_int_type=Decimal)


def _read(text: str) -> pint.Quantity[Any]:
    """A number followed by a unit.  pint alone would read "5,5 nm" as 55 nm and "nm" as 1 nm."""
    parts = re.fullmatch(rf"\s*({NUMBER})\s*(.*?)\s*", text)
    if parts is None:
        raise ValueError(text)
    number, unit = parts.groups()
    if unit.startswith("/"):
        unit = "1" + unit
    return unit_registry().Quantity(Decimal(number), unit_registry().parse_units(unit))


NUMBER = r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|inf)"


LENGTH = Quantity("length", "m", '"500 nm"')
TIME = Quantity("time", "s", '"10 s"')
RATE = Quantity("rate", "1/s", '"1e4 1/s"')
ENERGY = Quantity("energy", "J", '"0.97e-20 J"')
PRESSURE = Quantity("pressure", "Pa", '"3.4 GPa"')
STRESS = Quantity("stress", "Pa", '"750 Pa"')
SURFACE_ENERGY = Quantity("surface energy", "J/m^2", '"4.7 mJ/m^2"')
VISCOSITY = Quantity("viscosity", "Pa s", '"100 mPa s"')
DENSITY = Quantity("density", "kg/m^3", '"1050 kg/m^3"')
TEMPERATURE = Quantity("temperature", "K", '"298 K"')
POTENTIAL = Quantity("potential", "V", '"-25 mV"')
INVERSE_LENGTH = Quantity("inverse length", "1/m", '"0.1 1/nm"')
FORCE = Quantity("force", "N", '"10 nN"')
STIFFNESS = Quantity("stiffness", "N/m", '"40 N/m"')
DIMENSIONLESS = Quantity("number", "", "0.5")

Length = Annotated[float, LENGTH]
PositiveLength = Annotated[float, LENGTH.positive]
NonNegativeLength = Annotated[float, LENGTH.non_negative]
Time = Annotated[float, TIME]
PositiveTime = Annotated[float, TIME.positive]
NonNegativeTime = Annotated[float, TIME.non_negative]
Rate = Annotated[float, RATE]
PositiveRate = Annotated[float, RATE.positive]
NonNegativeRate = Annotated[float, RATE.non_negative]
Energy = Annotated[float, ENERGY]
PositiveEnergy = Annotated[float, ENERGY.positive]
NonNegativeEnergy = Annotated[float, ENERGY.non_negative]
Pressure = Annotated[float, PRESSURE]
PositivePressure = Annotated[float, PRESSURE.positive]
NonNegativePressure = Annotated[float, PRESSURE.non_negative]
Stress = Annotated[float, STRESS]
PositiveStress = Annotated[float, STRESS.positive]
SurfaceEnergy = Annotated[float, SURFACE_ENERGY]
PositiveSurfaceEnergy = Annotated[float, SURFACE_ENERGY.positive]
NonNegativeSurfaceEnergy = Annotated[float, SURFACE_ENERGY.non_negative]
Viscosity = Annotated[float, VISCOSITY]
PositiveViscosity = Annotated[float, VISCOSITY.positive]
Density = Annotated[float, DENSITY]
PositiveDensity = Annotated[float, DENSITY.positive]
Temperature = Annotated[float, TEMPERATURE]
PositiveTemperature = Annotated[float, TEMPERATURE.positive]
Potential = Annotated[float, POTENTIAL]
InverseLength = Annotated[float, INVERSE_LENGTH]
PositiveInverseLength = Annotated[float, INVERSE_LENGTH.positive]
Force = Annotated[float, FORCE]
PositiveForce = Annotated[float, FORCE.positive]
Stiffness = Annotated[float, STIFFNESS]
PositiveStiffness = Annotated[float, STIFFNESS.positive]
NonNegativeStiffness = Annotated[float, STIFFNESS.non_negative]
Dimensionless = Annotated[float, DIMENSIONLESS]
PositiveDimensionless = Annotated[float, DIMENSIONLESS.positive]
NonNegativeDimensionless = Annotated[float, DIMENSIONLESS.non_negative]
