"""Units as exact factors of SI: what reading a quantity needs, without loading pint.

Definitions are those of SI and CODATA; `tests/scene/test_arguments.py` holds every name against pint's.
"""

from __future__ import annotations

from decimal import Decimal
from functools import cache
from typing import NamedTuple

PREFIXED = "m g s N Pa J W V K Hz P M mol L eV A F C bar".split()
"""Units that take a prefix."""
PREFIXES = "f p n u µ μ m c d k M G T".split()
NAMED_PREFIXES = "femto pico nano micro milli centi deci kilo mega giga tera".split()
NAMED = (
    "meter metre gram second newton pascal joule watt volt kelvin hertz poise molar mole liter litre electron_volt"
).split()
"""Units that take a prefix by its name, with or without the plural s."""
PLAIN = (
    "min minute minutes h hr hour hours d day days atm dyn dyne erg angstrom Å micron % percent ppm degC °C celsius"
).split()
"""Units that take none."""


class SIUnit(NamedTuple):
    """A unit as a multiple of the coherent unit of its dimension."""

    factor: Decimal
    dimension: tuple[int, ...]
    """Powers of m, kg, s, K, mol, A."""


def _unit(factor: str, m: int = 0, kg: int = 0, s: int = 0, K: int = 0, mol: int = 0, A: int = 0) -> SIUnit:
    return SIUnit(Decimal(factor), (m, kg, s, K, mol, A))


_SYMBOLS = {
    "m": _unit("1", m=1),
    "g": _unit("1e-3", kg=1),
    "s": _unit("1", s=1),
    "N": _unit("1", m=1, kg=1, s=-2),
    "Pa": _unit("1", m=-1, kg=1, s=-2),
    "J": _unit("1", m=2, kg=1, s=-2),
    "W": _unit("1", m=2, kg=1, s=-3),
    "V": _unit("1", m=2, kg=1, s=-3, A=-1),
    "K": _unit("1", K=1),
    "Hz": _unit("1", s=-1),
    "P": _unit("0.1", m=-1, kg=1, s=-1),
    "M": _unit("1e3", m=-3, mol=1),
    "mol": _unit("1", mol=1),
    "L": _unit("1e-3", m=3),
    "eV": _unit("1.602176634e-19", m=2, kg=1, s=-2),
    "A": _unit("1", A=1),
    "F": _unit("1", m=-2, kg=-1, s=4, A=2),
    "C": _unit("1", s=1, A=1),
    "bar": _unit("1e5", m=-1, kg=1, s=-2),
}
_NAMES = {
    "meter": "m",
    "metre": "m",
    "gram": "g",
    "second": "s",
    "newton": "N",
    "pascal": "Pa",
    "joule": "J",
    "watt": "W",
    "volt": "V",
    "kelvin": "K",
    "hertz": "Hz",
    "poise": "P",
    "molar": "M",
    "mole": "mol",
    "liter": "L",
    "litre": "L",
    "electron_volt": "eV",
}
_WITHOUT_PREFIX = {
    **dict.fromkeys(("min", "minute", "minutes"), _unit("60", s=1)),
    **dict.fromkeys(("h", "hr", "hour", "hours"), _unit("3600", s=1)),
    **dict.fromkeys(("d", "day", "days"), _unit("86400", s=1)),
    "atm": _unit("101325", m=-1, kg=1, s=-2),
    **dict.fromkeys(("dyn", "dyne"), _unit("1e-5", m=1, kg=1, s=-2)),
    "erg": _unit("1e-7", m=2, kg=1, s=-2),
    **dict.fromkeys(("angstrom", "Å"), _unit("1e-10", m=1)),
    "micron": _unit("1e-6", m=1),
    **dict.fromkeys(("%", "percent"), _unit("0.01")),
    "ppm": _unit("1e-6"),
}
_POWERS_OF_TEN = dict(zip(PREFIXES, (-15, -12, -9, -6, -6, -6, -3, -2, -1, 3, 6, 9, 12)))
_NAMED_POWERS_OF_TEN = dict(zip(NAMED_PREFIXES, (-15, -12, -9, -6, -3, -2, -1, 3, 6, 9, 12)))


@cache
def known_units() -> frozenset[str]:
    """Every name of a unit that is read."""
    return frozenset({*PLAIN, *_factors()})


def si_unit(powers: tuple[tuple[str, int], ...]) -> SIUnit | None:
    """A product of powers of known units; None where one has no factor, as a temperature from a zero of its own."""
    factor = Decimal(1)
    dimension: tuple[int, ...] = (0,) * 6
    for name, power in powers:
        unit = _factors().get(name)
        if unit is None:
            return None
        factor *= unit.factor**power
        dimension = tuple(d + power * u for d, u in zip(dimension, unit.dimension))
    return SIUnit(factor, dimension)


@cache
def _factors() -> dict[str, SIUnit]:
    found = dict(_WITHOUT_PREFIX)
    for symbol in PREFIXED:
        unit = _SYMBOLS[symbol]
        found[symbol] = unit
        for prefix, power in _POWERS_OF_TEN.items():
            found[prefix + symbol] = unit._replace(factor=unit.factor.scaleb(power))
    for name in NAMED:
        unit = _SYMBOLS[_NAMES[name]]
        for prefix, power in {"": 0, **_NAMED_POWERS_OF_TEN}.items():
            for plural in ("", "s"):
                found[prefix + name + plural] = unit._replace(factor=unit.factor.scaleb(power))
    return found
