"""Results in words: what a solution, a comparison, a law over stresses and a table say, as lines to print."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from pbekit.arguments import LEVEL
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.study.compare import Comparison
from pbekit.study.evidence import MOST_EXTRAPOLATED, breakups, supported_steady_state
from pbekit.study.solve_table import extrapolated_from
from pbekit.study.uncertainty import eta_11, mean_size_gradient, variance_shares
from pbekit.tables.counts import share_in_words, weighted_share
from pbekit.tables.kernel_table import OUTCOMES, KernelTable


def with_band(numbers: Mapping[str, Any], name: str, unit: float = 1.0, digits: int = 3) -> str:
    """A number and its band, "10.5 (10.2 ... 10.9)", from entries name, name_low and name_high."""
    text = f"{unit * float(numbers[name]):.{digits}g}"
    low, high = (numbers.get(f"{name}_{end}", np.nan) for end in ("low", "high"))
    if np.isfinite(low) and np.isfinite(high):
        text += f" ({unit * float(low):.{digits}g} ... {unit * float(high):.{digits}g})"
    return text


def solution_report(data: xr.Dataset) -> list[str]:
    """What `solve_table` found."""
    about, lines = data.attrs, []
    if "no_steady_state" in about:
        lines.append(str(about["no_steady_state"]))
        end = {
            f"{name}": data[name].values[-1]
            for name in ("mean_size", "mean_size_low", "mean_size_high")
            if name in data
        }
        lines.append(
            f"<P> at t = {float(data.time[-1]):.4g} s is {with_band(end, 'mean_size', digits=4)}; "
            f"mass drift {float(abs(data.mass_drift).max()):.1e}"
        )
    else:
        lines.append(
            f"steady <P> = {with_band(about, 'steady_mean_size', digits=4)}, "
            f"sigma_P/<P> = {with_band(about, 'steady_relative_deviation')}, "
            f"d32 = {with_band(about, 'steady_sauter_diameter', 1e6)} um; "
            f"mass drift {float(abs(data.mass_drift).max()):.1e}; "
            f"{100 * about['steady_extrapolated_mass']:.2g} % of the mass that changes size extrapolated, "
            f"{100 * about['edge_flux']:.2g} % of the mass flux beyond the grid"
        )
    if "at_rest_from" in about:
        lines[-1] += f"; at rest from t = {about['at_rest_from']:.4g} s on"
    late = extrapolated_from(data)
    if late is not None:
        lines.append(
            f"from t = {late:.4g} s on up to {100 * float(data.extrapolated_mass.max()):.2g} % of the mass that changes size "
            f"(more than {100 * MOST_EXTRAPOLATED:.2g} %) meets in classes that nobody sampled: the course is a guess there"
        )
    if "assumed" in about:
        lines += [f"assumed: {line}" for line in str(about["assumed"]).splitlines()]
    if "no_band" in about:
        lines.append(f"no band: {about['no_band']}")
    return lines


COMPARED = (
    ("mean_size", "steady <P>", 1.0),
    ("relative_deviation", "sigma_P/<P>", 1.0),
    ("sauter_diameter", "d32 [um]", 1e6),
)
INSIDE = (
    ("mean_size", "<P>(t)"),
    ("size_deviation", "sigma_P(t)"),
    ("sauter_diameter", "d32(t)"),
    ("late_share", "sizes late in the run"),
)


def comparison_report(result: Comparison) -> list[str]:
    """A balance beside its Monte Carlo and analytical laws: a table, and what lies within which band."""
    n = result.numbers
    lines = [result.no_steady_state] if result.no_steady_state else []
    lines += _in_columns([["", "balance (90 % band)", "Monte Carlo (90 %)", "analytical"], *_compared(n)])
    run = result.run
    if run is not None:
        if not run.is_steady:
            lines.append(
                f"the run is not steady: <P> still drifts ({run.trend:+.1f} standard errors a block)"
            )
        lines += [
            f"<P> at t = {n['end']:.4g} s: balance {with_band(n, 'end_mean_size')}, "
            f"single runs {n['end_mean_size_run_low']:.3g} ... {n['end_mean_size_run_high']:.3g}, "
            f"Monte Carlo {n['end_mean_size_monte_carlo']:.3g}",
            "share of the Monte Carlo within the 90 % band of single runs: "
            + ", ".join(f"{name} {100 * n[f'{key}_inside']:.0f} %" for key, name in INSIDE),
            f"distance of sizes from {n['late_from']:.3g} s on: {n['late_distance']:.3f}; "
            f"90 % of single runs are within {n['late_distance_run_high']:.3f}",
        ]
    lost = f"{100 * n['unresolved']:.2g} % unresolved"
    if "extrapolated_flux" in n:
        lost = f"{100 * n['extrapolated_flux']:.2g} % of encounters extrapolated, {lost}"
    lines.append(lost)
    table = result.ablation
    lines.append(
        f"<P> at t = {table.attrs['until']:.4g} s, steady <P> and distance of sizes from the Monte Carlo's, "
        "with one assumption changed:"
    )
    columns = (table.end_mean_size.values, table.mean_size.values, table.late_distance.values)
    for name, *values in zip(table.assumption.values, *columns, strict=True):
        lines.append(f"  {name:36s}" + "".join(f" {_or_dash(value):>8}" for value in values).rstrip(" -"))
    return lines


def _or_dash(value: float) -> str:
    return f"{value:.3f}" if np.isfinite(value) else "-"


def _compared(n: Mapping[str, float]) -> list[list[str]]:
    rows = []
    for key, name, unit in COMPARED:
        mean, error = n.get(f"{key}_monte_carlo"), n.get(f"{key}_monte_carlo_error")
        rows.append(
            [
                name,
                with_band(n, key, unit) if key in n else "none",
                "" if mean is None or error is None else f"{unit * mean:.3g} +- {1.645 * unit * error:.2g}",
                f"{unit * n[f'{key}_analytical']:.3g}" if f"{key}_analytical" in n else "",
            ]
        )
    law = f"{n['eta_11_equation_23']:.3g}" if "eta_11_equation_23" in n else ""
    rows.append(["eta_11", with_band(n, "eta_11"), "", law])
    return rows


def _in_columns(rows: list[list[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]


STRESS_ROWS = (
    ("mean_size", "steady <P>", 1.0),
    ("breakup_size", "P_br", 1.0),
    ("sauter_diameter", "d32 [um]", 1e6),
)


def stress_report(law: xr.Dataset, etas: xr.Dataset) -> list[str]:
    """Sizes against stress and their exponents (`over_stresses.stress_law`), eta_11 beside them."""
    lines = []
    for k, stress in enumerate(law.stress.values):
        one = {str(name): law[name].values[k] for name in law.data_vars}
        eta = {str(name): etas[name].values[k] for name in etas.data_vars}
        parts = [
            f"{stress:6.4g} Pa",
            f"eta_11 {with_band(eta, 'eta_11')}"
            + (f", Eq. 23 {eta['equation_23']:.4f}" if np.isfinite(eta["equation_23"]) else ""),
        ]
        parts += [
            f"{name} {with_band(one, key, unit) if np.isfinite(one[key]) else 'none'}"
            for key, name, unit in STRESS_ROWS
        ]
        if np.isfinite(one.get("mean_size_interpolated", np.nan)):
            guess = with_band(one, "mean_size_interpolated")
            parts.append(f"from its neighbours {guess}" + ("" if "(" in guess else ", error unknown"))
        if np.isfinite(one["extrapolated"]):
            parts.append(f"{100 * one['extrapolated']:.2g} % extrapolated")
        lines.append("  ".join(parts))
        if one["no_steady_state"]:
            lines.append(f"          {one['no_steady_state']}")
    for key, name, _ in STRESS_ROWS:
        if f"q_{key}" not in law.attrs:
            lines.append(f"{name} ~ stress^-q: no exponent, it takes three stresses with this number")
            continue
        about = law.attrs
        laws = about.get(f"q_{key}_analytical")
        lines.append(
            f"{name} ~ stress^-q: q = {about[f'q_{key}']:.2f} ({about[f'q_{key}_low']:.2f} ... {about[f'q_{key}_high']:.2f}), "
            f"{about[f'stresses_{key}']} stresses over {about[f'decades_{key}']:.2f} decades"
            + ("" if laws is None else f"; analytical laws {laws:.2f}")
        )
    if "mean_size_interpolated_inside" in law.attrs:
        lines.append(
            f"bands from the neighbours hold {law.attrs['mean_size_interpolated_inside']} steady <P>; "
            f"{100 * LEVEL:g} % are meant to"
        )
    return lines


def _broke(estimated: EstimatedRates) -> str:
    """Share of the encounters that left more aggregates than entered, in words."""
    r = estimated.records
    if not r.weighted:
        return share_in_words(breakups(estimated.table), len(r))
    value, low, high = np.multiply(100, weighted_share(r.products > 2, r.weight))
    return f"{value:.3g} % ({low:.3g} to {high:.3g} %)"


def table_report(table: KernelTable, largest: int = 10) -> list[str]:
    """What a table holds, how sure its balance is, and which pairs of classes make its error; lines."""
    totals = table.counts.sum(axis=0)
    seen = ", ".join(f"{n} {o}" for n, o in zip(totals, OUTCOMES, strict=True) if n)
    lines = [f"{len(table.records)} encounters ({seen})"]
    weight = table.records.weight
    if table.records.weighted:
        lines.append(
            f"they carry weights of {weight.min():.2g} to {weight.max():.2g}: of what does not depend on offset they say as "
            f"much as  {weight.sum() ** 2 / (weight**2).sum():.0f} that count alike"
        )
    sampled = int((table.counts.sum(axis=1) > 0).sum())
    lines.append(
        f"{table.classes} classes of size and {table.shape_name}; {sampled} of {table.pairs} pairs sampled"
    )
    numbers = dict(zip(("eta_11", "eta_11_low", "eta_11_high"), eta_11(table), strict=True))
    lines.append(
        "eta_11: no pair of primaries met"
        if np.isnan(numbers["eta_11"])
        else f"eta_11 = {with_band(numbers, 'eta_11')}"
    )
    estimated = EstimatedRates(table, grid_for(table))
    steady, evidence = supported_steady_state(estimated, start_of(estimated.grid, table))
    lines.append(f"broke: {_broke(estimated)}")
    if steady is None:
        lines.append(evidence.refusal(table))
        return lines
    shares = variance_shares(estimated, steady, mean_size_gradient(estimated.mean, steady.population))
    mean = steady.population @ estimated.grid.mass / steady.population.sum()
    lines.append(f"steady <P> = {mean:.4g}, standard error {shares.deviation:.2g}; shares of its variance:")
    lines += [
        f"  {100 * share:5.1f} %  {name} ({trials} trials)" for name, share, trials in shares.largest(largest)
    ]
    if shares.of_law > 0:
        share = shares.of_law / shares.deviation**2
        lines.append(f"  {100 * share:5.1f} %  the fitted law, where classes lean on it")
    return lines
