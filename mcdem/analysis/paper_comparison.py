"""A run's numbers beside those that the paper prints.

Where the paper leaves open how a number was made, one convention is judged, the one that its own words are nearest to; what the
others give is a row of sensitivity, which has no verdict.  Judged are

- breakup as its section 2.1 defines it, two or more fragments after a collision, or a split without one; the parent is what the
  colliders were together;
- mass against size as Eq. 26 writes it, P as a function of the length: ln P on ln length;
- ellipsoids of Eq. 27 by points at the primaries' centres, as its Table 2 has them (`mcdem.aggregates.morphology`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats

from mcdem.analysis import paper
from mcdem.analysis.breakup import EROSION_ABOVE, Convention, in_convention
from mcdem.analysis.dataset import FEW_BREAKUPS, RunDataset, origins, pool, pooled_breakups
from mcdem.analysis.statistics import (
    OF_MEANS,
    Given,
    count_limits,
    fit_mass_size,
    fit_power_law,
    mean_limits,
    share,
    share_of_origins,
)
from mcdem.encounter.capture_efficiency import initial_growth, van_de_ven_mason

RULE = (
    "agrees: the paper's value, with half a unit of its last digit, or its range, meets this run's 95 % limits; "
    "for a bound, the limits reach it; of mass-size fits the limits are those of single snapshots, as the paper's is one; "
    "sensitivity: another convention than the one that is judged"
)


CONVENTION_WORDS: dict[Convention, str] = {
    "paper": "its own convention",
    "strict": "strict convention",
    "own": "each aggregate for itself",
}
JUDGED_CONVENTION: Convention = "paper"
JUDGED_REGRESSION: Given = "length"
SIGNIFICANT = 0.10
"""A share of aggregates that may be called significant: the paper's own smallest that it remarks on, that of erosion."""


@dataclass(frozen=True)
class Row:
    """One quantity: what the paper prints, what the runs give with 95 % limits, and whether they meet."""

    quantity: str
    printed: str
    low: float
    """the paper's value as a range"""
    high: float
    measured: float
    measured_low: float
    measured_high: float
    count: int
    """aggregates, encounters or breakups behind the number"""
    unsettled: bool = False
    """whether it is to hold at steady state, and the runs are not there"""
    sensitivity: bool = False
    """whether it is what another convention gives, and not judged"""

    @property
    def agrees(self) -> bool | None:
        """None where it is not judged or there is too little to say: no steady state, no number, or limits that meet because
        they are wide, by more than twice the value.
        """
        if (
            self.sensitivity
            or self.unsettled
            or not np.isfinite([self.measured, self.measured_low, self.measured_high]).all()
        ):
            return None
        meet = self.measured_low <= self.high and self.measured_high >= self.low
        return None if meet and self.measured_high - self.measured_low > 2 * abs(self.measured) else meet


def compare(runs: Sequence[RunDataset]) -> list[Row]:
    """Rows for replicas of one scene; empty where the paper prints nothing for it.

    Parameters
    ----------
    runs : sequence of RunDataset
        Replicas of one scene.

    Returns
    -------
    list of Row
        Measured and printed, with limits.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset, compare
    >>> rows = compare([RunDataset("notebooks/data/run-1000Pa-of-100-seed-2.nc")])
    >>> row = rows[0]
    >>> f"{row.quantity}: printed {row.printed}, here {row.measured:.2f}"
    'collision efficiency η₁₁ (Eq. 23): printed 0.074, here 0.08'
    """
    scene = runs[0].scene
    rows: list[Row] = []
    steady = all(run.steady.reached for run in runs)
    stress = next((stress for stress in paper.STRESSES if paper.holds_for(scene, stress)), None)
    if stress is not None:
        rows += [_efficiency(runs), *_growth(runs, stress)]
        rows += [replace(row, unsettled=not steady) for row in _every_population(runs)]
    if stress == 1000.0:
        rows += _early_shapes(runs)
        late = [*_population(runs), *_shapes(runs), *_breakups(runs)]
        rows += [replace(row, unsettled=not steady) for row in late]
    return rows


