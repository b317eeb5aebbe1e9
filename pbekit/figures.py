"""Figures of balances, each from a dataset that is saved beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

from pbekit.outputs import FILES
from pbekit.study.compare import Comparison, volume_fractions
from pbekit.tables.kernel_table import AGGREGATION, SCATTERED, KernelTable

# Okabe & Ito's palette, told apart by colour-blind readers.
BLUE, VERMILION, GREEN, ORANGE, BLACK = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#000000"
STYLE = {
    "font.size": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.constrained_layout.use": True,
    "lines.linewidth": 1.3,
    "savefig.dpi": 200,
}
TABULATED, MONTE_CARLO, ANALYTICAL, SINGLE_RUNS = (
    "balance on tabulated encounters",
    "Monte Carlo",
    "van de Ven-Mason, power-law breakup",
    "90 % of single runs of its size, by table and chance",
)


def blank_figure(rows: int = 1, columns: int = 1, *, figsize: tuple[float, float], **options: Any) -> Any:
    """A figure that no window shows, and its axes."""
    figure = Figure(figsize=figsize)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, **options)


def save(figure: Figure, data: xr.Dataset, path: Path) -> Path:
    """The figure as PNG and its numbers as NetCDF of the same name."""
    FILES.write_picture(path.with_suffix(".png"), figure)
    FILES.write_numbers(path.with_suffix(".nc"), data)
    return path.with_suffix(".png")


def draw_comparison(found: Comparison, prefix: Path) -> list[str]:
    """All figures of one comparison, names beginning with `prefix`; a line for each that is left out."""
    named = lambda what: prefix.with_name(f"{prefix.name}-{what}")
    left_out = []
    draw_table(found.table, named("table"))
    draw_course(found, named("course"))
    draw_distribution(found, named("distribution"))
    if _ablation_panels(found):
        draw_ablation(found, named("ablation"))
    else:
        left_out.append("figure of the ablation left out: no steady state, and no run to compare with")
    if "mean_size" not in found.numbers:
        left_out.append("figure of volume fractions left out: no steady state")
    elif "volume_fraction" not in found.table.about:
        left_out.append("figure of volume fractions left out: the table does not say its volume fraction")
    else:
        data = volume_fractions(found.table, found.numbers["mean_size"])
        draw_volume_fractions(data, named("volume-fractions"))
    return left_out


def draw_course(found: Comparison, path: Path) -> Path:
    """<P>, sigma_P and d32 over time, three accounts."""
    course = found.course
    rows = (
        ("mean_size", r"mean size $\langle P\rangle$", 1.0),
        ("size_deviation", r"standard deviation $\sigma_P$", 1.0),
        ("sauter_diameter", r"Sauter diameter $d_{32}$ [µm]", 1e6),
    )
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(1, 3, figsize=(8.4, 2.9))
        for ax, (key, label, unit) in zip(axes, rows, strict=True):
            time = course.time.values
            if f"{key}_monte_carlo" in course:
                ax.plot(time, unit * course[f"{key}_monte_carlo"], color=BLACK, lw=0.8, label=MONTE_CARLO)
            if f"{key}_run_low" in course:
                ends = (unit * course[f"{key}_run_{end}"] for end in ("low", "high"))
                ax.fill_between(time, *ends, color=BLUE, alpha=0.12, lw=0, label=SINGLE_RUNS)
            low, high = (unit * course[f"{key}_{end}"] for end in ("low", "high"))
            ax.fill_between(time, low, high, color=BLUE, alpha=0.3, lw=0)
            ax.plot(time, unit * course[key], color=BLUE, label=f"{TABULATED}, 90 % band")
            if f"{key}_analytical" in course:
                ax.plot(time, unit * course[f"{key}_analytical"], color=VERMILION, ls="--", label=ANALYTICAL)
            ax.set(xlabel="time [s]", ylabel=label, xlim=(0, time[-1]))
            ax.set_ylim(bottom=0)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        return save(figure, course, path)


def draw_distribution(found: Comparison, path: Path) -> Path:
    """Number distribution of the run's last part, three accounts; and at steady state."""
    data, late = found.distribution, found.numbers.get("late_from")
    panels = [
        key for key in ("late_density", "density") if key in data and (late is not None or key == "density")
    ]
    if not panels:
        panels = ["late_density"]
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(1, len(panels), figsize=(4.2 * len(panels), 3.6), squeeze=False)
        for ax, key in zip(axes[0], panels, strict=True):
            _distribution(ax, data, key)
            last = "last 40 %" if late is None else f"from {late:.4g} s to the run's end"
            ax.set_title("steady state" if key == "density" else last)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(panels))
        return save(figure, data, path)


