"""Several tables beside each other: efficiency, steady sizes and breakup size against stress, with their exponents."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from pbekit.errors import PBEError
from pbekit.estimated_rates.closures import Closure, grid_for, start_of
from pbekit.estimated_rates.stress_interpolation import Between, stress_of
from pbekit.solution.steady import steady_state
from pbekit.study.analytical import AnalyticalBalance, van_de_ven_mason_of
from pbekit.study.uncertainty import band, draws_of, eta_11, steady_output, steady_summary
from pbekit.tables.kernel_table import KernelTable

OVER_STRESSES = {"mean_size": "1", "breakup_size": "1", "sauter_diameter": "m"}


ANALYTICAL_Q = 2.0
"""Exponent of the breakup size of analytical laws: what the paper finds (section 3), and others of compact aggregates."""


def efficiencies(tables: list[KernelTable]) -> xr.Dataset:
    """eta_11 of each table with its interval, and Eq. 23, against stress."""
    stress = np.array([stress_of(t) for t in tables])
    order = np.argsort(stress)
    counted = np.array([eta_11(tables[k]) for k in order])
    law = [van_de_ven_mason_of(tables[k]) if "hamaker_constant" in tables[k].about else np.nan for k in order]
    columns = {
        "eta_11": counted[:, 0],
        "eta_11_low": counted[:, 1],
        "eta_11_high": counted[:, 2],
        "equation_23": law,
    }
    data = xr.Dataset({n: ("stress", v, {"units": "1"}) for n, v in columns.items()})
    return data.assign_coords(stress=("stress", stress[order], {"units": "Pa"}))


def breakup_size(closure: Closure, rng: np.random.Generator | None = None) -> float:
    """P_br: joint size at which half of the encounters that join or scatter scatter, among encounters with equal partners.

    By the fitted law, so that it is defined for any table.
    """
    law = closure.law if rng is None else closure.law.drawn(rng)
    size = np.geomspace(1.5, 2000, 400)
    records, table = closure.records, closure.table
    seen = np.log(records.shape(table.shape_name, table.radius)[records.size > 2])
    typical = np.exp(np.nanmean(seen)) if closure.grid.shapes > 1 else np.nan
    shape = np.where(size > 2, typical, np.nan)
    p = law(law.features(size, size, shape, shape))
    share = p[:, 2] / (p[:, 1] + p[:, 2])
    above = np.flatnonzero(share > 0.5)
    return float(2 * size[above[0]]) if above.size else np.nan


def stress_law(
    tables: list[KernelTable], draws: int = 60, progress: Callable[[float], None] | None = None
) -> xr.Dataset:
    """Steady <P>, d32 and breakup size against stress with bands, and the exponent q of each, X ~ stress^-q.

    *_interpolated : steady <P> and d32 from the tables at the next lower and the next higher stress alone, with bands; nan
    at the ends, which have no two neighbours
    *_analytical : van de Ven & Mason's efficiency with power-law breakup, which is given <P> at the stress with most
    encounters (attribute `reference`) and P_br ~ stress^-ANALYTICAL_Q; extrapolated : share of encounters in pairs of
    classes nobody sampled; breakup_beyond : whether P_br is larger than any two partners together were
    """
    if len(tables) < 2:
        raise PBEError("a law over stresses needs tables at two stresses or more")
    stress = np.array([stress_of(t) for t in tables])
    order = np.argsort(stress)
    stress, tables = stress[order], [tables[k] for k in order]
    values: dict[str, list] = {name: [] for name in OVER_STRESSES}
    extrapolated, beyond, interpolated = [], [], []
    for k, table in enumerate(tables):
        closure = Closure(table, grid_for(table))
        start = start_of(closure.grid, table)
        steady = steady_state(closure.mean, start)
        mean = steady_summary(closure.mean, steady.population)
        drawn = draws_of(closure, steady_output(start, guess=steady.population), draws, seed=k)
        for name in ("mean_size", "sauter_diameter"):
            values[name].append(np.append(mean[name], drawn[name].values))
        rng = np.random.default_rng(k)
        values["breakup_size"].append(
            [breakup_size(closure)] + [breakup_size(closure, rng) for _ in range(draws)]
        )
        interpolated.append(
            _from_neighbours(tables[k - 1], tables[k + 1], stress[k], draws, k)
            if 0 < k < len(tables) - 1
            else {}
        )
        extrapolated.append(closure.extrapolated_flux(steady.population))
        beyond.append(values["breakup_size"][-1][0] > table.records.size.sum(axis=1).max())
        if progress is not None:
            progress((k + 1) / len(tables))
    found = xr.Dataset(
        {"extrapolated": ("stress", extrapolated), "breakup_beyond": ("stress", beyond)},
        {"stress": ("stress", stress, {"units": "Pa"})},
    )
    for name, rows in values.items():
        each = np.array(rows)
        low, high = np.nanquantile(each[:, 1:], [0.05, 0.95], axis=1)
        bands = {name: each[:, 0], f"{name}_low": low, f"{name}_high": high}
        found = found.assign({n: ("stress", v, {"units": OVER_STRESSES[name]}) for n, v in bands.items()})
        q = -np.polyfit(np.log(stress), np.log(each), 1)[0]
        found.attrs |= {
            f"q_{name}": q[0],
            f"q_{name}_low": np.nanquantile(q[1:], 0.05),
            f"q_{name}_high": np.nanquantile(q[1:], 0.95),
        }
    if all("hamaker_constant" in t.about for t in tables):
        found = found.merge(_analytical_over_stresses(tables, stress, found.mean_size.values))
        for name in ("mean_size", "sauter_diameter"):
            slope = np.polyfit(np.log(stress), np.log(found[f"{name}_analytical"].values), 1)[0]
            found.attrs[f"q_{name}_analytical"] = -slope
        found.attrs["reference"] = stress[_most_encounters(tables)]
    if len(tables) > 2:
        for name in dict.fromkeys(name for row in interpolated for name in row):
            unit = {"units": OVER_STRESSES[name.partition("_interpolated")[0]]}
            found[name] = ("stress", [row.get(name, np.nan) for row in interpolated], unit)
    return found


def _from_neighbours(
    lower: KernelTable, upper: KernelTable, stress: float, draws: int, seed: int
) -> dict[str, float]:
    """Steady <P> and d32 [m] at a stress [Pa] from tables below and above it, with their bands.

    Nothing where they cannot be interpolated: of one stress, or of other shear rates or shapes.
    """
    try:
        closure = Between(lower, upper, stress)
    except PBEError:
        return {}
    start = start_of(closure.grid, lower)
    steady = steady_state(closure.mean, start)
    mean = steady_summary(closure.mean, steady.population)
    drawn = draws_of(closure, steady_output(start, guess=steady.population), draws, seed=seed)
    found: dict[str, float] = {}
    for name in ("mean_size", "sauter_diameter"):
        low, high = band(drawn[name].values)
        found |= {
            f"{name}_interpolated": float(mean[name]),
            f"{name}_interpolated_low": float(low),
            f"{name}_interpolated_high": float(high),
        }
    return found


def _most_encounters(tables: list[KernelTable]) -> int:
    return int(np.argmax([len(t.records) for t in tables]))


def _analytical_over_stresses(tables, stress, mean_size) -> xr.Dataset:
    """Steady <P> and d32 of the analytical balance that is right at one stress."""
    reference = _most_encounters(tables)
    fitted = AnalyticalBalance.fitted(tables[reference], float(mean_size[reference]))
    rows = []
    for table, value in zip(tables, stress, strict=True):
        laws = fitted.at(table, value / stress[reference], ANALYTICAL_Q)
        balance = laws.balance()
        rows.append(steady_summary(balance, steady_state(balance, start_of(laws.grid, table)).population))
    names = ("mean_size", "sauter_diameter")
    return xr.Dataset({f"{n}_analytical": ("stress", [float(row[n]) for row in rows]) for n in names})
