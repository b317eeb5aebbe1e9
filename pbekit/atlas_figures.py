"""Figures of an atlas, and of short forms beside what they were fitted to; each from a dataset that is saved beside it."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

from pbekit.errors import PBEError
from pbekit.figures.style import BLACK, BLUE, GREEN, ORANGE, STYLE, VERMILION, blank_figure, save
from pbekit.study.fitted_laws import FittedLaws
from pbekit.study.size_rates import SizeRates
from pbekit.tables.atlas import SIZE_EDGES, Atlas, joint_breakup
from pbekit.tables.counts import share_interval
from pbekit.tables.kernel_table import SCATTERED


def draw_atlas(atlas: Atlas, cohesion: float, prefix: Path) -> list[Path]:
    """Aggregation efficiency over both sizes at one cohesion number, and breakup over joint size at each, from an atlas.

    Beside them van de Ven & Mason's efficiency of two primaries, which classical balances give to aggregates of any size, and
    the joint sizes at which a critical size ~ N^-2 would put one breakup in a hundred encounters.
    """
    folder, name = prefix.parent, prefix.name
    return [
        _draw_atlas_efficiency(atlas, cohesion, folder / f"{name}-efficiency"),
        _draw_atlas_breakup(atlas, cohesion, folder / f"{name}-breakup"),
    ]


def _draw_atlas_efficiency(atlas: Atlas, cohesion: float, path: Path) -> Path:
    first = (1, 2, 4, 8, 14)
    middle = 0.5 * (SIZE_EDGES[:-1] + SIZE_EDGES[1:] - 1)
    values = np.full((len(first), middle.size, 3), np.nan)
    for a, size in enumerate(first):
        for b, low in enumerate(SIZE_EDGES[:-1]):
            try:
                found = atlas.probability(size, int(low), cohesion)
            except PBEError:
                continue
            if found.trials >= 100:
                values[a, b] = found[:3]
    attraction = [
        p.groups["attraction_number"][0] for p in atlas.parts if abs(p.cohesion / cohesion - 1) < 1e-6
    ]
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(figsize=(4.4, 3.2))
        for a, (size, colour) in enumerate(zip(first, (BLACK, BLUE, GREEN, ORANGE, VERMILION), strict=True)):
            eta, low, high = values[a].T
            shown = np.isfinite(eta)
            axes.errorbar(
                middle[shown] * (1 + 0.015 * (a - 2)),
                eta[shown],
                [(eta - low)[shown], (high - eta)[shown]],
                color=colour,
                marker="o",
                markersize=3,
                elinewidth=0.8,
                label=f"$P_i$ = {size}",
            )
        if attraction:
            law = 0.95 * attraction[0] ** 0.18
            axes.axhline(law, color="grey", linestyle="--", linewidth=1, label="van de Ven-Mason")
        axes.set(
            ylim=(1.5e-4, 0.12),
            xscale="log",
            yscale="log",
            xlabel="primaries of the other, $P_j$",
            ylabel=r"efficiency $\eta$",
        )
        _plain_ticks(axes)
        axes.legend(ncols=2, title=f"N = {cohesion:.3g}")
    data = xr.Dataset(
        {
            name: (("size_i", "size_j"), values[..., k], {"units": "1"})
            for k, name in enumerate(("eta", "eta_low", "eta_high"))
        },
        {"size_i": list(first), "size_j": middle},
        {"cohesion_number": cohesion},
    )
    return save(figure, data, path)


def _draw_atlas_breakup(atlas: Atlas, reference: float, path: Path) -> Path:
    every = atlas.cohesion_numbers
    found = [joint_breakup(atlas, float(n)) for n in every]
    sizes = np.unique(np.concatenate([one["size"] for one in found]))
    columns = np.full((3, every.size, sizes.size), np.nan)
    critical = np.nan
    with mpl.rc_context(STYLE):
        figure, axes = blank_figure(figsize=(4.4, 3.2))
        colours = mpl.colormaps["viridis"](np.linspace(0, 0.85, every.size))
        for k, (n, one) in enumerate(zip(every, found, strict=True)):
            share = one["broken"] / one["trials"]
            limits = np.array(
                [share_interval(c, t) for c, t in zip(one["broken"], one["trials"], strict=True)]
            )
            at = np.searchsorted(sizes, one["size"])
            columns[:, k, at] = share, *limits.T
            seen = one["broken"] >= 3
            axes.errorbar(
                one["size"][seen],
                share[seen],
                [(share - limits[:, 0])[seen], (limits[:, 1] - share)[seen]],
                color=colours[k],
                marker="o",
                markersize=3,
                elinewidth=0.8,
                label=f"{n:.2f}",
            )
            if abs(n / reference - 1) < 1e-6 and seen.sum() > 1:
                critical = float(
                    np.exp(np.interp(np.log(0.01), np.log(share[seen]), np.log(one["size"][seen])))
                )
        for k, n in enumerate(every):
            axes.axvline(critical * (n / reference) ** -2, color=colours[k], linestyle=":", linewidth=1)
        axes.set(xscale="log", yscale="log", xlabel="joint size $P_i + P_j$", ylabel="breakup probability")
        _plain_ticks(axes)
        axes.legend(title="N; dotted: critical size ~ N$^{-2}$", ncols=2)
    data = xr.Dataset(
        {
            name: (("cohesion_number", "joint_size"), columns[k], {"units": "1"})
            for k, name in enumerate(("breakup", "breakup_low", "breakup_high"))
        },
        {"cohesion_number": every, "joint_size": sizes},
    )
    return save(figure, data, path)


def _plain_ticks(axes: Axes) -> None:
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_locator(NullLocator())


def draw_fits(rates: SizeRates, laws: FittedLaws, path: Path) -> Path:
    """Each short form of a table beside what it was fitted to: radii, efficiency and breakup of equal sizes, S, daughters."""
    records = rates.table.records
    seen = rates.pivots <= records.size.max()
    p = rates.pivots[seen]
    equal = np.flatnonzero(seen & (np.diag(rates.trials) > 0))
    data = xr.Dataset(coords={"P": ("P", p)})
    with mpl.rc_context(STYLE):
        figure, grid = blank_figure(2, 3, figsize=(8.4, 5.0))
        axes = grid.ravel()
        _beside(axes[0], data, "radius", p, rates.outer_radius[seen] / rates.table.radius, None)
        low, high = laws.radius.validity["P"]
        inside = (p >= low) & (p <= high)
        _form(axes[0], data, "radius", p[inside], laws.radius(p[inside]) / rates.table.radius, p)
        axes[0].set(ylabel="R/a", title="outer radius")
        for ax, name, law, limits in (
            (axes[1], "efficiency", laws.efficiency, rates.efficiency),
            (axes[2], "breakup", laws.breakup, rates.breakup),
        ):
            size = rates.pivots[equal]
            own = tuple(np.diag(part)[equal] for part in (limits.value, limits.low, limits.high))
            _beside(ax, data, name, size, own[0], own[1:])
            if law is not None:
                low, high = law.validity["P"]
                inside = (size >= low) & (size <= high)
                _form(ax, data, name, size[inside], law(size[inside], size[inside]), p)
            ax.set(ylabel="probability", title=f"{name}, $P_i = P_j$", ylim=(1e-6, 1))
        if rates.first_order is not None and laws.breakage is not None:
            of = rates.first_order.breakage
            some = seen & (of.value > 0)
            size = rates.pivots[some]
            _beside(axes[3], data, "breakage", size, of.value[some], (of.low[some], of.high[some]))
            low, high = laws.breakage.validity["P"]
            inside = (size >= low) & (size <= high)
            fit = laws.breakage(size[inside], rates.first_order.volume_fraction, rates.table.shear_rate)
            _form(axes[3], data, "breakage", size[inside], fit, p)
            if laws.breakage_step is not None:
                fit = laws.breakage_step(
                    size[inside], rates.first_order.volume_fraction, rates.table.shear_rate
                )
                _form(axes[3], data, "breakage_step", size[inside], fit, p, "--")
            axes[3].set(ylabel="S [1/s]", title=f"first order, phi = {rates.first_order.volume_fraction:g}")
        if laws.daughters is not None:
            rows = np.isin(records.outcome, SCATTERED)[records.encounter_of_product]
            of_event = records.encounter_of_product[rows]
            x = records.product_size[rows] / records.size.sum(axis=1)[of_event]
            density, edges = np.histogram(x, 25, (0, 1), weights=x, density=True)
            axes[4].stairs(density, edges, color="grey")
            line = np.linspace(0.005, 0.995, 199)
            axes[4].plot(line, laws.daughters(line), color=VERMILION)
            axes[4].set(xlabel="$x = P_f/(P_i + P_j)$", ylabel="density by mass", title="daughters")
            data = data.assign(
                daughters=("bin", density), daughters_form=("x", laws.daughters(line))
            ).assign_coords(x=line, bin=0.5 * (edges[1:] + edges[:-1]))
        axes[5].axis("off")
        axes[5].plot([], [], "o", color=BLUE, markersize=3, label="table, 90 %")
        axes[5].plot([], [], color=VERMILION, label="short form")
        axes[5].plot([], [], "--", color=VERMILION, label="S as a step")
        axes[5].legend(loc="center")
        for ax in axes[:4]:
            ax.set(xscale="log", yscale="log", xlabel="primaries P")
            _plain_ticks(ax)
    return save(figure, data, path)


def _beside(
    ax: Axes,
    data: xr.Dataset,
    name: str,
    size: np.ndarray,
    value: np.ndarray,
    limits: tuple[np.ndarray, ...] | None,
) -> None:
    """What the table says, kept in `data` under its name."""
    error = None if limits is None else [np.maximum(value - limits[0], 0), np.maximum(limits[1] - value, 0)]
    ax.errorbar(size, value, error, color=BLUE, marker="o", markersize=3, linestyle="none", elinewidth=0.8)
    data[name] = ("P", np.interp(data.P.values, size, value))


def _form(
    ax: Axes,
    data: xr.Dataset,
    name: str,
    size: np.ndarray,
    value: np.ndarray,
    every: np.ndarray,
    line: str = "-",
) -> None:
    ax.plot(size, value, line, color=VERMILION)
    column = np.full(every.size, np.nan)
    column[np.isin(every, size)] = value[np.isin(size, every)]
    data[f"{name}_form"] = ("P", column)
