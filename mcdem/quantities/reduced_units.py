"""The units of the compiled code."""

from __future__ import annotations

from typing import NamedTuple


class ReducedUnits(NamedTuple):
    """SI values of the units of the compiled code: a single sphere has translational resistance 1 in them."""

    length: float
    """a [m]"""
    time: float
    """1/g [s]"""
    force: float
    """6 pi mu a^2 g [N]"""

    @property
    def velocity(self) -> float:
        """a g [m/s]."""
        return self.length / self.time

    @property
    def energy(self) -> float:
        """6 pi mu a^3 g, the unit of torque and stresslet too [J]."""
        return self.force * self.length

    @property
    def stiffness(self) -> float:
        """6 pi mu a g [N/m]."""
        return self.force / self.length
