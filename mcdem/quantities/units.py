"""Quantities with units at the edge of the program, SI floats inside.

A field declared with one of the types below accepts text with a unit ("500 nm", "100 mPa s", "1e4 1/s") and holds the SI
value as a float.  From Python it also accepts a number, which is in SI units, and a quantity of pint; in a scene file a bare
number is refused, since its unit is unknown.  A wrong dimension, a unit that is not known here (`known_units`), anything
after the unit, NaN and infinity are refused; `Positive...` refuses zero and below, `NonNegative...` what is below zero, and
`between` what lies outside bounds.  Only a dimensionless quantity may be a bare number in a file too.

    class JKR(Table):
        surface_energy: PositiveSurfaceEnergy
        '''Work to make a unit area of surface, half the work of adhesion.'''

Functions take quantities as arguments in the same three ways, by `si`.
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

from mcdem.errors import UserError
from mcdem.quantities.unit_factors import known_units, si_unit

if TYPE_CHECKING:
    import numpy as np
    import pint
    from numpy.typing import NDArray

IN_A_FILE = {"bare numbers": False}
"""Context of pydantic under which a bare number is no quantity: that of a scene file."""

LONGEST_TEXT = 80
"""Characters of a quantity, above which it cannot be meant."""


@dataclass(frozen=True)
class Quantity:
    """What a field of a scene expects: a dimension, its SI unit, how one would write it, and between which bounds."""

    dimension: str
    si: str
    example: str
    sign: Literal["any", "positive", "non-negative"] = "any"
    lowest: str = ""
    """Written like a quantity in a file; empty for no bound."""
    highest: str = ""

    @property
    def positive(self) -> Quantity:
        """The same quantity, above zero."""
        return replace(self, sign="positive")

    @property
    def non_negative(self) -> Quantity:
        """The same quantity, zero included."""
        return replace(self, sign="non-negative")

    def between(self, lowest: str, highest: str, example: str = "") -> Quantity:
        """The same quantity between bounds, both included and written as in a file; zero too, if it is non-negative."""
        return replace(self, lowest=lowest, highest=highest, example=example or self.example)

    @property
    def kind(self) -> str:
        """In words: 'a positive length'; 'a length from 1 nm to 1 mm'."""
        sign = self.sign
        bounds = ""
        if self.highest:
            bounds = f" from {self.lowest} to {self.highest}"
            if sign == "positive":
                sign = "any"  # as the bounds say
            elif sign == "non-negative":
                sign, bounds = "any", f"{bounds}, or 0" if self._limits[0] > 0.0 else bounds
        words = self.dimension if sign == "any" else f"{sign} {self.dimension}"
        return f"{'an' if words[0] in 'aeiou' else 'a'} {words}{bounds}"

    @property
    def expected(self) -> str:
        """What to write: 'a positive length, such as "500 nm"'."""
        return f"{self.kind}, such as {self.example}"

    def to_si(self, given: object, *, bare: bool = True) -> float:
        """SI value of `given`: text with a unit, a quantity of pint or, if `bare`, a number in SI units.

        Raises `PydanticCustomError` (a ValueError) that says what was wrong and what is expected.
        """
        value = self._magnitude(given, bare)
        if not math.isfinite(value):
            raise self._refusal("is not finite")
        if self.sign == "positive" and value <= 0.0:
            raise self._refusal("is not positive")
        if self.sign == "non-negative":
            if value < 0.0:
                raise self._refusal("is negative")
            if value == 0.0:
                return 0.0
        if self.highest:
            low, high = self._limits
            if not low <= value <= high:
                raise self._refusal("is out of bounds")
        return value

    @property
    def _limits(self) -> tuple[float, float]:
        return _limit(self.lowest, self.si), _limit(self.highest, self.si)

    def _magnitude(self, given: object, bare: bool) -> float:
        if isinstance(given, Real) and not isinstance(given, bool):
            if self.si and not bare:
                raise self._refusal("has no unit")
            try:
                return float(given)
            except OverflowError:
                raise self._refusal("is out of bounds") from None
        unit = self.si or "dimensionless"
        try:
            if isinstance(given, str) and (value := _read_by_factor(given, self.si)) is not None:
                return value
            quantity: Any = _read(given) if isinstance(given, str) else given
            found, fits = quantity.units, quantity.is_compatible_with(unit)
        except _OutOfRangeError:
            raise self._refusal("is out of bounds") from None
        except Exception as problem:  # pint raises a dozen unrelated classes on text that it cannot read
            raise self._refusal("is not a number with a unit that can be read") from problem
        if not fits:
            raise self._refusal(f"has the wrong dimension ({found:~C})" if f"{found:~C}" else "has no unit")
        try:
            return float(_magnitude_in(quantity, unit))
        except Exception as problem:  # an array, or an offset unit where pint wants a difference
            raise self._refusal("is not one number with a unit that can be read") from problem

    def _refusal(self, reason: str) -> PydanticCustomError:
        return PydanticCustomError(
            "quantity", "{reason}; expected {expected}", {"reason": reason, "expected": self.expected}
        )

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        def validated(given: object, info: core_schema.ValidationInfo) -> float:
            return self.to_si(given, bare=info.context is not IN_A_FILE)

        return core_schema.with_info_plain_validator_function(validated)


def si(name: str, given: object, quantity: Quantity, shape: tuple[int | None, ...] = ()) -> Any:
    """SI value of a function's argument: a float, or an array of the `shape` asked for.

    Parameters
    ----------
    name : str
        Of the argument, for the message.
    given : number, str, quantity of pint, or array_like
        A number in SI units, text with a unit, or a quantity of pint; for an array these in lists, an array, or an array with
        a unit of pint.
    quantity : Quantity
        Dimension and limits that are asked for.
    shape : tuple of int or None
        Of the array, with None for any length along an axis; () for one number.

    Returns
    -------
    float or ndarray
        In SI units.

    Raises
    ------
    UserError
        One line: the name, what was given, what is expected.

    Examples
    --------
    >>> from mcdem.quantities import LENGTH, si
    >>> si("radius", "150 nm", LENGTH)
    1.5e-07
    """
    if shape == ():
        try:
            return quantity.to_si(given)
        except PydanticCustomError as problem:
            raise UserError(f"{name} = {shown(given)} {problem.message()}") from None
    import numpy as np  # not above: text with units is read without it

    wanted = (
        "(" + ", ".join("N" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
    )
    unit = quantity.si or "dimensionless"
    expected = (
        f"expected an array {wanted} of {quantity.dimension}s, numbers in {quantity.si or '1'} or with units"
    )
    values: NDArray[np.float64]
    try:
        if hasattr(given, "m_as") and hasattr(given, "is_compatible_with"):
            if not given.is_compatible_with(unit):
                raise UserError(f"{name}: has the wrong dimension ({given.units:~C}); {expected}")  # type: ignore[attr-defined]  # of pint, whichever registry
            values = np.array(_magnitude_in(given, unit), dtype=float, order="C")
        else:
            raw = np.asarray(given)
            if raw.dtype.kind in "fiu":
                values = np.array(raw, dtype=float, order="C")  # another layout would be compiled anew
            elif raw.dtype.kind in "OU":
                values = np.array([quantity.to_si(one) for one in raw.ravel()], dtype=float).reshape(
                    raw.shape
                )
            else:
                raise UserError(f"{name}: found {raw.dtype.name} values; {expected}")
    except PydanticCustomError as problem:
        raise UserError(f"{name}: one of its values {problem.message()}; {expected}") from None
    except (TypeError, ValueError):
        raise UserError(f"{name}: cannot be read as numbers; {expected}") from None
    if values.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, values.shape)):
        raise UserError(f"{name}: {expected}, found shape {values.shape}")
    if not np.isfinite(values).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(values))[0])
        raise UserError(
            f"{name}: {values[place]} at {place} is not finite; expected finite numbers {wanted} in {quantity.si or '1'}"
        )
    return values


def shown(given: object, longest: int = 60) -> str:
    """What a user gave, on one line and not long, for a message."""
    try:
        text = f'"{given}"' if isinstance(given, str) else str(given)
    except (
        ValueError,
        RecursionError,
    ):  # an integer of more digits than Python writes, a list of lists of lists ...
        return f"a {type(given).__name__} too long to show"
    text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[: 4 * longest])
    return text if len(text) <= longest else f"{text[: longest - 12]} ... {text[-6:]}"


# -- text ---------------------------------------------------------------------------------------------------------------

NUMBER = r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|nan|inf)"
_BLANK = "[ \\t\u00a0\u2009\u202f]*"
_QUANTITY = re.compile(rf"{_BLANK}({NUMBER}){_BLANK}(.*?){_BLANK}")
_FACTOR = re.compile(r"(?:\^|\*\*)?([+-]?[0-9])")


def _magnitude_in(quantity: Any, unit: str) -> Any:
    """Magnitude of a quantity of any registry, a number or an array of floats, in a unit."""
    import numpy as np

    magnitude = quantity.magnitude
    if np.ndim(magnitude) == 0:
        # By decimal factors whatever the user's registry has, so that 500 nm is the same float however it was said.
        number = magnitude if isinstance(magnitude, Decimal) else Decimal(repr(float(magnitude)))
        own = unit_registry()
        try:
            units = own.parse_units(str(quantity.units))
        except Exception:  # a unit that only the user's registry knows
            return quantity.m_as(unit)
        return own.Quantity(number, units).m_as(unit)
    registry = quantity._REGISTRY
    factor = registry.Quantity(registry.non_int_type(1), quantity.units).m_as(unit)
    return np.asarray(magnitude, dtype=float) * float(factor)


class _OutOfRangeError(ValueError):
    """A number beyond any float."""


@cache
def unit_registry() -> pint.UnitRegistry[Any]:
    """The one registry of units; built when the first text with a unit is read, for that takes a third of a second."""
    import pint

    # Decimal prefixes: 500 nm is the float 5e-7 that one would type, not its neighbour.
    return pint.UnitRegistry(non_int_type=Decimal)


@cache
def _limit(text: str, unit: str) -> float:
    value = _read_by_factor(text, unit)
    return float(_read(text).m_as(unit or "dimensionless")) if value is None else value


def _parts(text: str) -> tuple[Decimal, str]:
    """The number of a text, and what follows it.

    pint alone would read "5,5 nm" as 55 nm, "nm" as 1 nm and "5 nm # and more" as 5 nm.
    """
    parts = _QUANTITY.fullmatch(text) if len(text) <= LONGEST_TEXT else None
    if parts is None:
        raise ValueError(text)
    number = Decimal(parts[1])
    if number.is_finite() and number and not -300 < number.adjusted() < 300:
        raise _OutOfRangeError(text)
    return number, parts[2]


def _read_by_factor(text: str, unit: str) -> float | None:
    """A number with a unit, in another unit; None where that takes more than a factor."""
    number, given = _parts(text)
    found, wanted = si_unit(_powers(given)), si_unit(_powers(unit))
    if not number.is_finite() or found is None or wanted is None or found.dimension != wanted.dimension:
        return None
    return float(number * (found.factor / wanted.factor))


def _read(text: str) -> pint.Quantity[Any]:
    """A number followed by a unit, as pint has it."""
    number, unit = _parts(text)
    return unit_registry().Quantity(number, _unit(unit))


@cache
def _unit(text: str) -> pint.Unit:
    registry = unit_registry()
    product = registry.Unit("dimensionless")
    for known, power in _powers(text):
        unit = _SPELT.get(known, known)
        product = product * registry.parse_units(unit) ** power
    return product


@cache
def _powers(text: str) -> tuple[tuple[str, int], ...]:
    """A product of powers of known units, each after a blank, a sign of multiplication or a slash."""
    powers: dict[str, int] = {}
    rest, sign, first = text.translate(_SUPERSCRIPTS), 1, True
    while rest:
        between = re.match(r"[ \t]*([*·/]?)[ \t]*", rest)
        assert between is not None
        rest = rest[between.end() :]
        if between[1] == "/":
            sign = -1
        elif between[1] and first:
            raise ValueError(text)
        if first and not between[1] and re.match(r"1[ \t]*/", rest):
            rest, first = rest[1:], False
            continue
        name = re.match(r"[^\W\d]+|%|°C", rest)
        if name is None or name[0] not in known_units():
            raise ValueError(text)
        rest = rest[name.end() :]
        exponent = _FACTOR.match(rest)
        power = int(exponent[1]) if exponent else 1
        rest = rest[exponent.end() :] if exponent else rest
        if rest and not re.match(r"[ \t*·/]", rest):
            raise ValueError(text)
        powers[name[0]] = powers.get(name[0], 0) + sign * power
        sign, first = 1, False
        if rest and not rest.strip(" \t"):
            raise ValueError(text)
    return tuple(powers.items())


_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_SPELT = {"°C": "degC", "celsius": "degC", "d": "day", "%": "percent"}


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
CONCENTRATION = Quantity("concentration", "mol/m^3", '"10 mM"')
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
