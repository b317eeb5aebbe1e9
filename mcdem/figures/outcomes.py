"""Figures the paper lacks: where encounters hit, when bonds first fail, how hard bonds are pulled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.statistics import count_limits, share, shares
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, GREY, OUTCOME, canvas, legend

BINS = 20


def _gathered(runs: Sequence[RunDataset]) -> xr.Dataset:
    """Encounters of replicas one after another: outcome, offset in R_i + R_j, times in strains, tension in pull-offs."""
    columns = []
    for run in runs:
        e = run.events
        rate = run.scene.flow.shear_rate
        strain = {
            name: e[name].values * rate if name in e else np.full(e.sizes["event"], np.nan)
            for name in ("first_contact_time", "first_bond_loss_time", "last_bond_change_time")
        }
        columns.append(
            xr.Dataset(
                {
                    "outcome": ("event", run.outcome.astype(str)),
                    "offset": (
                        ("event", "cross_section"),
                        e["offset"].values / e["parent_outer_radius"].values.sum(axis=1)[:, None],
                    ),
                    "both_monomers": ("event", (e["parent_size"].values == 1).all(axis=1)),
                    "size": ("event", e["parent_size"].values.sum(axis=1)),
                    "tension": ("event", e["largest_tension"].values / (pull_off_force(run) or np.nan)),
                    **{name: ("event", values) for name, values in strain.items()},
                }
            )
        )
    return xr.concat(columns, "event", join="exact")


def pull_off_force(run: RunDataset) -> float | None:
    """Pull-off force of a contact [N]; None in a scene without contacts."""
    contact = run.scene.effects.contact
    return float(contact.pull_off_force(run.radius)) if contact is not None else None


# Outcome against offset


def outcome_offset(runs: Sequence[RunDataset]) -> Figure:
    """Where in the cross section an encounter starts, and how it ends."""
    found = _gathered(runs)
    offset = np.abs(found["offset"].values)
    edges = np.linspace(0, 1, BINS + 1)
    counts = [np.histogram(offset[found["outcome"].values == outcome, 1], edges)[0] for outcome in OUTCOME]
    numbers = found[["outcome", "both_monomers"]]
    numbers["x0"] = quantity(offset[:, 0], "event", "1", "offset along vorticity over R_i + R_j")
    numbers["y0"] = quantity(offset[:, 1], "event", "1", "offset along gradient over R_i + R_j")
    numbers = numbers.assign_coords(kind=list(OUTCOME))
    numbers["count"] = quantity(counts, ("kind", "bin"), "1", "encounters by offset along the gradient")
    numbers["edge"] = quantity(edges, "edge", "1", "edges of the bins of y0/(R_i + R_j)")
    return Figure(
        "outcome_offset",
        f"Outcome of the encounters against their offset in the cross section at {runs[0].label}.",
        numbers,
        draw_outcome_offset,
    )


MOST_SHOWN = 1500


def draw_outcome_offset(numbers: xr.Dataset) -> Canvas:
    """Left: encounters in the quarter of the cross section; right: share of each outcome against y0."""
    figure, (left, right) = canvas(6.2, 2.9, ncols=2)
    outcome = numbers["outcome"].values
    shown = np.zeros(len(outcome), dtype=bool)
    # Misses outnumber all else: an even choice of them, the same at every drawing.
    for kind in OUTCOME:
        rows = np.flatnonzero(outcome == kind)
        shown[rows[:: max(1, -(-len(rows) // MOST_SHOWN))]] = True
    for kind, (colour, marker) in OUTCOME.items():
        chosen = shown & (outcome == kind)
        total = int((outcome == kind).sum())
        if not total:
            continue
        size, alpha = (3, 0.35) if kind == "missed" else (7, 0.75)
        left.scatter(
            numbers["x0"][chosen],
            numbers["y0"][chosen],
            size,
            color=colour,
            marker=marker,
            alpha=alpha,
            linewidths=0.4 if marker == "x" else 0,
            label=f"{kind}: {total}",
            zorder=1 if kind == "missed" else 2,
        )
    arc = np.linspace(0, np.pi / 2, 100)
    left.plot(np.cos(arc), np.sin(arc), color=GREY, lw=0.6)
    left.set_aspect("equal")
    left.set_xlim(0, 1.02)
    left.set_ylim(0, 1.02)
    left.set_xlabel("vorticity  $|x_0|/(R_i+R_j)$")
    left.set_ylabel("gradient  $|y_0|/(R_i+R_j)$")
    left.legend(
        loc="upper left",
        bbox_to_anchor=(0.5, 1.01),
        fontsize=5.5,
        markerscale=1.2,
        frameon=True,
        framealpha=0.9,
        edgecolor="none",
    )
    edge = numbers["edge"].values
    middle = 0.5 * (edge[1:] + edge[:-1])
    totals = numbers["count"].sum("kind").values
    for kind, (colour, marker) in OUTCOME.items():
        count = numbers["count"].sel(kind=kind).values
        if not count.any() or kind == "missed":
            continue
        limits = np.array([share(int(k), int(n)) for k, n in zip(count, totals, strict=True)])
        known = totals > 0
        right.plot(middle[known], limits[known, 0], color=colour, marker=marker, ms=2.5, lw=0.8, label=kind)
        right.fill_between(middle[known], limits[known, 1], limits[known, 2], color=colour, alpha=0.18, lw=0)
    right.set_xlim(0, 1)
    right.set_ylim(0, None)
    right.set_xlabel("gradient  $|y_0|/(R_i+R_j)$")
    right.set_ylabel("share of encounters")
    legend(right, "bands: 95 % (Wilson)", loc="upper right")
    return figure


# Time to first bond loss


def first_bond_loss(runs: Sequence[RunDataset]) -> Figure | None:
    """Strain from the first contact to the first bond lost after it; None where the dataset does not hold it."""
    if any("first_bond_loss_time" not in run.events for run in runs):
        return None
    found = _gathered(runs)
    wait = found["first_bond_loss_time"].values - np.nan_to_num(found["first_contact_time"].values)
    numbers = found[["outcome"]]
    numbers["wait"] = quantity(
        wait,
        "event",
        "1",
        "strain g t from the first contact (or the start, without one) to the first bond loss",
    )
    return Figure(
        "first_bond_loss",
        f"Strain from contact to the first loss of a bond at {runs[0].label}.",
        numbers,
        draw_first_bond_loss,
    )


def draw_first_bond_loss(numbers: xr.Dataset) -> Canvas:
    """Share of encounters that have lost no bond yet, against strain since contact, by outcome."""
    figure, axes = canvas()
    outcome, wait = numbers["outcome"].values, numbers["wait"].values
    for kind, (colour, _) in OUTCOME.items():
        chosen = outcome == kind
        if kind in ("missed", "unresolved") or not chosen.any():
            continue
        lost = np.sort(wait[chosen & (wait > 0)])
        total = chosen.sum()
        left = 1 - np.arange(len(lost) + 1) / total
        axes.step(
            np.concatenate([[1e-2], lost]),
            left,
            where="post",
            color=colour,
            label=f"{kind}: {len(lost)} of {total}",
        )
        if len(lost):
            _, low, high = shares(total - np.arange(len(lost) + 1), int(total))
            axes.fill_between(
                np.concatenate([[1e-2], lost]),
                low,
                high,
                step="post",
                color=colour,
                alpha=0.2,
                lw=0,
            )
    axes.axvline(2 * np.pi, color=GREY, lw=0.6, ls=":")
    axes.text(2 * np.pi, 1.04, "half a turn", fontsize=5.5, ha="center")
    axes.set_xscale("log")
    axes.set_xlim(0.05, 200)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_ylim(0, 1.12)
    axes.set_xlabel(r"strain since contact  $\dot\gamma t$")
    axes.set_ylabel("share with all bonds yet")
    # Above the axes: the curves may go anywhere.
    legend(axes, "lost a bond, of all; bands: 95 %", loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
    return figure


# Bond tension


def bond_tension(runs: Sequence[RunDataset]) -> Figure:
    """Largest tension met in each encounter over the pull-off force."""
    found = _gathered(runs)
    return Figure(
        "bond_tension",
        f"Largest bond tension of each encounter over the pull-off force at {runs[0].label}.",
        found[["outcome", "tension", "size"]],
        draw_bond_tension,
    )


def draw_bond_tension(numbers: xr.Dataset) -> Canvas:
    """Density of the largest tension by outcome."""
    figure, axes = canvas()
    tension, outcome = numbers["tension"].values, numbers["outcome"].values
    pulled = np.isfinite(tension) & (tension > 0)
    edges = np.linspace(0, max(1.2, tension[pulled].max(initial=1.0) * 1.02), 61)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for kind, (colour, _) in OUTCOME.items():
        chosen = pulled & (outcome == kind)
        if chosen.sum() < 2:
            continue
        count = np.histogram(tension[chosen], edges)[0]
        density = count / chosen.sum() / (edges[1] - edges[0])
        low, high = (limit / chosen.sum() / (edges[1] - edges[0]) for limit in count_limits(count))
        axes.plot(
            middle, density, color=colour, drawstyle="steps-mid", lw=0.9, label=f"{kind}: {chosen.sum()}"
        )
        axes.fill_between(middle, low, high, step="mid", color=colour, alpha=0.2, lw=0)
    axes.axvline(1.0, color=BLACK, lw=0.6, ls=":")
    axes.text(1.0, 1.01, "pull-off", transform=axes.get_xaxis_transform(), fontsize=5.5, ha="center")
    axes.set_yscale("symlog", linthresh=1.0)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(0, None)
    axes.set_xlim(0, edges[-1])
    axes.set_xlabel(r"largest tension of an encounter over  $F_{adh}$")
    axes.set_ylabel("probability density")
    axes.set_ylim(0, 6 * axes.get_ylim()[1])
    legend(axes, "encounters; bands: 95 %, Poisson", loc="upper left")
    return figure