def _distribution(ax: Axes, data: xr.Dataset, key: str) -> None:
    size = data["size"].values
    top = float(data[key].max())
    floor = 1e-5 * top
    if f"{key}_run_low" in data:
        # A run of some hundred aggregates may show none of a size: its band then reaches below the axis.
        low, high = (np.maximum(data[f"{key}_run_{end}"], 0.1 * floor) for end in ("low", "high"))
        ax.fill_between(size, low, high, color=BLUE, alpha=0.12, lw=0, label=SINGLE_RUNS)
    ax.fill_between(size, data[f"{key}_low"], data[f"{key}_high"], color=BLUE, alpha=0.3, lw=0)
    ax.plot(size, data[key], color=BLUE, label=f"{TABULATED}, 90 % band")
    # A run that still changes shows no steady state.
    if "density_monte_carlo" in data and (key == "late_density" or data.attrs["steady_run"]):
        seen = data.density_monte_carlo.values > 0
        counted = data.density_monte_carlo.values[seen]
        error = 1.645 * data.density_monte_carlo_error.values[seen]
        # A lower end at or below zero reaches below the axis.
        lengths = _length(np.stack([np.minimum(error, counted - 0.1 * floor), error]))
        ax.errorbar(
            size[seen],
            counted,
            lengths,
            fmt="o",
            ms=3,
            lw=0.8,
            color=BLACK,
            label=f"{MONTE_CARLO}, 90 %",
        )
    if f"{key}_analytical" in data:
        ax.plot(size, data[f"{key}_analytical"], color=VERMILION, ls="--", label=ANALYTICAL)
    ax.set(
        xscale="log", yscale="log", xlabel="primaries per aggregate $P$", ylabel="number share per primary"
    )
    ax.set_ylim(floor, 5 * top)
    ax.set_xlim(0.9, size[np.flatnonzero(data[key].values > floor)[-1]] * 1.1)


def _ablation_panels(found: Comparison) -> list[tuple[str, str]]:
    """The quantities that have anything to show, and their labels."""
    panels = [("mean_size", r"steady $\langle P\rangle$")]
    if "end" in found.numbers:
        panels.insert(0, ("end_mean_size", rf"$\langle P\rangle$ after {found.numbers['end']:.4g} s"))
        panels.append(("late_distance", "distance of sizes\nfrom the Monte Carlo's"))
    return [panel for panel in panels if bool(found.ablation[panel[0]].notnull().any())]


def draw_ablation(found: Comparison, path: Path) -> Path:
    """<P> at the run's end and at steady state with one assumption changed in each line, beside the Monte Carlo."""
    data, numbers, panels = found.ablation, found.numbers, _ablation_panels(found)
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(
            1, len(panels), figsize=(3.0 + 2.7 * len(panels), 3.6), sharey=True, squeeze=False
        )
        y = np.arange(data.sizes["assumption"])[::-1]
        for ax, (key, label) in zip(axes[0], panels, strict=True):
            if f"{key}_run_high" in numbers:
                ends = (numbers.get(f"{key}_run_low", 0.0), numbers[f"{key}_run_high"])
                ax.axvspan(*ends, color=BLUE, alpha=0.12, lw=0, label=SINGLE_RUNS)
            if f"{key}_low" in numbers:
                ends = (numbers[f"{key}_low"], numbers[f"{key}_high"])
                ax.axvspan(*ends, color=BLUE, alpha=0.3, lw=0, label="90 % band of the table")
            mean, error = numbers.get(f"{key}_monte_carlo"), numbers.get(f"{key}_monte_carlo_error")
            if mean is not None:
                ax.axvline(mean, color=BLACK, lw=0.9, label=MONTE_CARLO)
            if mean is not None and error is not None:
                ax.axvspan(mean - 1.645 * error, mean + 1.645 * error, color=BLACK, alpha=0.15, lw=0)
            ax.plot(data[key], y, "o", color=BLUE, ms=4)
            ax.set_yticks(y, data.assumption.values)
            ax.set(xlabel=label)
        _legend_below(figure, axes[0])
        return save(figure, data, path)


def draw_volume_fractions(data: xr.Dataset, path: Path) -> Path:
    """Steady <P> against volume fraction."""
    with mpl.rc_context(STYLE):
        figure, ax = blank_figure(figsize=(4.2, 3.0))
        ax.plot(
            data.volume_fraction,
            data.tabulated,
            "o-",
            color=BLUE,
            ms=4,
            label="tabulated: breakup on encounter",
        )
        if "analytical" in data:
            ax.plot(
                data.volume_fraction,
                data.analytical,
                "s--",
                color=VERMILION,
                ms=4,
                label="analytical: first-order breakup",
            )
        ax.set(xscale="log", xlabel=r"volume fraction $\phi$", ylabel=r"steady mean size $\langle P\rangle$")
        ax.set_ylim(bottom=0)
        _ticks_at(ax, data.volume_fraction.values)
        figure.legend(loc="outside lower center")
        return save(figure, data, path)


