"""What every effect shares: a scene table that refuses what it does not know, and the unit of force of the compiled code."""

from __future__ import annotations

from math import pi
from typing import Any

from pydantic import BaseModel, ConfigDict


class Effect(BaseModel):
    """Table `[effects.<name>]` of a scene; SI floats inside."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


def force_unit(scene: Any) -> float:
    """F0 = 6 pi mu a^2 g [N]: the drag on a primary particle at the velocity a g, the unit of force of all compiled code."""
    return 6.0 * pi * scene.flow.viscosity * scene.suspension.radius**2 * scene.flow.shear_rate