def _efficiency(runs: Sequence[RunDataset]) -> Row:
    """eta_11 from the encounters of two monomers: those that end as a doublet."""
    pairs = hits = 0
    for run in runs:
        monomers = (run.events["parent_size"].values == 1).all(axis=1)
        pairs += int(monomers.sum())
        hits += int((monomers & (run.outcome == "aggregation")).sum())
    value = van_de_ven_mason(runs[0].scene)
    return Row(
        "collision efficiency η₁₁ (Eq. 23)",
        f"{value:.3f}",
        value - 5e-4,
        value + 5e-4,
        *share(hits, pairs),
        pairs,
    )


def _slope(runs: Sequence[RunDataset], low: float, high: float) -> tuple[float, int]:
    """d<P>/dt [1/s] while <P> grows from `low` to `high`, and the aggregations that it took, whose number's Poisson scatter is
    its error.
    """
    slopes, events = [], 0
    for run in runs:
        size = run.series["mean_size"].values
        reached = [np.flatnonzero(size >= level) for level in (low, high)]
        if not all(len(rows) for rows in reached):
            return np.nan, 0
        begun, ended = (int(rows[0]) for rows in reached)
        rise, time = size[ended] - size[begun], run.time[ended] - run.time[begun]
        slopes.append(rise / time if time > 0.0 else np.nan)
        events += int((run.outcome[begun:ended] == "aggregation").sum())
    return float(np.mean(slopes)), events


def _growth(runs: Sequence[RunDataset], stress: float) -> Iterator[Row]:
    """The start of <P>(t) against Eq. 22, and whether growth accelerates."""
    law = initial_growth(runs[0].scene, van_de_ven_mason(runs[0].scene))
    start, events = _slope(runs, 1.0, 1.25)
    few, many = (float(limit) / events if events else np.nan for limit in count_limits(events))
    yield Row(
        "d⟨P⟩/dt at the start [1/s] (Eqs. 22, 23)",
        f"{law:.4f}",
        0.995 * law,
        1.005 * law,
        start,
        start * few,
        start * many,
        events,
    )
    early, n_early = _slope(runs, 1.0, 2.0)
    later, n_later = _slope(runs, 2.0, 4.0)
    ratio = later / early
    # of a ratio of two counts the logarithm is nearly normal
    factor = float(np.exp(1.96 * np.sqrt(1.0 / n_early + 1.0 / n_later))) if n_early and n_later else np.nan
    accelerated = paper.ACCELERATED[stress]
    yield Row(
        "growth from ⟨P⟩ = 2 to 4 over growth from 1 to 2",
        "accelerated" if accelerated else "not accelerated",
        *((1.1, np.inf) if accelerated else (0.0, 1.1)),
        ratio,
        ratio / factor,
        ratio * factor,
        n_early + n_later,
    )


def _around(value: float, error: float) -> tuple[float, float, float]:
    return value, value - error, value + error


