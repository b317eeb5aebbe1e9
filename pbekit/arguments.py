"""Checks at the door of public functions: what is refused, in one line that says what was expected."""

from __future__ import annotations

from numbers import Integral, Real

import numpy as np

from pbekit.errors import KernelError, PBEError

METHODS = ("LSODA", "BDF", "Radau", "RK45", "RK23", "DOP853")
"""Integrators of scipy."""
SCHEMES = ("fixed pivot", "cell average", "three pivots")
"""How products are put on pivots."""
MOST_EXACT = 5000
"""Sizes with a class of their own: tables of pairs of classes hold its square."""
LARGEST_SEED = 2**63 - 1
MOST_DRAWS = 10**6
LEVEL = 0.9
"""Share of repetitions in which a band or interval holds the truth, unless said otherwise."""
LONGEST_TIME = 1e12
"""[s] thirty thousand years; what has not come to rest by then is followed no further."""
DENSEST = 0.74
"""Volume fraction of the densest packing of equal spheres."""
DILUTE = 0.05
"""Volume fraction above which encounters are hardly of two aggregates alone; a suspension of fractal aggregates is crowded
well below it."""


def number(name: str, given: object, least: float, most: float, what: str = "a number") -> float:
    """A finite number from `least` to `most`; raises `PBEError`."""
    if not isinstance(given, Real) or isinstance(given, bool) or not least <= float(given) <= most:
        raise PBEError(f"{named(name, given)}: expected {what} from {least:g} to {most:g}")
    return float(given)


def whole_number(name: str, given: object, least: int, most: int) -> int:
    """An integer from `least` to `most`; raises `PBEError`."""
    if not isinstance(given, Integral) or isinstance(given, bool) or not least <= int(given) <= most:
        raise PBEError(f"{name} = {shown(given)}: expected a whole number from {least} to {most}")
    return int(given)


def law(of: object, positive: tuple[str, ...] = (), finite: tuple[str, ...] = ()) -> None:
    """Refuse parameters of a law that are not numbers, or not above 0; raises `KernelError`."""
    for name in (*positive, *finite):
        given = getattr(of, name)
        good = isinstance(given, Real) and not isinstance(given, bool) and np.isfinite(float(given))
        if not good or (name in positive and not given > 0):
            wanted = "a number above 0" if name in positive else "a finite number"
            raise KernelError(f"{type(of).__name__}: {name} = {shown(given)}: expected {wanted}")


def volume_fraction(given: object, name: str = "volume fraction") -> float:
    """A volume fraction above 0, below that of a packing; raises `PBEError`."""
    return number(name, given, 1e-15, DENSEST, "a share of the volume")


def stress(given: object, name: str = "stress") -> float:
    """A shear stress [Pa]; raises `PBEError`."""
    return number(name, given, 1e-12, 1e12, "a shear stress in Pa")


def _seconds(given: str, name: str) -> float:
    """A text with a unit of time, or a number of seconds."""
    import pint

    try:
        return float(given)
    except ValueError:
        try:
            return float(pint.Quantity(given).to("s").magnitude)
        except (pint.PintError, TypeError, ValueError, AttributeError):
            raise PBEError(f'{named(name, given)}: expected a time such as "10 s"') from None


def until(given: object, name: str = "until") -> float:
    """A time [s] to stop at, a number in s or a text with a unit, such as "10 s"; raises `PBEError`."""
    if isinstance(given, str):
        given = _seconds(given, name)
    if not isinstance(given, Real) or isinstance(given, bool) or not 0.0 < float(given) <= LONGEST_TIME:
        raise PBEError(
            f"{named(name, given)}: expected a time above 0 and up to {LONGEST_TIME:g}, in seconds"
        )
    return float(given)


def least_draws(level: float = LEVEL) -> int:
    """Draws from which a band can be read: that of the smallest to the largest then holds the next draw so often."""
    return int(np.ceil(2 / (1 - level) - 1e-9)) - 1


def draws(given: object, name: str = "draws", none: bool = False) -> int:
    """A number of draws that a band can be read from, or 0 where there may be `none`; raises `PBEError`."""
    count = int(given) if isinstance(given, Integral) and not isinstance(given, bool) else -1
    if not (least_draws() <= count <= MOST_DRAWS or (none and count == 0)):
        raise PBEError(
            f"{named(name, given)}: expected {'0 (no bands) or ' if none else ''}{least_draws()} to {MOST_DRAWS}; "
            f"{least_draws()} are the fewest that a {100 * LEVEL:g} % band can be read from"
        )
    return count


def array(
    name: str, given: object, shape: tuple[int | None, ...] | None, what: str = "numbers"
) -> np.ndarray:
    """An array of finite numbers; `shape` with None for any length, or None for any shape; raises `PBEError`."""
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise PBEError(f"{name}: cannot be read as {what}, got {shown(given)}") from None
    if shape is not None and (
        values.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, values.shape))
    ):
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise PBEError(f"{name}: got shape {values.shape}, expected ({wanted})")
    if not np.all(np.isfinite(values)):
        raise PBEError(f"{name}: {what} must be finite")
    return values


def scheme(given: object, name: str = "scheme") -> None:
    """Refuse what is no way to put products on pivots; raises `PBEError`."""
    if given not in SCHEMES:
        raise PBEError(f"{named(name, given)}: expected one of {', '.join(SCHEMES)}")


def method(given: object, name: str = "method") -> None:
    """Refuse what is no integrator of scipy, by name or as a class; raises `PBEError`."""
    from scipy.integrate import OdeSolver

    if (
        given in METHODS
        if isinstance(given, str)
        else isinstance(given, type) and issubclass(given, OdeSolver)
    ):
        return
    raise PBEError(f"{named(name, given)}: expected one of {', '.join(METHODS)}")


def named(name: str, given: object) -> str:
    """What a user gave under a name: `until = -1.0`, or `--until -1.0` of an option."""
    return f"{name}{' ' if name.startswith('--') else ' = '}{shown(given)}"


def shown(given: object, longest: int = 60) -> str:
    """What a user gave, on one line and not long."""
    text = " ".join(repr(given).split())
    return text if len(text) <= longest else f"{text[: longest - 4]} ..."