def _legend_below(figure: Figure, axes: np.ndarray, ncols: int = 2) -> None:
    """One legend of all panels, each name once, below them."""
    named: dict[str, Artist] = {}
    for ax in np.ravel(axes):
        for handle, name in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(name, handle)
    figure.legend(list(named.values()), list(named), loc="outside lower center", ncols=ncols)


def _ticks_at(ax: Axes, values: np.ndarray) -> None:
    """Label a logarithmic axis at the values themselves; between close ones its own labels overlap."""
    ax.set_xticks(values, [f"{v:.4g}" for v in values])
    ax.xaxis.set_minor_locator(NullLocator())


def draw_efficiencies(data: xr.Dataset, path: Path) -> Path:
    """eta_11 as counted, beside van de Ven & Mason's law."""
    with mpl.rc_context(STYLE):
        figure, ax = blank_figure(figsize=(4.2, 3.0))
        errors = np.maximum(np.stack([data.eta_11 - data.eta_11_low, data.eta_11_high - data.eta_11]), 0)
        ax.errorbar(
            data.stress, data.eta_11, yerr=errors, fmt="o", ms=4, color=BLUE, label="counted, 90 % interval"
        )
        if bool(data.equation_23.notnull().any()):
            law = "van de Ven-Mason (Eq. 23)"
            ax.plot(data.stress, data.equation_23, "s--", ms=4, color=VERMILION, label=law)
        ax.set(xlabel="shear stress [Pa]", ylabel=r"efficiency of two primaries $\eta_{11}$")
        ax.set_ylim(bottom=0)
        figure.legend(loc="outside lower center", ncols=2)
        return save(figure, data, path)


GUESSED = 0.05
"""Share of extrapolated encounters from which on a point is drawn open."""


def draw_stress_law(data: xr.Dataset, runs: dict[float, tuple[float, float]], path: Path) -> Path:
    """Steady <P>, breakup size and d32 against stress; runs: stress [Pa] -> <P> of a Monte Carlo and its error.

    Stresses whose table bears no steady state have no point.
    """
    guessed = data.extrapolated.values > GUESSED
    with mpl.rc_context(STYLE):
        figure, (left, right) = blank_figure(1, 2, figsize=(8.4, 4.4))
        for ax, key, colour, marker, label, unit in (
            (left, "mean_size", BLUE, "o", r"steady $\langle P\rangle$", 1.0),
            (left, "breakup_size", GREEN, "^", "breakup size $P_{br}$", 1.0),
            (right, "sauter_diameter", BLUE, "o", "steady $d_{32}$", 1e6),
        ):
            _with_exponent(ax, data, key, unit, dict(color=colour, fmt=marker + "-", label=label))
            if key != "breakup_size" and np.any(guessed):
                values = unit * data[key].values[guessed]
                open_ = "extrapolated by more than 5 %"
                ax.plot(
                    data.stress[guessed],
                    values,
                    marker,
                    color=colour,
                    ms=4,
                    mfc="white",
                    zorder=3,
                    label=open_,
                )
            if f"{key}_interpolated" in data:
                _interpolated(ax, data, key, unit)
            if f"{key}_analytical" in data:
                laws = ANALYTICAL
                if f"q_{key}_analytical" in data.attrs:
                    laws += f": q = {data.attrs[f'q_{key}_analytical']:.2f}"
                ax.plot(data.stress, unit * data[f"{key}_analytical"], "--", color=VERMILION, label=laws)
        if runs:
            stress = sorted(runs)
            error = [1.645 * runs[s][1] for s in stress]
            left.errorbar(stress, [runs[s][0] for s in stress], yerr=error, fmt="kx", ms=5, label=MONTE_CARLO)
        if bool(data.mean_size.isnull().any()):
            for ax in (left, right):
                ax.plot([], [], " ", label="no point: no steady state at this stress")
        for ax, label in ((left, "primaries"), (right, "Sauter diameter [µm]")):
            ax.set(xscale="log", yscale="log", xlabel="shear stress [Pa]", ylabel=label)
            _ticks_at(ax, data.stress.values)
            ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)))
            ax.yaxis.set_major_formatter(ScalarFormatter())
            ax.yaxis.set_minor_locator(NullLocator())
            ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
        return save(figure, data, path)


