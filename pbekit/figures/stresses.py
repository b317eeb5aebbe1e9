"""Tables at several stresses: efficiencies of two primaries, and how sizes go with stress."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

from pbekit.figures.style import (
    ANALYTICAL,
    BLUE,
    GREEN,
    MONTE_CARLO,
    ORANGE,
    STYLE,
    VERMILION,
    blank_figure,
    error_lengths,
    save,
    ticks_at,
)

GUESSED = 0.05
"""Share of extrapolated encounters from which on a point is drawn open."""


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
            ticks_at(ax, data.stress.values)
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
    ax.errorbar(data.stress[known], values[known], yerr=error_lengths(ends), ms=4, capsize=3, **style)


def _interpolated(ax: Axes, data: xr.Dataset, key: str, unit: float) -> None:
    """Values from the neighbouring stresses, beside their stress so that both bands can be read; open without a band."""
    guess = unit * data[f"{key}_interpolated"].values
    low, high = (unit * data[f"{key}_interpolated_{end}"].values for end in ("low", "high"))
    beside = 1.02 * data.stress.values
    for chosen, words in ((np.isfinite(low), ", with its error"), (~np.isfinite(low), ", error unknown")):
        shown = chosen & np.isfinite(guess)
        if shown.any():
            ends = error_lengths(np.stack([guess - low, high - guess]))[:, shown]
            ax.errorbar(
                beside[shown], guess[shown], yerr=ends, fmt="s", color=ORANGE, mfc="white", ms=4,
                label="from the two stresses beside (shifted)" + words,
            )  # fmt: skip
