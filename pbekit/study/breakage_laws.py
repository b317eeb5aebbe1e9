"""Breakage of first order that encounters amount to (`size_rates`), over sizes: a power, and a step.

    power    S = k phi g P^q (N/N_0)^p
    step     S = k phi g P^q [s + 1/(1 + (P_c/P)^m)],   P_c = P_0 (N/N_0)^(-r)

Encounters at a glance erode small aggregates at a low rate, nearly all that large ones have break them: between both S rises a
hundred times within a quarter of the size at which static loads meet the strength of contacts.  A power cannot follow that, and
is what OpenFOAM and OpenQBMM can take; the step is a floor, the share s of the rate above, and a logistic in ln P.
Either is fitted to ln S, each size with its share of the broken mass.  Rates of a table are alike within a class of its
sizes and jump between classes, so part of either's residual is of the classes: what is left of it when both are averaged over
them, each size by its number, is `constants["residual_of_classes"]`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special

from pbekit.arguments import number
from pbekit.errors import PBEError
from pbekit.study.fitted_form import FEWEST_BROKEN, FittedLaw, widened
from pbekit.study.size_rates import SizeRates

HELD = 0.98
"""Share of the broken mass in the sizes over which the laws are fitted and hold."""
WIDTH = 4.4
"""Over m, the width in ln P of a logistic from a tenth to nine: no steeper one is fitted than the widest class can resolve."""
FINEST = WIDTH / 60.0
"""Width that stands for classes of one size each."""


@dataclass(frozen=True)
class BreakageLaw(FittedLaw):
    """S = k phi g P^q (N/N_0)^p."""

    def __call__(
        self, size: ArrayLike, volume_fraction: float, shear_rate: float, cohesion: float | None = None
    ) -> np.ndarray:
        """S [1/s] of parents of so many primaries."""
        p = np.asarray(size, float)
        self.within(P=p)
        number("volume fraction", volume_fraction, 0.0, 1.0)
        number("shear rate", shear_rate, 0.0, 1e12)
        return volume_fraction * shear_rate * np.exp(self._log_rate(np.log(p), self._relative(cohesion)))

    def _relative(self, cohesion: float | None) -> float:
        """ln(N/N_0)."""
        if cohesion is None or "N_0" not in self.constants:
            if cohesion is not None and "N" not in self.validity:
                raise PBEError(f"{self.name}: cohesion = {cohesion}: fitted at one alone, expected none")
            return 0.0
        self.within(N=cohesion)
        return float(np.log(cohesion / self.constants["N_0"]))

    def _log_rate(self, log_size: np.ndarray, relative: float) -> np.ndarray:
        """ln(S/(phi g))."""
        p = self.coefficient("p") if "p" in self.names else 0.0
        return np.log(self.coefficient("k")) + self.coefficient("q") * log_size + p * relative


@dataclass(frozen=True)
class BreakageStepLaw(BreakageLaw):
    """S = k phi g P^q [s + 1/(1 + (P_c/P)^m)], P_c = P_0 (N/N_0)^(-r)."""

    def critical_size(self, cohesion: float | None = None) -> float:
        """P_c, about which S rises."""
        r = self.coefficient("r") if "r" in self.names else 0.0
        return float(self.coefficient("P_0") * np.exp(-r * self._relative(cohesion)))

    def _log_rate(self, log_size: np.ndarray, relative: float) -> np.ndarray:
        k, q, s, p_0, m = (self.coefficient(name) for name in ("k", "q", "s", "P_0", "m"))
        r = self.coefficient("r") if "r" in self.names else 0.0
        return _step(
            np.array([np.log(k), q, np.log(s), np.log(p_0), np.log(m), r]),
            log_size,
            np.full_like(log_size, relative),
        )


def _step(t: np.ndarray, log_size: np.ndarray, relative: np.ndarray) -> np.ndarray:
    """ln(S/(phi g)) of ln k, q, ln s, ln P_0, ln m (and r) at ln P and ln(N/N_0)."""
    r = t[5] if t.size > 5 else 0.0
    steps = special.log_expit(np.exp(t[4]) * (log_size - t[3] + r * relative))
    return t[0] + t[1] * log_size + np.logaddexp(t[2], steps)


@dataclass(frozen=True)
class _Data:
    """What the laws are fitted to.

    size, rate : (n,) P, and S/(phi g)
    weight : (n,) share of the broken mass of its table
    number : (n,) aggregates per volume
    relative : (n,) ln(N/N_0); 0 where there is one table
    group : (n,) the table's class of sizes
    cohesion : of several tables
    widest : logarithm of the ratio of the edges of the widest class of several sizes
    """

    size: np.ndarray
    rate: np.ndarray
    weight: np.ndarray
    number: np.ndarray
    relative: np.ndarray
    group: np.ndarray
    cohesion: tuple[float, ...]
    widest: float

    @classmethod
    def of(cls, every: Sequence[SizeRates], cohesion: np.ndarray) -> _Data | None:
        """From rates of tables; None where too little broke."""
        rows: list[tuple[np.ndarray, ...]] = []
        used: list[float] = []
        widest = 0.0
        for one, n in zip(every, cohesion, strict=True):
            first = one.first_order
            if first is None or one.broken.sum() < FEWEST_BROKEN:
                continue
            s = first.breakage.value
            flux = s * first.population * one.pivots
            order = np.argsort(-flux)
            kept = order[: int(np.searchsorted(np.cumsum(flux[order]) / flux.sum(), HELD)) + 1]
            kept = np.sort(kept[one.pivots[kept] <= one.table.records.size.max()])
            group = np.searchsorted(one.table.size_edges, one.pivots[kept], side="right")
            edges = one.table.size_edges.astype(float)
            own = np.unique(group[group < edges.size])
            own = own[edges[own] - edges[own - 1] > 1.5]
            widest = max(widest, np.log(edges[own] / edges[own - 1]).max(initial=FINEST))
            rows.append(
                (
                    one.pivots[kept],
                    s[kept] / (first.volume_fraction * one.table.shear_rate),
                    flux[kept] / flux[kept].sum(),
                    first.population[kept],
                    np.full(kept.size, np.log(n)),
                    group + 10_000 * len(rows),
                )
            )
            used.append(float(n))
        if sum(row[0].size for row in rows) < 3:
            return None
        size, rate, weight, numbers, log_n, group = (np.concatenate(part) for part in zip(*rows, strict=True))
        several = len(set(used)) > 1
        relative = log_n - np.log(used).mean() if several else np.zeros(size.size)
        return cls(size, rate, weight, numbers, relative, group, tuple(used) if several else (), widest)

    @property
    def about(self) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
        """Constants and validity of a law that is fitted to this."""
        validity = {"P": (float(self.size.min()), float(self.size.max()))}
        if not self.cohesion:
            return {}, validity
        validity["N"] = (min(self.cohesion), max(self.cohesion))
        return {"N_0": float(np.exp(np.log(self.cohesion).mean()))}, validity

    def residuals(self, log_rate: np.ndarray) -> tuple[float, float, float]:
        """Of a fit: largest of a size, largest of a class, and root of the mean square of the logarithm's."""
        at, fit = np.unique(self.group, return_inverse=True)[1], np.exp(log_rate)
        sums = [np.bincount(at, self.number * s) for s in (fit, self.rate)]
        apart = log_rate - np.log(self.rate)
        typical = np.sqrt(self.weight @ apart**2 / self.weight.sum())
        return (
            float(np.abs(np.expm1(apart)).max()),
            float(np.abs(sums[0] / sums[1] - 1).max()),
            float(typical),
        )


