"""The units of the compiled code."""

from __future__ import annotations

from typing import NamedTuple


class ReducedUnits(NamedTuple):
    """SI values of the units of the compiled code: a single sphere has translational resistance 1 in them.

    Examples
    --------
    >>> import mcdem
    >>> unit = mcdem.load_scene("scenes/paper-1000Pa.toml").reduced
    >>> f"{unit.length:.1e} m, {unit.time:.1e} s, {unit.force * 1e9:.2f} nN"
    '5.0e-07 m, 1.0e-04 s, 4.71 nN'
    """

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
