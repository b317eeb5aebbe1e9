"""Figures the paper lacks: where encounters hit, when bonds first fail, how hard bonds are pulled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.statistics import share, shares
from mcdem.figures.figure import Figure, NothingToShowError, quantity
from mcdem.figures.style import BLACK, GREY, OUTCOME, canvas, headline, legend_below, plain_ticks, plural

FEWEST_BINS, MOST_BINS, A_BIN = 5, 20, 100
"""Bins of the offset, and how many encounters each should have."""


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
    bins = int(np.clip(len(offset) // A_BIN, FEWEST_BINS, MOST_BINS))
    edges = np.linspace(0, 1, bins + 1)
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


A_CURVE = 10
"""Encounters below which the limits of a distribution cover all of it: the number is given instead."""
MOST_SHOWN = 1500
"""Points of one outcome: more would hide each other. The legend says of how many each is one."""


def draw_outcome_offset(numbers: xr.Dataset) -> Canvas:
    """Left: encounters in the quarter of the cross section; right: share of each outcome against y0."""
    figure, (left, right) = canvas(6.2, 3.3, ncols=2)
    outcome = numbers["outcome"].values
    edge = numbers["edge"].values
    middle = 0.5 * (edge[1:] + edge[:-1])
    totals = numbers["count"].sum("kind").values
    known = totals > 0
    for kind, (tint, marker) in OUTCOME.items():
        rows = np.flatnonzero(outcome == kind)
        if not len(rows):
            continue
        # An even choice, the same at every drawing.
        one_of = max(1, -(-len(rows) // MOST_SHOWN))
        drawn = rows[::one_of]
        size, alpha = (3, 0.35) if kind == "missed" else (7, 0.75)
        thinned = f" (a point each {one_of})" if one_of > 1 else ""
        left.scatter(
            numbers["x0"][drawn],
            numbers["y0"][drawn],
            size,
            color=tint,
            marker=marker,
            alpha=alpha,
            linewidths=0.6 if marker == "x" else 0,
            label=f"{kind}: {len(rows)}{thinned}",
            zorder=1 if kind == "missed" else 2,
        )
        if kind == "missed":
            continue
        count = numbers["count"].sel(kind=kind).values
        limits = np.array([share(int(k), int(n)) for k, n in zip(count, totals, strict=True)])
        right.plot(middle[known], limits[known, 0], color=tint, marker=marker, ms=2.5, lw=0.8)
        right.fill_between(middle[known], limits[known, 1], limits[known, 2], color=tint, alpha=0.18, lw=0)
    arc = np.linspace(0, np.pi / 2, 100)
    left.plot(np.cos(arc), np.sin(arc), color=GREY, lw=0.6)
    left.set_aspect("equal")
    left.set(xlabel="vorticity  $|x_0|/(R_i+R_j)$", ylabel="gradient  $|y_0|/(R_i+R_j)$")
    left.set_xlim(0, 1.02)
    left.set_ylim(0, 1.02)
    right.set(xlabel="gradient  $|y_0|/(R_i+R_j)$", ylabel="share of encounters, the rest missed")
    right.set_xlim(0, 1)
    right.set_ylim(0, None)
    headline(left, "offsets drawn in proportion to the flux")
    headline(right, f"{plural(len(outcome), 'encounter')}; bands: 95 % (Wilson)")
    legend_below(figure, ncols=3)
    return figure


# Time to first bond loss


def first_bond_loss(runs: Sequence[RunDataset]) -> Figure:
    """Strain from the first contact to the first bond lost after it."""
    if any("first_bond_loss_time" not in run.events for run in runs):
        raise NothingToShowError("first_bond_loss: the dataset does not hold the times of first bond losses")
    found = _gathered(runs)
    wait = found["first_bond_loss_time"].values - np.nan_to_num(found["first_contact_time"].values)
    if not (wait > 0).any():
        raise NothingToShowError(
            f"first_bond_loss: no encounter at {runs[0].label} lost a bond after contact"
        )
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
    figure, axes = canvas(height=3.0)
    outcome, wait = numbers["outcome"].values, numbers["wait"].values
    every = wait[wait > 0]
    begin = max(min(0.05, 0.5 * float(np.quantile(every, 0.01))), 1e-3)
    end = max(20.0, 1.5 * float(every.max()))
    for kind, (tint, _) in OUTCOME.items():
        chosen = outcome == kind
        if kind in ("missed", "unresolved") or not chosen.any():
            continue
        total = int(chosen.sum())
        lost = np.sort(wait[chosen & (wait > 0)])
        at = np.concatenate([[min([begin, *lost[:1]])], lost, [end]])
        without = total - np.minimum(np.arange(len(at)), len(lost))
        axes.step(at, without / total, where="post", color=tint, label=f"{kind}: {len(lost)} of {total}")
        _, low, high = shares(without, total)
        axes.fill_between(at, low, high, step="post", color=tint, alpha=0.2, lw=0)
    axes.axvline(2 * np.pi, color=GREY, lw=0.7, ls=":", label="half a turn of a sphere")
    axes.set(xscale="log", xlabel=r"strain since contact  $\dot\gamma t$", ylabel="share with all bonds yet")
    axes.set_xlim(begin, end)
    axes.set_ylim(0, 1.02)
    plain_ticks(axes.xaxis)
    legend_below(figure, "encounters that lost a bond, of all of that outcome; bands: 95 %")
    return figure


# Bond tension


def bond_tension(runs: Sequence[RunDataset]) -> Figure:
    """Largest tension met in each encounter over the pull-off force."""
    found = _gathered(runs)
    pulled = found["outcome"].values[found["tension"].values > 0]
    if not any((pulled == kind).sum() >= A_CURVE for kind in OUTCOME):
        raise NothingToShowError(
            f"bond_tension: {len(pulled)} encounters at {runs[0].label} pulled a bond, of no outcome {A_CURVE} or more"
        )
    return Figure(
        "bond_tension",
        f"Share of encounters whose largest bond tension exceeds a share of the pull-off force at {runs[0].label}.",
        found[["outcome", "tension", "size"]],
        draw_bond_tension,
    )


def draw_bond_tension(numbers: xr.Dataset) -> Canvas:
    """Share pulled harder than a tension, by outcome.

    As what exceeds, not as a density: many encounters of one tension are a step, which hides nothing behind it, and a single
    one is as tall as it is worth.
    """
    figure, axes = canvas(height=3.0)
    tension, outcome = numbers["tension"].values, numbers["outcome"].values
    pulled = np.isfinite(tension) & (tension > 0)
    end = 1.04 * max(1.0, float(tension[pulled].max()))
    few: list[str] = []
    for kind, (tint, _) in OUTCOME.items():
        found = np.sort(tension[pulled & (outcome == kind)])
        total = len(found)
        if total < A_CURVE:
            few += [f"{kind}: {total}"] if total else []
            continue
        at, first = np.unique(found, return_index=True)
        x = np.concatenate([[0.0], at, [end]])
        above = np.concatenate([[total], np.append(total - first[1:], 0), [0]])
        axes.step(
            x, above / total, where="post", color=tint, label=f"{kind}: {total}"
        )  # fmt: skip
        _, low, high = shares(above, total)
        axes.fill_between(x, low, high, step="post", color=tint, alpha=0.18, lw=0)
    axes.axvline(1.0, color=BLACK, lw=0.7, ls=":", label="pull-off")
    axes.set_xlim(0, end)
    axes.set_ylim(0, 1.02)
    axes.set(
        xlabel=r"tension over pull-off force  $F_{adh}$",
        ylabel="share pulled harder",
    )
    small_print = "encounters in which a bond was pulled; bands: 95 %"
    if few:
        small_print += f"\ntoo few for a curve: {', '.join(few)}"
    legend_below(figure, small_print)
    return figure