def _every_population(runs: Sequence[RunDataset]) -> Iterator[Row]:
    """What the text says of the steady population at every stress."""
    mean, sauter = ([run.average(name) for run in runs] for name in ("mean_size", "sauter_diameter"))
    scatter = []
    for name, averages in (("mean_size", mean), ("sauter_diameter", sauter)):
        late = [run.time >= average.start for run, average in zip(runs, averages, strict=True)]
        scatter.append(
            np.mean([run.series[name].values[rows].std() for run, rows in zip(runs, late, strict=True)])
            / np.mean([average.mean for average in averages])
        )
    ratio = float(scatter[1] / scatter[0])
    rows = sum(len(run.time) for run in runs)
    yield from _printed_clusters(runs)
    # A standard deviation over a stretch with few independent moments: its error is that of some ten of them.
    yield Row(
        "scatter of d_32 over that of ⟨P⟩, both relative",
        "larger",
        1.0,
        np.inf,
        *_around(ratio, 0.45 * ratio),
        rows,
    )
    found = pool([run.population(-1, rigidity=False) for run in runs], "aggregate")
    size = found["size"].values
    yield Row(
        "share of isolated primaries among aggregates",
        "significant",
        SIGNIFICANT,
        1.0,
        *share(int((size == 1).sum()), len(size)),
        len(size),
    )
    logarithm = np.log(size[size > 1])
    skewness = float(stats.skew(logarithm)) if len(logarithm) > 2 else np.nan
    yield Row(
        "skewness of ln P of P > 1",
        "log-normal",
        -0.3,
        0.3,
        *_around(skewness, 2.0 * np.sqrt(6.0 / max(len(np.unique(size)), 1))),
        len(logarithm),
    )
    origin = origins(found)
    large = size > 15
    if large.any():
        n_c = found["coordination_number"].values
        inside = share_of_origins((n_c[large] >= 5) & (n_c[large] <= 6), origin[large])
        yield Row("share with n_c between 5 and 6, P > 15", "all", 0.99, 1.0, *inside)
    settled = size > 3
    bonds = found["bond_count"].values
    _, fewest, most = share(8, 10)
    isostatic = share_of_origins((bonds == 3 * size - 6)[settled], origin[settled])
    yield Row("share with 3P - 6 bonds, P > 3 (Table 2: 8 of 10)", "0.80", fewest, most, *isostatic)
    broken = pooled_breakups(runs, "paper")
    level = float(np.mean([average.mean for average in mean]))
    yield Row(
        "size of what breaks over ⟨P⟩, its own convention",
        "larger",
        1.0,
        np.inf,
        *_around(broken["P_br"] / level, 2.0 * broken["P_br_error"] / level),
        int(broken["breakups"]),
    )


FEWEST_SHOWN = 8
"""The mean size of fewer clusters is reported but not judged."""


def _printed_clusters(runs: Sequence[RunDataset]) -> Iterator[Row]:
    """Mean size of the clusters that the paper shows of a steady population, beside that of ours: they may have been chosen."""
    mean = [run.average("mean_size") for run in runs]
    level = float(np.mean([average.mean for average in mean]))
    error = float(np.sqrt(np.sum(np.square([average.error for average in mean])))) / len(runs)
    shown = {
        "Fig. 10": [size for stress, size, _ in paper.CLUSTERS if np.isclose(stress, runs[0].stress)],
        "Table 2": paper.TABLE_2[:, 0].tolist() if np.isclose(runs[0].stress, paper.TABLE_2_STRESS) else [],
    }
    for where, sizes in shown.items():
        if sizes:
            printed, reach = mean_limits(sizes)
            yield Row(
                f"mean size, of ours all, of the paper's the {len(sizes)} clusters of {where}, perhaps chosen",
                f"{printed:.1f}",
                printed - reach,
                printed + reach,
                *_around(level, 2.0 * error),
                sum(len(run.time) for run in runs),
                sensitivity=len(sizes) < FEWEST_SHOWN,
            )


FEWEST_CLUSTERS = 30
"""Clusters of P > 3 from which an exponent is taken at the start of a run."""


def _early_shapes(runs: Sequence[RunDataset]) -> Iterator[Row]:
    """d_g and d_o of the first clusters."""
    pooled = None
    for snapshot in range(min(len(run.snapshot_times) for run in runs)):
        pooled = pool([run.population(snapshot, rigidity=False) for run in runs], "aggregate")
        if int((pooled["size"] > 3).sum()) >= FEWEST_CLUSTERS:
            break
    else:
        return
    origin = origins(pooled)
    for name, symbol, length in (
        ("gyration", "d_g", "radius_of_gyration"),
        ("outer", "d_o", "outer_radius"),
    ):
        printed = paper.EXPONENT_RANGES[name][0]
        for given, words in REGRESSIONS.items():
            fit = fit_mass_size(pooled["size"], pooled[length], runs[0].radius, given, origin)
            limits = (fit.exponent, fit.exponent_low, fit.exponent_high) if fit else (np.nan,) * 3
            yield Row(
                f"{symbol} of the first clusters, P > 3, {words}",
                f"around {printed}",
                printed - 0.1,
                printed + 0.1,
                *limits,
                int((pooled["size"] > 3).sum()),
                sensitivity=given != JUDGED_REGRESSION,
            )


