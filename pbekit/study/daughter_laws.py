"""Into what encounters break: fragments of a pair, and parts of an aggregate that itself falls apart.

daughters     mass-weighted density over x = P_f/(P_i + P_j): two beta peaks, of means m, concentrations c and shares w
parts         of an aggregate that itself falls apart, over x = P_f/P_i: two, x and 1 - x, of density ~ (x (1 - x))^(c - 1)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import special, stats

from pbekit.balance.breakage import BetaSplit, TwoBeta
from pbekit.study.fitted_form import FEWEST_BROKEN, FittedLaw, maximum
from pbekit.tables.kernel_table import SCATTERED, UNRESOLVED, KernelTable


@dataclass(frozen=True)
class DaughtersLaw(FittedLaw):
    """Two beta peaks of the mass-weighted density over x = P_f/(P_i + P_j)."""

    @property
    def daughters(self) -> TwoBeta:
        """As the balance takes them."""
        return TwoBeta(*map(float, self.coefficients))

    def __call__(self, x: ArrayLike) -> np.ndarray:
        """The mass-weighted density, of integral one."""
        self.within(x=x)
        return self.daughters.mass_density(np.asarray(x, float))


@dataclass(frozen=True)
class PartsLaw(FittedLaw):
    """Two parts of a parent, x and 1 - x."""

    @property
    def daughters(self) -> BetaSplit:
        """As the balance takes them."""
        return BetaSplit(self.coefficient("c"))

    def __call__(self, x: ArrayLike) -> np.ndarray:
        """The mass-weighted density, of integral one."""
        self.within(x=x)
        x = np.asarray(x, float)
        return stats.beta.pdf(x, self.coefficient("c") + 1, self.coefficient("c"))


def daughters_law(tables: Sequence[KernelTable]) -> DaughtersLaw | None:
    """By maximum likelihood, each fragment with its mass; encounters are what is independent."""
    share, event, count = [], [], 0
    for table in tables:
        r = table.records
        rows = np.isin(r.outcome, SCATTERED)[r.encounter_of_product]
        of = r.encounter_of_product[rows]
        share.append(r.product_size[rows] / r.size.sum(axis=1)[of])
        event.append(of + count)
        count += len(r)
    x, of = np.concatenate(share), np.concatenate(event)
    if np.unique(of).size < FEWEST_BROKEN:
        return None

    def coefficients(t: np.ndarray) -> np.ndarray:
        w, m_1, m_2 = special.expit(t[[0, 1, 3]])
        # a > 1 in both peaks, so that the number of fragments is finite: c > 1/m.
        return np.array([w, m_1, 1.0 / m_1 + np.exp(t[2]), m_2, 1.0 / m_2 + np.exp(t[4])])

    def law(t: np.ndarray) -> TwoBeta:
        return TwoBeta(*map(float, coefficients(t)))

    mean = np.average(x, weights=x)
    start = np.array([0.0, special.logit(0.8 * mean), 1.0, special.logit(min(1.3 * mean, 0.95)), 1.0])
    t, spread = maximum(lambda t: x * np.log(law(t).mass_density(x)), start, of)
    step = 1e-5
    jacobian = np.stack(
        [(coefficients(t + u) - coefficients(t - u)) / (2 * step) for u in np.eye(5) * step], axis=1
    )
    fitted = law(t)
    return DaughtersLaw(
        "daughters",
        "w beta(x; m_1 c_1, (1 - m_1) c_1) + (1 - w) beta(x; m_2 c_2, (1 - m_2) c_2), mass-weighted",
        ("w", "m_1", "c_1", "m_2", "c_2"),
        coefficients(t),
        jacobian @ spread @ jacobian.T,
        {"x": (0.0, 1.0)},
        _apart(x, fitted.mass_below),
        "mass of fragments below x, of one",
        {
            "mean_number": float(len(x) / np.unique(of).size),
            "mean_number_of_the_law": float(fitted.number_below(np.ones(1))[0]),
        },
    )


def parts_law(tables: Sequence[KernelTable]) -> PartsLaw | None:
    """Of parents whose primaries are in more products than one."""
    share, event, count = [], [], 0
    for table in tables:
        r = table.records
        resolved = (r.outcome != UNRESOLVED)[r.encounter_of_product]
        of, first = r.encounter_of_product, r.product_from_first
        for side, own in enumerate((first, r.product_size - first)):
            pieces = np.bincount(of, own > 0, len(r))
            rows = resolved & (pieces[of] > 1) & (own > 0) & (own < r.size[of, side])
            share.append(own[rows] / r.size[of[rows], side])
            event.append(2 * of[rows] + side + count)
        count += 2 * len(r)
    x, of = np.concatenate(share), np.concatenate(event)
    if np.unique(of).size < FEWEST_BROKEN:
        return None

    def scores(t: np.ndarray) -> np.ndarray:
        c = np.exp(t[0])
        return x * stats.beta.logpdf(np.clip(x, 1e-9, 1 - 1e-9), c + 1, c)

    t, spread = maximum(scores, np.zeros(1), of)
    c = float(np.exp(t[0]))
    return PartsLaw(
        "parts",
        "beta(x; c + 1, c), mass-weighted: two parts, x and 1 - x",
        ("c",),
        np.array([c]),
        spread * c**2,
        {"x": (0.0, 1.0)},
        _apart(x, lambda v: special.betainc(c + 1, c, v)),
        "mass of parts below x, of one",
        {"mean_number": float(len(x) / np.unique(of).size), "events": float(np.unique(of).size)},
    )


def _apart(x: np.ndarray, below: Callable[[np.ndarray], np.ndarray]) -> float:
    """Largest distance of the mass below x from that of a law, taken in the middle of each step."""
    value, at = np.unique(x, return_inverse=True)
    mass = np.bincount(at, x) / x.sum()
    middle = np.cumsum(mass) - 0.5 * mass
    return float(np.abs(middle - below(value)).max())
