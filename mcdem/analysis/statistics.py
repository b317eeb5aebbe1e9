"""Numbers of a population and its history, each with its error.

Time series are event-driven: ``values[k]`` holds from ``times[k]`` until ``times[k + 1]``; averages are over time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Floats = NDArray[np.float64]

CONFIDENCE = 0.95

# Moments of one population


@dataclass(frozen=True)
class SizeMoments:
    """Moments of the aggregates of one population."""

    mean_size: float
    """<P>"""
    size_deviation: float
    """sigma_P, over the population"""
    sauter_diameter: float
    """d32 = 2 sum R^3 / sum R^2 [m] (Frungieri & Vanni, Eq. 24)"""


def size_moments(sizes: ArrayLike, outer_radii: ArrayLike) -> SizeMoments:
    """Moments of aggregates of `sizes` (A,) and `outer_radii` (A,) [m]."""
    p, r = np.asarray(sizes, dtype=float), np.asarray(outer_radii, dtype=float)
    return SizeMoments(float(p.mean()), float(p.std()), float(2 * (r**3).sum() / (r**2).sum()))


# Mass and size


@dataclass(frozen=True)
class PowerLaw:
    """y = prefactor x^exponent by least squares in logarithms, with 95 % limits."""

    exponent: float
    exponent_low: float
    exponent_high: float
    prefactor: float
    prefactor_low: float
    prefactor_high: float
    points: int
    """points fitted"""
    distinct: int
    """points that differ; exact copies (a doubled population) tell nothing new and earn no confidence"""

    def __call__(self, x: ArrayLike) -> Floats:
        return np.asarray(self.prefactor * np.asarray(x, dtype=float) ** self.exponent)


def fit_power_law(x: ArrayLike, y: ArrayLike) -> PowerLaw | None:
    """None where fewer than three distinct points, or a single x, leave the exponent open."""
    points = np.log(np.column_stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)]))
    distinct = len(np.unique(points.round(9), axis=0))
    if distinct < 3 or np.ptp(points[:, 0]) == 0:
        return None
    u, v = points.T
    fit = stats.linregress(u, v)
    # Errors as if every distinct point had been seen once: residual scatter over `distinct` degrees of freedom.
    residual = v - fit.intercept - fit.slope * u
    variance = (residual**2).mean() * distinct / (distinct - 2)
    t = stats.t.ppf(0.5 + CONFIDENCE / 2, distinct - 2)
    slope_error = t * np.sqrt(variance / (distinct * u.var()))
    level_error = t * np.sqrt(variance / distinct * (1 + u.mean() ** 2 / u.var()))
    return PowerLaw(
        float(fit.slope),
        float(fit.slope - slope_error),
        float(fit.slope + slope_error),
        float(np.exp(fit.intercept)),
        float(np.exp(fit.intercept - level_error)),
        float(np.exp(fit.intercept + level_error)),
        len(points),
        distinct,
    )


SMALLEST_FITTED = 4
"""Clusters of P > 3 enter the mass-size fits (Frungieri & Vanni, section 3.2): smaller ones have a fixed geometry."""


Given = Literal["size", "length"]
"""Which of the two a mass-size fit takes as given, the other scattering about the law."""
GIVENS: tuple[Given, ...] = ("size", "length")


def fit_mass_size(
    sizes: ArrayLike, lengths: ArrayLike, radius: float, given: Given = "size"
) -> PowerLaw | None:
    """P = k (length/a)^d over clusters of P > 3 (Eq. 26).

    lengths : (A,) [m] radii of gyration for d_g, k_g; outer radii for d_o, k_o
    given : what the regression takes as given. "size": ln length against ln P, then solved for P; "length": ln P against
        ln length. Aggregates of one P differ in shape, so the exponents differ by the square of the correlation: in the
        suspension of Frungieri & Vanni at 1000 Pa 1.7 and 1.5. They do not say which was theirs.
    """
    p, length = np.asarray(sizes, dtype=float), np.asarray(lengths, dtype=float)
    fitted = p >= SMALLEST_FITTED
    p, length = p[fitted], length[fitted] / radius
    if given == "length":
        return fit_power_law(length, p)
    fit = fit_power_law(p, length)
    return _solved_for_x(fit, np.log(p).mean()) if fit and fit.exponent > 0.0 else None


def _solved_for_x(fit: PowerLaw, mean_log_x: float) -> PowerLaw:
    """The law with its sides changed, x = k y^d; limits to first order in the errors (Fieller 1954, far from zero slope)."""
    exponent, log_k = 1.0 / fit.exponent, -np.log(fit.prefactor) / fit.exponent
    slope_error = 0.5 * (fit.exponent_high - fit.exponent_low)
    level_error = 0.5 * np.log(fit.prefactor_high / fit.prefactor_low)
    # of the fit's value at ln x = ln k, from the errors of its slope and of its level at 0, correlated by -mean ln x
    error = exponent * np.sqrt(
        max(level_error**2 + (log_k**2 - 2.0 * log_k * mean_log_x) * slope_error**2, 0.0)
    )
    return PowerLaw(
        exponent,
        1.0 / fit.exponent_high,
        1.0 / fit.exponent_low if fit.exponent_low > 0.0 else np.inf,
        float(np.exp(log_k)),
        float(np.exp(log_k - error)),
        float(np.exp(log_k + error)),
        fit.points,
        fit.distinct,
    )


# Averages over time

FEWEST_BLOCKS = 4
"""Blocks as long as a quarter of the stretch.  <P> remembers for some seconds, of runs of 100 s.  Of a series whose memory is a
20th of the stretch (Ornstein & Uhlenbeck's process) limits of two errors hold the mean in 88 of 100 cases with 4 blocks, in
79 with 16; where it is a 5th, in 70 and in 46 (`tests/test_statistics.py`)."""
FINEST_BLOCKS = 1024


@dataclass(frozen=True)
class TimeAverage:
    """Mean of a series over a stretch of time."""

    mean: float
    error: float
    """standard error, by blocks"""
    start: float
    stop: float


def block_means(times: Floats, values: Floats, start: float, stop: float, blocks: int) -> Floats:
    """Exact means of the piecewise constant series over equal stretches of time. (blocks,)"""
    integral = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(times))])
    knots, area = times, integral
    if stop > times[-1]:
        knots, area = (
            np.append(times, stop),
            np.append(integral, integral[-1] + values[-1] * (stop - times[-1])),
        )
    edges = np.linspace(start, stop, blocks + 1)
    return np.diff(np.interp(edges, knots, area)) / np.diff(edges)


def time_average(
    times: ArrayLike, values: ArrayLike, start: float | None = None, stop: float | None = None
) -> TimeAverage:
    """Mean over [start, stop] with a block-averaged error (Flyvbjerg & Petersen 1989).

    Neighbouring blocks are joined until four are left; the largest standard error met on the way is taken, which stops
    growing once blocks are longer than the memory of the series.
    """
    t, v = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    start, stop = float(t[0] if start is None else start), float(t[-1] if stop is None else stop)
    if not start < stop:
        return TimeAverage(float(v[-1]), np.inf, start, stop)
    blocks = block_means(t, v, start, stop, FINEST_BLOCKS)
    mean, error = float(blocks.mean()), 0.0
    while len(blocks) >= FEWEST_BLOCKS:
        error = max(error, float(blocks.std(ddof=1) / np.sqrt(len(blocks))))
        blocks = 0.5 * (blocks[::2] + blocks[1::2])
    return TimeAverage(mean, error, start, stop)


# Steady state

LARGEST_DIFFERENCE = 2.0
SMALLEST_CHANGE = 0.02
"""Relative difference of the two halves that is never called a change: with enough aggregates a test of significance sees
any drift, and the wish is a level known to some per cent."""
LARGEST_RELATIVE_ERROR = 0.10
FEWEST_TURNOVERS = 10.0
EARLIEST_STARTS = np.arange(0.0, 0.61, 0.1)


@dataclass(frozen=True)
class SteadyState:
    """Whether and from when a run is steady."""

    reached: bool
    start: float
    """from here on the run counts as steady; where it does not, the start of its last 40 % [s]"""
    reason: str


STEADY_TEST = (
    "from some moment in the first 60 % of the run on, the means of each series over the first and the second half "
    "of what is left differ by less than 2 % or less than 2 standard errors of such a difference, by the blocks of the "
    "second half, each mean is known to 10 %, and every aggregate has been replaced ten times on average"
)


def find_steady_state(
    times: ArrayLike, series: Mapping[str, ArrayLike], turnovers: ArrayLike | None = None
) -> SteadyState:
    """The earliest start in the first 60 % of the run from which every series is steady.

    The two halves of what is left must agree within 2 % or 2 standard errors of their difference (Geweke 1992), by the
    scatter of the second; the error of each mean be below 10 %; and the population have been renewed ten times, so that a
    short run cannot pass for a steady one.

    turnovers : (T,) aggregates born until then, over the number there is; not asked for when None
    """
    t = np.asarray(times, dtype=float)
    renewed = None if turnovers is None else np.asarray(turnovers, dtype=float)
    end, why = float(t[-1]), ""
    for start in t[0] + EARLIEST_STARTS * (end - t[0]):
        middle, why = 0.5 * (start + end), ""
        for name, values in series.items():
            early, late = time_average(t, values, start, middle), time_average(t, values, middle, end)
            whole = time_average(t, values, start, end)
            # Of a steady series the halves scatter alike; growth within the first must not excuse itself.
            gap, error = abs(late.mean - early.mean), float(np.sqrt(2.0) * late.error)
            if not gap <= max(LARGEST_DIFFERENCE * error, SMALLEST_CHANGE * abs(whole.mean)):
                why = (
                    f"{name} still changes: {early.mean:.4g} +- {early.error:.2g} before "
                    f"{middle:.4g} s, {late.mean:.4g} +- {late.error:.2g} after"
                )
            elif not whole.error <= LARGEST_RELATIVE_ERROR * abs(whole.mean):
                why = f"{name} is known to {whole.error / abs(whole.mean):.0%} only"
            if why:
                break
        if not why and renewed is not None:
            since = float(renewed[-1] - np.interp(start, t, renewed))
            if since < FEWEST_TURNOVERS:
                why = f"aggregates were replaced {since:.2g} times only"
        if not why:
            return SteadyState(True, float(start), f"steady from {start:.4g} s on")
    return SteadyState(False, float(t[0] + EARLIEST_STARTS[-1] * (end - t[0])), why)


# Shares


def share(hits: int, count: int) -> tuple[float, float, float]:
    """hits/count with its 95 % limits (Wilson 1927); (nan, 0, 1) of nothing."""
    if count == 0:
        return float("nan"), 0.0, 1.0
    limits = stats.binomtest(int(hits), int(count)).proportion_ci(CONFIDENCE, method="wilson")
    return hits / count, float(limits.low), float(limits.high)