REGRESSIONS: dict[Given, str] = {"length": "P on length", "size": "length on P"}


def _population(runs: Sequence[RunDataset]) -> Iterator[Row]:
    mean = [run.average("mean_size") for run in runs]
    deviation = [run.average("size_deviation") for run in runs]
    m, d = float(np.mean([x.mean for x in mean])), float(np.mean([x.mean for x in deviation]))
    m_error = np.sqrt(np.sum(np.square([x.error for x in mean]))) / len(runs)
    d_error = np.sqrt(np.sum(np.square([x.error for x in deviation]))) / len(runs)
    ratio = d / m
    error = float(2 * ratio * np.hypot(m_error / m, d_error / d))
    yield Row(
        "σ_P/⟨P⟩, steady",
        "0.60",
        0.55,
        0.65,
        ratio,
        ratio - error,
        ratio + error,
        sum(len(r.time) for r in runs),
    )
    # A maximum of a series that fluctuates is above its mean by chance: what counts is by how much more than late.
    early, late = [], []
    for run, average in zip(runs, deviation, strict=True):
        series, before = run.series["size_deviation"].values, run.time < average.start
        if before.any():
            early.append(series[before].max())
            late.append(series[~before].max())
    ratio = float(np.mean(early) / np.mean(late)) if early else np.nan
    yield Row(
        "largest σ_P on the way over the largest σ_P when steady",
        "a maximum",
        1.0,
        np.inf,
        *_around(ratio, 2.0 * ratio * np.sqrt(2.0) * float(np.mean([x.error / x.mean for x in deviation]))),
        sum(len(r.time) for r in runs),
    )


MOST_SNAPSHOTS = 40
"""Of the steady stretch at most so many snapshots are fitted."""


FEWEST_SNAPSHOTS = 8
"""Below this many late snapshots their scatter gives no error."""


def _over_snapshots(
    populations: Sequence[xr.Dataset], of: Callable[[xr.Dataset], float]
) -> tuple[float, float, float]:
    """Mean over late snapshots of what one says, and the limits of 95 % of single ones: the paper's number is of one."""
    values = np.array([of(population) for population in populations])
    values = values[np.isfinite(values)]
    if len(values) < FEWEST_SNAPSHOTS:
        return np.nan, np.nan, np.nan
    reach = stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) * np.sqrt(1.0 + 1.0 / len(values))
    return _around(float(values.mean()), float(reach))


