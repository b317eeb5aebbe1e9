"""A fitted form: coefficients, covariance, range and residual, whatever it is of; and how coefficients are found.

Where the scatter about a form is more than that of counting, the covariance is widened by as much (quasi-likelihood,
McCullagh & Nelder 1989).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from pbekit.errors import PBEError

FEWEST_BROKEN = 10
"""Encounters that broke something, below which no law of breakup is fitted."""


@dataclass(frozen=True)
class FittedLaw:
    """Coefficients of a form, and what is known of them.

    Parameters
    ----------
    name, formula : of the form, and its text
    names : of the m coefficients
    coefficients : (m,)
    covariance : (m, m)
    validity : lowest and highest value of each argument that the fit rests on
    residual : largest residual, in the sense that `residual_of` gives
    residual_of : what the residual is of
    """

    name: str
    formula: str
    names: tuple[str, ...]
    coefficients: np.ndarray
    covariance: np.ndarray
    validity: dict[str, tuple[float, float]]
    residual: float
    residual_of: str
    constants: dict[str, float] = field(default_factory=dict)

    def coefficient(self, name: str) -> float:
        """The coefficient of this name."""
        return float(self.coefficients[self.names.index(name)])

    def within(self, **given: ArrayLike) -> None:
        """Refuse arguments outside the range of the fit; raises `PBEError`."""
        for name, values in given.items():
            low, high = self.validity[name]
            values = np.asarray(values, float)
            bad = ~((values >= low * (1 - 1e-9)) & (values <= high * (1 + 1e-9)))
            if np.any(bad):
                raise PBEError(
                    f"{self.name}: {name} = {np.ravel(values[bad])[0]:g}: expected from {low:g} to {high:g}, the range "
                    "over which "
                    "the law was fitted; beyond it nothing is known"
                )

    def record(self) -> dict[str, Any]:
        """All of it in plain types, as it stands in fit.json."""
        return {
            "formula": self.formula,
            "coefficients": dict(zip(self.names, map(float, self.coefficients), strict=True)),
            "standard_errors": dict(
                zip(self.names, map(float, np.sqrt(np.diag(self.covariance))), strict=True)
            ),
            "covariance": self.covariance.tolist(),
            "constants": self.constants,
            "valid": {name: list(ends) for name, ends in self.validity.items()},
            "largest_residual": self.residual,
            "largest_residual_of": self.residual_of,
        }


def weighted(x: np.ndarray, y: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and covariance of y = x c with weights; the scatter about it is that of the residuals."""
    root = np.sqrt(weight / weight.max())
    c, *_ = np.linalg.lstsq(x * root[:, None], y * root, rcond=None)
    return c, widened(x * root[:, None], (y - x @ c) * root)


def widened(slope: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Covariance (m, m) of coefficients of least squares: slopes (n, m) and residuals (n,), both weighted (sandwich)."""
    # As a square, so that no variance is below zero by round-off.
    root = np.linalg.pinv(slope.T @ slope) @ (slope * left[:, None]).T
    count, coefficients = slope.shape
    return count / max(count - coefficients, 1) * (root @ root.T)


def maximum(
    scores: Callable[[np.ndarray], np.ndarray], start: np.ndarray, event: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the sum of the scores is largest, and the covariance of that, events being independent (sandwich)."""
    size = len(scores(start))
    found = optimize.minimize(lambda t: -scores(t).sum() / size, start, method="BFGS", options={"gtol": 1e-6})
    t, step, m = found.x, 1e-3, len(start)
    unit = np.eye(m) * step
    total = lambda s: scores(s).sum()
    slope = np.stack([(scores(t + u) - scores(t - u)) / (2 * step) for u in unit], axis=1)
    hessian = np.array(
        [
            [total(t + u + v) - total(t + u - v) - total(t - u + v) + total(t - u - v) for v in unit]
            for u in unit
        ]
    ) / (4 * step**2)
    events = np.unique(event, return_inverse=True)[1]
    per_event = np.stack([np.bincount(events, slope[:, k]) for k in range(m)], axis=1)
    inverse = np.linalg.pinv(hessian)
    return t, inverse @ (per_event.T @ per_event) @ inverse