def _with_exponent(ax: Axes, data: xr.Dataset, key: str, unit: float, style: dict[str, Any]) -> None:
    """Values with their bands; the exponent, if there is one, in the legend."""
    values = unit * data[key].values
    known = np.isfinite(values)
    if not known.any():
        return
    ends = np.stack([values - unit * data[f"{key}_low"], unit * data[f"{key}_high"] - values])[:, known]
    if f"q_{key}" in data.attrs:
        q, low, high = (data.attrs[f"q_{key}{end}"] for end in ("", "_low", "_high"))
        style["label"] += f": q = {q:.2f} ({low:.2f} to {high:.2f})"
    ax.errorbar(data.stress[known], values[known], yerr=_length(ends), ms=4, capsize=3, **style)


def _interpolated(ax: Axes, data: xr.Dataset, key: str, unit: float) -> None:
    """Values from the neighbouring stresses, beside their stress so that both bands can be read; open without a band."""
    guess = unit * data[f"{key}_interpolated"].values
    low, high = (unit * data[f"{key}_interpolated_{end}"].values for end in ("low", "high"))
    beside = 1.02 * data.stress.values
    for chosen, words in ((np.isfinite(low), ", with its error"), (~np.isfinite(low), ", error unknown")):
        shown = chosen & np.isfinite(guess)
        if shown.any():
            ends = _length(np.stack([guess - low, high - guess]))[:, shown]
            ax.errorbar(
                beside[shown], guess[shown], yerr=ends, fmt="s", color=ORANGE, mfc="white", ms=4,
                label="from the two stresses beside (shifted)" + words,
            )  # fmt: skip


def _length(ends: np.ndarray) -> np.ndarray:
    """Lengths of error bars: none where there is no band."""
    return np.where(np.isfinite(ends), np.maximum(ends, 0.0), 0.0)


FEW_TRIALS = 10
"""Encounters below which a share is no more than a hint: marked by a dot."""


def draw_table(table: KernelTable, path: Path) -> Path:
    """Trials, share that aggregated and share that scattered, by sizes of both parents."""
    r = table.records
    size = table.size_class(r.size)
    shape = (table.sizes, table.sizes)
    both = np.concatenate([size, size[:, ::-1]])
    at = both[:, 0] * table.sizes + both[:, 1]
    count = lambda mask: np.bincount(at, np.tile(mask, 2).astype(float), table.sizes**2).reshape(shape)
    trials = count(np.ones(len(r)))
    data = xr.Dataset(
        {
            "trials": (("size_i", "size_j"), trials),
            "joined": (
                ("size_i", "size_j"),
                np.divide(
                    count(r.outcome == AGGREGATION), trials, where=trials > 0, out=np.full(shape, np.nan)
                ),
            ),
            "scattered": (
                ("size_i", "size_j"),
                np.divide(
                    count(np.isin(r.outcome, SCATTERED)), trials, where=trials > 0, out=np.full(shape, np.nan)
                ),
            ),
        },
        {"size_i": table.size_edges[:-1], "size_j": table.size_edges[:-1]},
    )
    panels = (
        ("trials", "encounters"),
        ("joined", "share that aggregated"),
        ("scattered", "share that scattered"),
    )
    edges = table.size_edges.astype(float)
    middle = np.sqrt(edges[1:] * edges[:-1])
    few = np.nonzero((trials > 0) & (trials < FEW_TRIALS))
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(1, 3, figsize=(9.0, 3.9))
        for ax, (key, label) in zip(axes, panels, strict=True):
            values = np.where(trials > 0, data[key], np.nan)
            top = float(np.nanmax(values, initial=0.0)) or 1.0
            norm = LogNorm(1.0, max(top, 10.0)) if key == "trials" else Normalize(0.0, top)
            mesh = ax.pcolormesh(edges, edges, values, cmap="viridis", norm=norm)
            # Where no encounter was followed, nothing is known, not nought.
            ax.set_facecolor("#E4E4E4")
            if key != "trials":
                words = f"of fewer than {FEW_TRIALS} encounters"
                ax.plot(
                    middle[few[0]],
                    middle[few[1]],
                    "o",
                    ms=1.5,
                    color="white",
                    mec="black",
                    mew=0.3,
                    label=words,
                )
            ax.set(xscale="log", yscale="log", xlabel="$P_i$", ylabel="$P_j$", aspect="equal")
            ax.set_xlim(edges[0], edges[-1])
            ax.set_ylim(edges[0], edges[-1])
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_major_locator(
                    LogLocator(subs=(1.0, 3.0) if edges[-1] > 15 else (1.0, 2.0, 3.0, 5.0))
                )
                axis.set_major_formatter("{x:g}")
                axis.set_minor_locator(NullLocator())
            figure.colorbar(mesh, ax=ax, label=label, location="top", shrink=0.9)
        axes[0].plot([], [], "s", color="#E4E4E4", label="no encounter")
        _legend_below(figure, axes)
        return save(figure, data, path)