def _shapes(runs: Sequence[RunDataset]) -> Iterator[Row]:
    late = [
        run.population(run.late_snapshots[k], rigidity=False)
        for run in runs
        for k in np.unique(np.linspace(0, len(run.late_snapshots) - 1, MOST_SNAPSHOTS).astype(int))
    ]
    found = pool([run.population(-1, rigidity=False) for run in runs], "aggregate")
    a = runs[0].radius

    def fitted(length: str, given: Given, value: str) -> tuple[float, float, float]:
        def of(population: xr.Dataset) -> float:
            fit = fit_mass_size(population["size"], population[length], a, given, origins(population))
            return float(getattr(fit, value)) if fit else float("nan")

        over = _over_snapshots(late, of)
        fit = fit_mass_size(found["size"], found[length], a, given, origins(found))
        if np.isfinite(over[0]) or fit is None:
            return over
        return getattr(fit, value), getattr(fit, f"{value}_low"), getattr(fit, f"{value}_high")

    count = sum(int((population["size"] > 3).sum()) for population in late)
    for given, words in REGRESSIONS.items():
        for symbol, printed, low, high, length, value in (
            ("d_g", "1.68", 1.675, 1.685, "radius_of_gyration", "exponent"),
            ("k_g", "3.34", 3.335, 3.345, "radius_of_gyration", "prefactor"),
            ("d_o", "1.5 to 1.6", 1.5, 1.6, "outer_radius", "exponent"),
        ):
            yield Row(
                f"{symbol}, P > 3, {words}",
                printed,
                low,
                high,
                *fitted(length, given, value),
                count,
                sensitivity=given != JUDGED_REGRESSION,
            )

    size, ratio = found["size"].values, found["aspect_ratio"].values
    shaped, origin = size > 2, origins(found)
    low, high = paper.SLIGHTLY_ELONGATED
    most = share_of_origins(((ratio > low) & (ratio < high))[shaped], origin[shaped])
    yield Row("share with 1.25 < A.R. < 2.00, P > 2", "most", 0.5, 1.0, *most)
    rods = share_of_origins((ratio > paper.RODS_ABOVE)[shaped], origin[shaped])
    yield Row("share with A.R. > 2.50, P > 2", "significant", SIGNIFICANT, 1.0, *rods)
    yield from _aspect_ratios(size[size > 3], ratio[size > 3], origin[size > 3])
    solid = pool([run.population(-1, "spheres", rigidity=False) for run in runs], "aggregate")
    flat, falling = ("independent of size", -0.15, 0.15), ("falls with size", -np.inf, -0.15)
    for words, of, shape, (printed, low, high) in (
        ("the ellipsoid of points", found, "ellipsoid", flat),
        ("the ellipsoid of solid primaries", solid, "ellipsoid", flat),
        ("the sphere", found, "sphere", falling),
    ):
        some = of["size"].values > 3
        law = fit_power_law(of["size"].values[some], of[f"solid_fraction_{shape}"].values[some], origin[some])
        limits = (law.exponent, law.exponent_low, law.exponent_high) if law else (np.nan,) * 3
        yield Row(
            f"exponent of the solid fraction in {words} against P",
            printed,
            low,
            high,
            *limits,
            int(some.sum()),
            sensitivity=of is solid,
        )


def _aspect_ratios(
    size: NDArray[np.integer], ratio: NDArray[np.float64], origin: NDArray[np.integer]
) -> Iterator[Row]:
    """The smallest A.R., and how the largest grows with size: quantiles over thirds of the sizes, limits by bootstrap over
    origins.
    """
    thirds = np.array_split(np.argsort(size, kind="stable"), 3)
    if len(size) < 30:
        return
    rng = np.random.default_rng(0)

    def edges(rows: NDArray[np.integer]) -> tuple[float, float]:
        return float(np.quantile(ratio[rows], 0.02)), float(np.quantile(ratio[rows], 0.95))

    def clusters(rows: NDArray[np.integer]) -> list[NDArray[np.integer]]:
        return [rows[origin[rows] == label] for label in np.unique(origin[rows])]

    by_third = [clusters(rows) for rows in thirds]
    drawn = [
        [edges(np.concatenate([of[k] for k in rng.integers(0, len(of), len(of))])) for of in by_third]
        for _ in range(200)
    ]
    low, high = np.array(drawn).transpose(2, 0, 1)
    smallest = low[:, [0, 2]].min(axis=1)
    middle, bottom, top = (float(v) for v in np.quantile(smallest, [0.5, 0.025, 0.975]))
    lower = paper.SMALLEST_ASPECT_RATIO
    yield Row(
        "smallest A.R. (2 % quantile), P > 3",
        f"around {lower}",
        lower - 0.1,
        lower + 0.1,
        middle,
        bottom,
        top,
        len(size),
    )
    middle, bottom, top = (float(v) for v in np.quantile(high[:, 2] / high[:, 0], [0.5, 0.025, 0.975]))
    yield Row(
        "largest A.R. (95 % quantile) of the largest third over that of the smallest, P > 3",
        "grows with size",
        1.0,
        np.inf,
        middle,
        bottom,
        top,
        len(size),
    )


