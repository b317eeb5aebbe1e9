"""Numbers of a population and its history, each with its error.

Time series are event-driven: ``values[k]`` holds from ``times[k]`` until ``times[k + 1]``; averages are over time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse, spatial, stats

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
    """y = prefactor x^exponent by least squares in logarithms, with 95 % limits, and what it rests on."""

    exponent: float
    exponent_low: float
    exponent_high: float
    prefactor: float
    prefactor_low: float
    prefactor_high: float
    points: int
    """points given"""
    origins: int
    """of how many origins they are; each counts once"""
    sizes: int
    """distinct x among these"""
    decades: float
    """range of x"""

    def __call__(self, x: ArrayLike) -> Floats:
        return np.asarray(self.prefactor * np.asarray(x, dtype=float) ** self.exponent)

    @property
    def rests_on(self) -> str:
        """In words for a legend."""
        return f"{self.origins} of {self.sizes} sizes over {self.decades:.2f} decades"


@dataclass(frozen=True)
class Minimum:
    """What a power law is not fitted without."""

    origins: int
    """points that owe nothing to each other"""
    sizes: int
    """distinct x"""
    decades: float
    """range of x"""


OF_AGGREGATES = Minimum(origins=10, sizes=4, decades=0.3)
"""Aggregates scatter: of fewer, or of sizes within a factor of two, an exponent says nothing that its limits would not."""
OF_MEANS = Minimum(origins=3, sizes=3, decades=0.1)
"""Points that are each a mean over many, or computed without scatter: sizes against stress, a family of shapes."""


def origins_of(*columns: ArrayLike) -> NDArray[np.intp]:
    """(A,) which rows are of one origin: all columns alike to a part in a thousand.

    Doubling a population adds an exact copy of each aggregate, and most copies shear on for long before anything happens to
    them but small shifts; an aggregate that is left alone from one snapshot to the next is the same twice.  Chance likeness
    (there is one tetrahedron) counts as one origin too, which widens limits and never narrows them.

    Parameters
    ----------
    *columns : (A,) array_like
        What is compared, such as sizes and radii; any units.

    Returns
    -------
    (A,) integers
        The same for rows of one origin.

    Examples
    --------
    >>> from mcdem.analysis import origins_of
    >>> origins_of([3, 7, 3], [1.0e-6, 2.0e-6, 1.0001e-6]).tolist()
    [0, 1, 0]
    """
    rows = np.column_stack([np.asarray(column, dtype=float) for column in columns])
    if not len(rows):
        return np.empty(0, dtype=np.intp)
    logs = np.log(rows, where=rows > 0.0, out=np.full_like(rows, -1e3))
    # Equal rows first: of a thousand single primaries all pairs are alike.
    distinct, of = np.unique(logs.round(9), axis=0, return_inverse=True)
    alike = spatial.cKDTree(distinct).query_pairs(1e-3, p=np.inf, output_type="ndarray")
    links = sparse.coo_array((np.ones(len(alike)), alike.T), shape=(len(distinct),) * 2)
    return np.asarray(sparse.csgraph.connected_components(links, directed=False)[1])[of.ravel()]


def why_no_fit(x: ArrayLike, origin: ArrayLike | None = None, minimum: Minimum = OF_AGGREGATES) -> str:
    """What is missing for a power law in these x, in words; empty where nothing is."""
    x = np.asarray(x, dtype=float)
    origins = len(x) if origin is None else len(np.unique(np.asarray(origin)))
    sizes = len(np.unique(x.round(12 - int(np.ceil(np.log10(x.max())))))) if len(x) and x.max() > 0.0 else 0
    decades = float(np.log10(x.max() / x.min())) if sizes > 1 else 0.0
    if origins >= minimum.origins and sizes >= minimum.sizes and decades >= minimum.decades - 1e-9:
        return ""
    return (
        f"no exponent from {origins} of {sizes} sizes over {decades:.2f} decades "
        f"(at least {minimum.origins}, {minimum.sizes} and {minimum.decades:g})"
    )


def _copies(x: ArrayLike, y: ArrayLike) -> NDArray[np.intp]:
    """Labels of points that are equal to nine digits."""
    points = np.log(np.column_stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)]))
    return np.asarray(np.unique(points.round(9), axis=0, return_inverse=True)[1]).ravel()


def fit_power_law(
    x: ArrayLike, y: ArrayLike, origin: ArrayLike | None = None, minimum: Minimum = OF_AGGREGATES
) -> PowerLaw | None:
    """Least squares of ln y on ln x, or None where `why_no_fit` says what is missing.

    Points of one origin are not independent, so each origin counts once, by the mean of its logarithms, and the limits are
    Student's over origins.  They hold at their stated rate, which the percentiles of a bootstrap over origins do not (0.89 to
    0.92 of 0.95 with 12 to 60 origins of one to eight points).

    Parameters
    ----------
    x, y : (A,) positive numbers, in any unit
    origin : (A,) labels; None takes points that are equal to nine digits for copies of one another
    minimum : what is asked for

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.analysis import fit_power_law
    >>> size = np.arange(2.0, 40.0)
    >>> law = fit_power_law(size, 3.0 * size**0.5)
    >>> round(law.exponent, 3), round(law.prefactor, 3)
    (0.5, 3.0)

    Two sizes bear no exponent:

    >>> fit_power_law(np.array([10.0, 20.0]), np.array([1.0, 2.0])) is None
    True
    """
    points = np.log(np.column_stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)]))
    if not len(points):
        return None
    labels = (
        _copies(x, y) if origin is None else np.unique(np.asarray(origin), return_inverse=True)[1].ravel()
    )
    if why_no_fit(x, labels, minimum):
        return None
    count = np.bincount(labels)
    u, v = (np.bincount(labels, column) / count for column in points.T)
    if np.ptp(u) == 0.0:
        return None
    distinct = len(count)
    fit = stats.linregress(u, v)
    t = stats.t.ppf(0.5 + CONFIDENCE / 2, distinct - 2)
    # Not linregress' own errors: they go through the correlation, which cancels where it is nearly one.
    residual = v - fit.intercept - fit.slope * u
    variance = float(residual @ residual) / (distinct - 2)
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
        len(np.unique(np.exp(u).round(9))),
        float(np.ptp(points[:, 0]) / np.log(10.0)),
    )


SMALLEST_FITTED = 4
"""Clusters of P > 3 enter the mass-size fits (Frungieri & Vanni, section 3.2): smaller ones have a fixed geometry."""


Given = Literal["size", "length"]
"""Which of the two a mass-size fit takes as given, the other scattering about the law."""
GIVENS: tuple[Given, ...] = ("size", "length")


def fit_mass_size(
    sizes: ArrayLike,
    lengths: ArrayLike,
    radius: float,
    given: Given = "size",
    origin: ArrayLike | None = None,
) -> PowerLaw | None:
    """P = k (length/a)^d over clusters of P > 3 (Eq. 26); None where `why_no_fit` finds too few, by their P.

    Parameters
    ----------
    sizes : (A,) primaries P
    radius : of a primary [m]
    lengths : (A,) [m] radii of gyration for d_g, k_g; outer radii for d_o, k_o
    given : what the regression takes as given, the other scattering about the law. "size": ln length against ln P, then solved
        for P; "length": ln P against ln length. Aggregates of one P differ in shape, so the exponents differ by the square of
        the correlation: in the suspension of Frungieri & Vanni at 1000 Pa 1.7 and 1.5. They do not say which was theirs.
    origin : (A,) labels of what is not independent (`origins_of`); None takes those equal to nine digits for copies

    Examples
    --------
    >>> from mcdem.analysis import RunDataset, fit_mass_size
    >>> run = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")
    >>> last = run.population(-1, rigidity=False)
    >>> law = fit_mass_size(last["size"], last["radius_of_gyration"], run.radius)
    >>> f"P ~ R_g^{law.exponent:.1f}"
    'P ~ R_g^1.6'
    """
    p, length = np.asarray(sizes, dtype=float), np.asarray(lengths, dtype=float)
    fitted = p >= SMALLEST_FITTED
    p, length = p[fitted], length[fitted] / radius
    labels = _copies(p, length) if origin is None else np.asarray(origin)[fitted]
    if not len(p) or why_no_fit(p, labels):
        return None
    if given == "length":
        law = fit_power_law(length, p, labels, Minimum(OF_AGGREGATES.origins, 3, 0.0))
        # What it rests on is stated in primaries, whichever way the regression goes.
        return law and replace(law, sizes=len(np.unique(p)), decades=float(np.log10(p.max() / p.min())))
    fit = fit_power_law(p, length, labels)
    return _solved_for_x(fit, _mean_log(p, labels)) if fit and fit.exponent > 0.0 else None


def _mean_log(x: Floats, labels: NDArray[np.intp]) -> float:
    """Mean of ln x in which every origin counts once."""
    groups = np.unique(labels, return_inverse=True)[1].ravel()
    return float((np.bincount(groups, np.log(x)) / np.bincount(groups)).mean())


def _solved_for_x(fit: PowerLaw, mean_log_x: float) -> PowerLaw:
    """The law with its sides changed, x = k y^d; limits to first order in the errors (Fieller 1954, far from zero slope)."""
    exponent, log_k = 1.0 / fit.exponent, -np.log(fit.prefactor) / fit.exponent
    slope_error = 0.5 * (fit.exponent_high - fit.exponent_low)
    level_error = 0.5 * np.log(fit.prefactor_high / fit.prefactor_low)
    # of the fit's value at ln x = ln k, from the errors of its slope and of its level at 0, correlated by -mean ln x
    error = exponent * np.sqrt(
        max(level_error**2 + (log_k**2 - 2.0 * log_k * mean_log_x) * slope_error**2, 0.0)
    )
    return replace(
        fit,
        exponent=exponent,
        exponent_low=1.0 / fit.exponent_high,
        exponent_high=1.0 / fit.exponent_low if fit.exponent_low > 0.0 else np.inf,
        prefactor=float(np.exp(log_k)),
        prefactor_low=float(np.exp(log_k - error)),
        prefactor_high=float(np.exp(log_k + error)),
    )


# Averages over time

BLOCKS = (4, 8)
"""Equal stretches whose means give the error of the whole.  <P> is correlated over some seconds, of runs of 100 s: of a series
whose memory is a 10th, a 20th, a 40th of the stretch (Ornstein & Uhlenbeck's process) the limits hold the mean in 92, 96, 96 of
100 cases, where it is a 5th in 85 only (`tests/analysis/test_statistics.py`)."""


@dataclass(frozen=True)
class TimeAverage:
    """Mean of a series over a stretch of time.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> average = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc").average("sauter_diameter")
    >>> f"{average.mean * 1e6:.2f} um from {average.start:.0f} to {average.stop:.0f} s"
    '4.11 um from 60 to 120 s'
    """

    mean: float
    error: float
    """half of the half width of the 95 % limits, so that these are mean +- 2 error"""
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
    """Mean over [start, stop] with limits by the means of blocks.

    The wider of the limits of Student's t from four and from eight blocks (Schmeiser 1982; Flyvbjerg & Petersen 1989): four are
    as long as can be against the memory of the series, eight guard against four that are alike by chance.  The error of what
    cannot be known is infinite (no stretch), or nan as the mean is (nothing recorded, or nan among the values).

    Parameters
    ----------
    times : (T,) [s], ascending
    values : (T,) that hold from each time to the next
    start, stop : [s], the whole series by default

    Returns
    -------
    TimeAverage
        Mean and its error, in the unit of the values.

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.analysis import time_average
    >>> found = time_average(np.arange(9.0), [3.0, 5.0] * 4 + [3.0])
    >>> found.mean
    4.0
    """
    t, v = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    if not len(t):
        return TimeAverage(np.nan, np.nan, np.nan, np.nan)
    start, stop = float(t[0] if start is None else start), float(t[-1] if stop is None else stop)
    if not start < stop:
        return TimeAverage(float(v[-1]), np.inf, start, stop)
    means = [block_means(t, v, start, stop, blocks) for blocks in BLOCKS]
    half_widths = [mean_limits(of)[1] for of in means]
    return TimeAverage(float(means[0].mean()), 0.5 * float(np.max(half_widths)), start, stop)


# Steady state

SMALLEST_CHANGE = 0.02
"""Relative difference of the two halves that is never called a change: with enough aggregates a test of significance sees
any drift, and the wish is a level known to some per cent."""
LARGEST_CHANGE = 0.10
"""Relative difference of the two halves that must be ruled out, unless a series has a bound of its own."""
FEWEST_TURNOVERS = 10.0
EARLIEST_STARTS = np.arange(0.0, 0.61, 0.1)


@dataclass(frozen=True)
class SteadyState:
    """Whether and from when a run is steady.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> steady = RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc").steady
    >>> steady.reached, steady.start
    (True, 59.99899482727051)
    """

    reached: bool
    start: float
    """from here on the run counts as steady; where it does not, the start of its last 40 % [s]"""
    reason: str


STEADY_TEST = (
    "from some moment in the first 60 % of the run on, the means over the first and the second half of what is left differ by "
    "less than 2 % or less than the 95 % limit of such a difference, by the scatter within the second half; that they differ by "
    "10 % of ⟨P⟩ or 20 % of σ_P is ruled out at 95 %, by the scatter of the four quarters; and every aggregate has been replaced "
    "ten times on average"
)


def find_steady_state(
    times: ArrayLike,
    series: Mapping[str, ArrayLike],
    turnovers: ArrayLike | None = None,
    largest_change: Mapping[str, float] | None = None,
) -> SteadyState:
    """The earliest start in the first 60 % of the run from which every series is steady.

    No change is seen, and none that matters can have been missed.  The first asks whether the halves of what is left differ
    (Geweke 1992); its error is that of the second half, for growth within the first must not excuse itself.  The second is a
    test of equivalence (Schuirmann 1987): the difference that the scatter of all four quarters leaves possible must be small,
    so that a late jump, a slow wave or a series too short for its memory is refused whatever the first test sees.

    Error rates, of series whose memory is a 50th of their length and whose scatter is 5 %: steady ones are refused in 3 of 100
    cases; taken as steady are a jump by half at 70 or 90 % of the run and a wave of 15 % in none of 200, a drift by half over
    the run in 3 of 100.  Where the memory is a 10th and the scatter 20 %, the same in 0 to 4 of 100, growth that goes on all the
    time in 7, and steady series hardly ever: they are too short.  A drift by a fifth leaves 4 % between the halves and passes in
    3 of 10 (`tests/analysis/test_statistics.py`).

    Parameters
    ----------
    times : (T,) [s], ascending
    series : by name, values (T,) that hold from each time to the next
    turnovers : (T,) aggregates born until then, over the number there is; not asked for when None
    largest_change : by name of a series, the relative difference of the halves to be ruled out; LARGEST_CHANGE for the rest

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.analysis import find_steady_state
    >>> time = np.linspace(0.0, 100.0, 2001)
    >>> scatter = 0.2 * np.random.default_rng(1).standard_normal(len(time))

    Growth towards 10 with a time of 5 s is steady after a few of these; growth that goes on is not:

    >>> find_steady_state(time, {"<P>": 10.0 * (1.0 - np.exp(-time / 5.0)) + scatter}).start < 40.0
    True
    >>> find_steady_state(time, {"<P>": 1.0 + 0.1 * time + scatter}).reached
    False
    """
    t = np.asarray(times, dtype=float)
    if not len(t):
        return SteadyState(False, float("nan"), "nothing was recorded")
    bounds = largest_change or {}
    renewed = None if turnovers is None else np.asarray(turnovers, dtype=float)
    end, why = float(t[-1]), ""
    for start in t[0] + EARLIEST_STARTS * (end - t[0]):
        why = ""
        for name, values in series.items():
            if why := _change(
                t, np.asarray(values, dtype=float), start, name, bounds.get(name, LARGEST_CHANGE)
            ):
                break
        if not why and renewed is not None:
            since = float(renewed[-1] - np.interp(start, t, renewed))
            if not since >= FEWEST_TURNOVERS:
                why = f"aggregates were replaced {since:.2g} times only"
        if not why:
            return SteadyState(True, float(start), f"steady from {start:.4g} s on")
    return SteadyState(False, float(t[0] + EARLIEST_STARTS[-1] * (end - t[0])), why)


def _change(times: Floats, values: Floats, start: float, name: str, bound: float) -> str:
    """Why a series may not be called steady from `start` on; empty where it may."""
    end = float(times[-1])
    if not start < end:
        return "there is one moment only"
    middle = 0.5 * (start + end)
    early, late = time_average(times, values, start, middle), time_average(times, values, middle, end)
    whole = time_average(times, values, start, end)
    level = abs(whole.mean)
    gap = abs(late.mean - early.mean)
    if not gap <= max(2.0 * np.sqrt(2.0) * late.error, SMALLEST_CHANGE * level):
        return (
            f"{name} still changes: {early.mean:.4g} +- {2.0 * early.error:.2g} before "
            f"{middle:.4g} s, {late.mean:.4g} +- {2.0 * late.error:.2g} after"
        )
    # The difference of the halves has twice the error of the whole.
    possible = gap + 4.0 * whole.error
    if not possible <= bound * level:
        return f"{name} may still change by {possible / level:.0%} from half to half, {bound:.0%} must be ruled out"
    return ""


# Shares


def share_of_origins(chosen: ArrayLike, origin: ArrayLike) -> tuple[float, float, float, int]:
    """Share of rows that are chosen, its 95 % limits, and the number of origins (`origins_of`), which is what the limits are of.

    Copies share what they are, so an origin counts once; the limits are Wilson's of so many trials.
    """
    hit, label = np.asarray(chosen, dtype=bool), np.asarray(origin)
    if not len(hit):
        return (*share(0, 0), 0)
    portion, count = float(hit.mean()), len(np.unique(label))
    _, low, high = shares(portion * count, count).tolist()
    return portion, low, high, count


def share(hits: int, count: int) -> tuple[float, float, float]:
    """hits/count with its 95 % limits (Wilson 1927); (nan, 0, 1) of nothing.

    Parameters
    ----------
    hits, count : int
        How many of how many.

    Returns
    -------
    (float, float, float)
        The share and its limits [-].

    Examples
    --------
    >>> from mcdem.analysis import share
    >>> [round(value, 3) for value in share(3, 20)]
    [0.15, 0.052, 0.36]
    """
    portion, low, high = shares(hits, count).tolist()
    return portion, low, high


def shares(hits: ArrayLike, count: int) -> Floats:
    """(3, ...) `share` of each of many hits among `count`; none among 100 is 0 with limits 0 and 0.037.

    In closed form, because scipy's binomtest takes one at a time and makes its test besides.
    """
    k = np.asarray(hits, dtype=float)
    if count == 0:
        return np.stack([np.full_like(k, value) for value in (np.nan, 0.0, 1.0)])
    p, z2 = k / count, stats.norm.ppf(0.5 + 0.5 * CONFIDENCE) ** 2 / count
    middle = (p + 0.5 * z2) / (1.0 + z2)
    reach = np.sqrt(z2 * p * (1.0 - p) + 0.25 * z2**2) / (1.0 + z2)
    return np.stack([p, np.where(k == 0, 0.0, middle - reach), np.where(k == count, 1.0, middle + reach)])


def count_limits(count: ArrayLike) -> tuple[Floats, Floats]:
    """95 % limits of the expectation of a Poisson count (Garwood 1936): 0 and 3.7 of none."""
    k = np.asarray(count, dtype=float)
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = np.where(k > 0.0, 0.5 * stats.chi2.ppf(tail, 2.0 * np.maximum(k, 0.5)), 0.0)
    return np.asarray(low), np.asarray(0.5 * stats.chi2.ppf(1.0 - tail, 2.0 * (k + 1.0)))


def mean_limits(values: ArrayLike) -> tuple[float, float]:
    """Mean and half width of its 95 % limits by Student's t; of a single value infinite, of none (nan, nan)."""
    v = np.asarray(values, dtype=float)
    if not len(v):
        return float("nan"), float("nan")
    if len(v) == 1:
        return float(v[0]), float("inf")
    reach = stats.t.ppf(0.5 + 0.5 * CONFIDENCE, len(v) - 1) * v.std(ddof=1) / np.sqrt(len(v))
    return float(v.mean()), float(reach)