def _found(
    data: _Data,
    form: Callable[[np.ndarray], np.ndarray],
    starts: Sequence[np.ndarray],
    bounds: tuple[ArrayLike, ArrayLike],
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of least squares in ln S, from the best of several starts, and their covariance."""
    root, y = np.sqrt(data.weight / data.weight.max()), np.log(data.rate)
    tries = [
        optimize.least_squares(
            lambda t: root * (form(t) - y), start, bounds=bounds, x_scale="jac", max_nfev=4000
        )
        for start in starts
    ]
    best = min(tries, key=lambda found: found.cost)
    return best.x, widened(best.jac, -best.fun)


def _law(
    kind: type[BreakageLaw],
    formula: str,
    names: Sequence[str],
    logs: Sequence[str],
    data: _Data,
    found: tuple[np.ndarray, np.ndarray],
    log_rate: np.ndarray,
) -> BreakageLaw:
    """A law from coefficients of which those in `logs` are logarithms."""
    t, covariance = found
    is_log = np.isin(names, list(logs))
    c = np.where(is_log, np.exp(np.where(is_log, t, 0.0)), t)
    slope = np.diag(np.where(is_log, c, 1.0))
    constants, validity = data.about
    largest, of_classes, typical = data.residuals(log_rate)
    constants |= {
        "residual_of_classes": of_classes,
        "typical_residual_of_the_logarithm": typical,
        "values": float(data.size.size),
    }
    return kind(
        "breakage", formula, tuple(names), c, slope @ covariance @ slope, validity, largest,
        f"S of the sizes that make {100 * HELD:g} % of the broken mass, relative", constants,
    )  # fmt: skip


def power_law(every: Sequence[SizeRates], cohesion: np.ndarray) -> BreakageLaw | None:
    """ln S over ln P (and ln N); None where too little broke."""
    data = _Data.of(every, cohesion)
    if data is None:
        return None
    names = ["k", "q", *(["p"] if data.cohesion else [])]
    log_size, more = np.log(data.size), len(names) - 2

    def form(t: np.ndarray) -> np.ndarray:
        return t[0] + t[1] * log_size + (t[2] * data.relative if more else 0.0)

    found = _found(data, form, [np.r_[-10.0, 3.0, np.zeros(more)]], (-np.inf, np.inf))
    formula = "S = k phi g P^q" + (" (N/N_0)^p" if more else "")
    return _law(BreakageLaw, formula, names, ["k"], data, found, form(found[0]))


def step_law(every: Sequence[SizeRates], cohesion: np.ndarray) -> BreakageStepLaw | None:
    """A floor and a logistic in ln P; None where too little broke, or too few sizes are seen for its coefficients."""
    data = _Data.of(every, cohesion)
    names = ["k", "q", "s", "P_0", "m", *(["r"] if data is not None and data.cohesion else [])]
    if data is None or data.size.size < len(names) + 3:
        return None
    log_size, more = np.log(data.size), len(names) - 5
    low, high = log_size.min(), log_size.max()
    form = lambda t: _step(t, log_size, data.relative)
    starts = [
        np.r_[-3.0, 1.0, -5.0, low + share * (high - low), np.log(m), np.full(more, 2.0)]
        for share in (0.3, 0.5, 0.7)
        for m in (0.3 * WIDTH / data.widest, 0.8 * WIDTH / data.widest)
    ]
    # The step lies within the sizes that are seen: outside of them it would be a power of another name.
    bounds = (
        np.r_[-60.0, -10.0, -30.0, low, 0.0, np.full(more, -10.0)],
        np.r_[60.0, 20.0, 0.0, high, np.log(WIDTH / data.widest), np.full(more, 10.0)],
    )
    found = _found(data, form, starts, bounds)
    formula = "S = k phi g P^q (s + 1/(1 + (P_c/P)^m)), P_c = P_0" + (" (N/N_0)^(-r)" if more else "")
    law = _law(BreakageStepLaw, formula, names, ["k", "s", "P_0", "m"], data, found, form(found[0]))
    assert isinstance(law, BreakageStepLaw)
    return law


def preferred(power: BreakageLaw | None, step: BreakageStepLaw | None) -> BreakageLaw | None:
    """The one that the data bear: of the lower information criterion (Schwarz 1978) in the values of ln S."""
    if power is None or step is None:
        return power

    def criterion(law: BreakageLaw) -> float:
        n = law.constants["values"]
        typical = max(law.constants["typical_residual_of_the_logarithm"], 1e-12)
        return 2.0 * n * float(np.log(typical)) + len(law.names) * float(np.log(n))

    return step if criterion(step) < criterion(power) else power