def _breakups(runs: Sequence[RunDataset]) -> Iterator[Row]:
    broken = pool([run.late_breakups for run in runs], "breakup")
    for convention, words in CONVENTION_WORDS.items():
        other = convention != JUDGED_CONVENTION
        largest = broken["largest_fragment"].values[in_convention(broken, convention)]
        count = len(largest)
        comparable = share(int(((largest >= 0.45) & (largest <= 0.75)).sum()), count)
        erosion = share(int((largest >= EROSION_ABOVE).sum()), count)
        histogram = np.histogram(largest, np.linspace(0, 1, 11))[0]
        # where a histogram of a few has its peak is chance
        likeliest = (np.nan, np.nan, np.nan)
        if count >= FEW_BREAKUPS:
            drawn = np.random.default_rng(0).multinomial(count, histogram / count, 1000).argmax(axis=1)
            first, last = np.quantile(drawn, [0.025, 0.975], method="nearest")
            likeliest = (0.1 * float(histogram.argmax()) + 0.05, 0.1 * float(first), 0.1 * float(last) + 0.1)
        yield Row(
            f"largest fragment 0.45 to 0.75 of the parent, {words}",
            "> 0.80",
            0.8,
            1.0,
            *comparable,
            count,
            sensitivity=other,
        )
        low, high = paper.EROSION_PEAK
        at_peak = int(((largest >= low) & (largest <= high)).sum())
        beside = int(
            ((largest >= low - 0.05) & (largest < low)).sum() + ((largest > high) & (largest < 1.0)).sum()
        )
        yield Row(
            f"share between 0.90 and 0.95 of those between 0.85 and 1, {words}",
            "a peak",
            1 / 3,
            1.0,
            *share(at_peak, at_peak + beside),
            at_peak + beside,
            sensitivity=other,
        )
        yield Row(
            f"erosion's share of breakups, {words}",
            "about 0.10",
            0.05,
            0.15,
            *erosion,
            count,
            sensitivity=other,
        )
        yield Row(
            f"likeliest largest fragment, {words}",
            "0.60",
            0.55,
            0.65,
            *likeliest,
            count,
            sensitivity=other,
        )


def breakup_exponents(groups: dict[float, list[RunDataset]]) -> list[Row]:
    """q of P_br and of <P> against stress, from three stresses or more.

    Parameters
    ----------
    groups : dict
        {stress [Pa]: its runs}, of `by_stress`.

    Returns
    -------
    list of Row
        Measured and printed, with limits.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset, breakup_exponents
    >>> runs = {s: [RunDataset(f"notebooks/data/run-{s}Pa-of-100.nc")] for s in (750, 875, 1500)}
    >>> for row in breakup_exponents(runs)[:1]:
    ...     print(row.quantity, f"{row.measured:.1f}")
    breakup exponent q of ⟨P⟩ 0.8
    """
    if len(groups) < 3:
        return []
    stress = np.array(list(groups))
    series: dict[tuple[str, bool], NDArray[np.float64]] = {}
    series["⟨P⟩", False] = np.array(
        [np.mean([r.average("mean_size").mean for r in g]) for g in groups.values()]
    )
    for convention, words in CONVENTION_WORDS.items():
        numbers = [pooled_breakups(g, convention) for g in groups.values()]
        series[f"P_br, {words}", convention != JUDGED_CONVENTION] = np.array([n["P_br"] for n in numbers])
    rows = []
    for (name, other), values in series.items():
        known = np.isfinite(values)
        fit = fit_power_law(stress[known], values[known], minimum=OF_MEANS) if known.any() else None
        q = (-fit.exponent, -fit.exponent_high, -fit.exponent_low) if fit else (np.nan, np.nan, np.nan)
        rows.append(
            Row(f"breakup exponent q of {name}", "2.0", 1.95, 2.05, *q, int(known.sum()), sensitivity=other)
        )
    return rows
