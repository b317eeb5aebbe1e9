"""How wrong an interpolation between stresses is, estimated by leaving tables out.

A quantity interpolated in the logarithm of stress between s_1 and s_2 is off, to second order, by its curvature times
ln(s/s_1) ln(s_2/s), the *gap*.  Each inner table, left out and predicted from its neighbours, gives one value of that
curvature (of the quantity's logarithm); their mean square is its variance, and Student's t with as many degrees of freedom
widens the band for how few they are.  Curvature is taken to scatter about zero from stress to stress.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from pbekit.arguments import LEVEL
from pbekit.balance.population_balance import PopulationBalance
from pbekit.estimated_rates.estimated_rates import EstimatedRates
from pbekit.estimated_rates.stress_interpolation import InterpolatedRates, stress_of
from pbekit.study.uncertainty import band

Outputs = Mapping[str, np.ndarray | float]


def gap_of(lower: float, stress: float, upper: float) -> float:
    """ln(s/s_1) ln(s_2/s), to which the error of an interpolation is in proportion."""
    return float(np.log(stress / lower) * np.log(upper / stress))


@dataclass(frozen=True)
class InterpolationError:
    """Curvature of the logarithm of one quantity over ln stress.

    curvature : (...) root mean square over the tables left out
    tables : how many were left out
    """

    curvature: np.ndarray
    tables: int

    @classmethod
    def of(
        cls, own: Sequence[np.ndarray | float], predicted: Sequence[np.ndarray | float], gaps: Sequence[float]
    ) -> InterpolationError:
        """From values of tables (n, ...), what their neighbours predict for them (n, ...), and their gaps (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            off = np.log(np.asarray(own, float) / np.asarray(predicted, float))
        # Zero, such as the spread of sizes at the start, is predicted without error.
        each = np.nan_to_num(off) / np.reshape(gaps, (-1,) + (1,) * (off.ndim - 1))
        return cls(np.sqrt((each**2).mean(axis=0)), len(each))

    def half_width(self, gap: float, level: float = LEVEL) -> np.ndarray:
        """(...) of the logarithm, at a stress of this gap."""
        return stats.t.ppf(0.5 * (1 + level), self.tables) * self.curvature * gap

    def widened(self, value: ArrayLike, draws: np.ndarray, gap: float, level: float = LEVEL) -> np.ndarray:
        """(2, ...) band of an interpolated `value` from draws (n, ...) of the tables and the interpolation's own error.

        The two are independent: half widths of the logarithm add in squares.  Draws are taken about their own median, as an
        interpolation's bend of it is part of the error that tables left out show.
        """
        value, drawn = np.asarray(value, float), np.asarray(draws, float)
        low, high = band(drawn, level)
        middle = np.median(drawn, axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            below, above = (np.nan_to_num(np.log(a / b)) for a, b in ((middle, low), (high, middle)))
        own = self.half_width(gap, level)
        return np.stack([value * np.exp(-np.hypot(below, own)), value * np.exp(np.hypot(above, own))])


def leave_out(
    rates_of_tables: Sequence[EstimatedRates],
    output: Callable[[PopulationBalance], Outputs],
    own: Sequence[Outputs],
) -> dict[str, InterpolationError]:
    """The error of interpolation of each output; empty where no table lies between two others.

    rates_of_tables : of tables in ascending order of stress, on one grid; own : what `output` gives for each of them
    """
    gaps, predicted = [], []
    for k in range(1, len(rates_of_tables) - 1):
        below, here, above = (stress_of(c.table) for c in rates_of_tables[k - 1 : k + 2])
        gaps.append(gap_of(below, here, above))
        predicted.append(
            output(InterpolatedRates.of(rates_of_tables[k - 1], rates_of_tables[k + 1], here).mean)
        )
    if not gaps:
        return {}
    return {
        name: InterpolationError.of([row[name] for row in own[1:-1]], [row[name] for row in predicted], gaps)
        for name in predicted[0]
    }
