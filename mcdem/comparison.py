"""A run's numbers beside those that the paper prints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .breakup import EROSION_ABOVE, Reading, is_breakup
from .figures import paper
from .figures.growth import van_de_ven_mason
from .runs import FEW_BREAKUPS, Run, pool, pooled_breakups
from .statistics import fit_mass_size, fit_power_law, share

RULE = (
    "agrees: the paper's value, with half a unit of its last digit, or its range, meets this run's 95 % limits; "
    "for a bound, the limits reach it"
)


READING_WORDS: dict[Reading, str] = {"paper": "its own reading", "strict": "strict reading"}


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

    @property
    def agrees(self) -> bool | None:
        """None where there is too little to say: no steady state, no number, or limits wider than twice the value."""
        if self.unsettled or not np.isfinite([self.measured, self.measured_low, self.measured_high]).all():
            return None
        if self.measured_high - self.measured_low > 2 * abs(self.measured):
            return None
        return self.measured_low <= self.high and self.measured_high >= self.low


def compare(runs: Sequence[Run]) -> list[Row]:
    """Rows for replicas of one scene; empty where the paper prints nothing for it."""
    scene = runs[0].scene
    rows: list[Row] = []
    if any(paper.holds_for(scene, stress) for stress in paper.STRESSES):
        rows.append(_efficiency(runs))
    if paper.holds_for(scene, 1000.0):
        steady = all(run.steady.reached for run in runs)
        late = [*_population(runs), *_shapes(runs), *_breakups(runs)]
        rows += [replace(row, unsettled=not steady) for row in late]
    return rows


def _efficiency(runs: Sequence[Run]) -> Row:
    """eta_11 from the encounters of two monomers: those that end as a doublet."""
    pairs = hits = 0
    for run in runs:
        monomers = (run.events["parent_size"].values == 1).all(axis=1)
        pairs += int(monomers.sum())
        hits += int((monomers & (run.outcome == "aggregation")).sum())
    value = van_de_ven_mason(runs[0])
    return Row(
        "collision efficiency η₁₁ (Eq. 23)",
        f"{value:.3f}",
        value - 5e-4,
        value + 5e-4,
        *share(hits, pairs),
        pairs,
    )


def _population(runs: Sequence[Run]) -> Iterator[Row]:
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


def _shapes(runs: Sequence[Run]) -> Iterator[Row]:
    found = pool([run.population(-1, rigidity=False) for run in runs], "aggregate")
    a = runs[0].radius
    gyration = fit_mass_size(found["size"], found["radius_of_gyration"], a)
    outer = fit_mass_size(found["size"], found["outer_radius"], a)
    nothing = (np.nan, np.nan, np.nan)
    d_g = (gyration.exponent, gyration.exponent_low, gyration.exponent_high) if gyration else nothing
    k_g = (gyration.prefactor, gyration.prefactor_low, gyration.prefactor_high) if gyration else nothing
    d_o = (outer.exponent, outer.exponent_low, outer.exponent_high) if outer else nothing
    fitted = int((found["size"] > 3).sum())
    yield Row("d_g, P > 3", "1.68", 1.675, 1.685, *d_g, fitted)
    yield Row("k_g, P > 3", "3.34", 3.335, 3.345, *k_g, fitted)
    yield Row("d_o, P > 3", "1.5 to 1.6", 1.5, 1.6, *d_o, fitted)

    size, ratio = found["size"].values, found["aspect_ratio"].values
    shaped = size > 2
    low, high = paper.SLIGHTLY_ELONGATED
    most = share(int((shaped & (ratio > low) & (ratio < high)).sum()), int(shaped.sum()))
    yield Row("share with 1.25 < A.R. < 2.00, P > 2", "most", 0.5, 1.0, *most, int(shaped.sum()))
    large = size > 15
    n_c = found["coordination_number"].values[large]
    inside = share(int(((n_c >= 5) & (n_c <= 6)).sum()), int(large.sum()))
    yield Row("share with n_c between 5 and 6, P > 15", "all", 0.99, 1.0, *inside, int(large.sum()))


def _breakups(runs: Sequence[Run]) -> Iterator[Row]:
    broken = pool([run.late_breakups for run in runs], "breakup")
    for reading, words in READING_WORDS.items():
        largest = broken["largest_fragment"].values[is_breakup(broken["outcome"].values, reading)]
        count = len(largest)
        comparable = share(int(((largest >= 0.45) & (largest <= 0.75)).sum()), count)
        erosion = share(int((largest >= EROSION_ABOVE).sum()), count)
        histogram = np.histogram(largest, np.linspace(0, 1, 11))[0]
        # where a histogram of a few has its peak is chance
        peak = 0.1 * float(histogram.argmax()) + 0.05 if count >= FEW_BREAKUPS else float("nan")
        yield Row(
            f"largest fragment 0.45 to 0.75 of the parent, {words}", "> 0.80", 0.8, 1.0, *comparable, count
        )
        yield Row(f"erosion's share of breakups, {words}", "about 0.10", 0.05, 0.15, *erosion, count)
        yield Row(
            f"likeliest largest fragment, {words}", "0.60", 0.55, 0.65, peak, peak - 0.05, peak + 0.05, count
        )


def breakup_exponents(groups: dict[float, list[Run]]) -> list[Row]:
    """q of P_br and of <P> against stress, from three stresses or more."""
    if len(groups) < 3:
        return []
    stress = np.array(list(groups))
    series = {"⟨P⟩": np.array([np.mean([r.average("mean_size").mean for r in g]) for g in groups.values()])}
    for reading, words in READING_WORDS.items():
        numbers = [pooled_breakups(g, reading) for g in groups.values()]
        series[f"P_br, {words}"] = np.array([n["P_br"] for n in numbers])
    rows = []
    for name, values in series.items():
        known = np.isfinite(values)
        fit = fit_power_law(stress[known], values[known]) if known.sum() >= 3 else None
        q = (-fit.exponent, -fit.exponent_high, -fit.exponent_low) if fit else (np.nan, np.nan, np.nan)
        rows.append(Row(f"breakup exponent q of {name}", "2.0", 1.95, 2.05, *q, int(known.sum())))
    return rows
