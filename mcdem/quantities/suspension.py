"""The primary particles of a suspension."""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from mcdem.quantities.toml_tables import FROM_THE_OTHERS, Table
from mcdem.quantities.units import DIMENSIONLESS, LENGTH

SMALLEST_RATIO = 0.1
"""Smallest over largest radius of a suspension."""


MOST_RADII = 20
"""Radii of a suspension: two-sphere functions are tabulated for every pair of them."""

_RADIUS = LENGTH.positive.between("0.1 nm", "1 cm")
_SHARE = DIMENSIONLESS.positive.between("1e-12", "1")


class Suspension(Table):
    """The primary particles and how many of them there are.

    Examples
    --------
    >>> import mcdem
    >>> suspension = mcdem.load_scene("scenes/two-sizes.toml").suspension
    >>> suspension.radius == max(suspension.radii), suspension.number_fractions
    (True, (0.5, 0.5))
    """

    radius: Annotated[float, _RADIUS] = FROM_THE_OTHERS
    """Radius a of the primary particles; where `radii` are given instead, the largest of them."""
    radii: Annotated[tuple[Annotated[float, _RADIUS], ...], Field(strict=False)] | None = None
    """Radii of the primaries of a suspension of several, instead of `radius`; what is given over a is over the largest."""
    number_fractions: Annotated[tuple[Annotated[float, _SHARE], ...], Field(strict=False)] | None = None
    """Share in number of the primaries of each of the `radii`; they add up to 1."""
    volume_fraction: Annotated[float, DIMENSIONLESS.positive.between("1e-15", "0.74", "1e-4")]
    """Volume of the primary particles over that of the suspension; encounters are binary, so it should be small."""

    @property
    def species(self) -> tuple[float, ...]:
        """Radii [m] that the primaries have."""
        return (self.radius,) if self.radii is None else self.radii

    @model_validator(mode="after")
    def _one_radius_or_several(self) -> Self:
        given = self.model_fields_set & {"radius", "radii"}
        if len(given) != 1:
            raise ValueError(
                'give radius, such as "500 nm", or radii and their number_fractions '
                f"(found {' and '.join(sorted(given)) or 'neither'})"
            )
        if self.radii is None:
            if self.number_fractions is not None:
                raise ValueError(
                    "number_fractions belong to radii: remove them, or give radii instead of radius"
                )
            return self
        if self.number_fractions is None:
            raise ValueError("radii need number_fractions, one for each, such as [0.5, 0.5]")
        if len(self.radii) < 2 or len(set(self.radii)) < len(self.radii):
            raise ValueError("radii: expected two or more, all different; a suspension of one has a radius")
        if len(self.radii) > MOST_RADII:
            raise ValueError(f"radii: found {len(self.radii)}, expected at most {MOST_RADII}")
        if len(self.number_fractions) != len(self.radii):
            raise ValueError(
                f"number_fractions: expected {len(self.radii)}, one for each of radii, found {len(self.number_fractions)}"
            )
        if abs(math.fsum(self.number_fractions) - 1.0) > 1e-9:
            raise ValueError(
                f"number_fractions add up to {math.fsum(self.number_fractions):.10g}, expected 1"
            )
        if min(self.radii) < SMALLEST_RATIO * max(self.radii):
            raise ValueError(
                f"radii from {min(self.radii):g} to {max(self.radii):g} m: expected ratios of at least {SMALLEST_RATIO:g}, "
                "to which the two-sphere functions are summed"
            )
        self.__dict__["radius"] = max(self.radii)
        return self
