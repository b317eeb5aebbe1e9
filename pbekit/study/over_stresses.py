"""Several tables beside each other: efficiency, steady sizes and breakup size against stress, with their exponents."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from pbekit import arguments
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.estimated_rates.stress_interpolation import InterpolatedRates, common_grid, stress_of
from pbekit.solution.steady import steady_state
from pbekit.study.analytical import AnalyticalBalance, van_de_ven_mason_of
from pbekit.study.evidence import LEAST_BREAKUPS, supported_steady_state
from pbekit.study.interpolation_error import leave_out
from pbekit.study.uncertainty import band, draws_of, eta_11, steady_output, steady_summary
from pbekit.tables.kernel_table import KernelTable

OVER_STRESSES = {"mean_size": "1", "breakup_size": "1", "sauter_diameter": "m"}


LEAST_STRESSES = 3
"""Distinct stresses that an exponent needs: two give a ratio, and no line is tested by it."""
ANALYTICAL_Q = 2.0
"""Exponent of the breakup size of analytical laws: what the paper finds (section 3), and others of compact aggregates."""


def efficiencies(tables: list[KernelTable]) -> xr.Dataset:
    """eta_11 of each table with its interval, and Eq. 23, against stress.

    Parameters
    ----------
    tables : list of KernelTable
        One for each stress.

    Returns
    -------
    xarray.Dataset
        Over `stress` [Pa], efficiencies [-] with their 90 % intervals.

    Examples
    --------
    >>> import pbekit
    >>> tables = [pbekit.open_table(f"notebooks/data/designed-{stress}Pa.nc") for stress in (750, 1500)]
    >>> found = pbekit.efficiencies(tables)
    >>> found["stress"].values.tolist(), list(found.data_vars)[:3]
    ([750.0, 1500.0], ['eta_11', 'eta_11_low', 'eta_11_high'])
    """
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


def breakup_size(estimated: EstimatedRates, rng: np.random.Generator | None = None) -> float:
    """P_br: joint size at which half of the encounters that join or scatter scatter, among encounters with equal partners.

    By the fitted law, so that it is defined for any table; inf where the share stays below a half up to 4000.
    """
    law = estimated.law if rng is None else estimated.law.drawn(rng)
    size = np.geomspace(1.5, 2000, 400)
    records, table = estimated.records, estimated.table
    seen = np.log(records.shape(table.shape_name, table.radius)[records.size > 2])
    typical = np.exp(np.nanmean(seen)) if estimated.grid.shapes > 1 else np.nan
    shape = np.where(size > 2, typical, np.nan)
    p = law(law.features(size, size, shape, shape))
    share = p[:, 2] / (p[:, 1] + p[:, 2])
    above = np.flatnonzero(share > 0.5)
    return float(2 * size[above[0]]) if above.size else np.inf


@dataclass(frozen=True)
class _AtStress:
    """What one table says: values and draws of each quantity (1 + draws,), nan where nothing bears them."""

    table: KernelTable
    values: dict[str, np.ndarray]
    extrapolated: float
    refusal: str


def stress_law(
    tables: list[KernelTable], draws: int = 60, progress: Callable[[float], None] | None = None
) -> xr.Dataset:
    """Steady <P>, d32 and breakup size against stress with bands, and the exponent q of each, X ~ stress^-q.

    Parameters
    ----------
    tables : one for each stress, two or more
    draws : for the bands
    progress : called with the share that is done

    Returns
    -------
    Values over `stress` [Pa] with `*_low` and `*_high`: nan where encounters that were seen do not bear them, `no_steady_state`
    then says why.  P_br is nan too where it is larger than any two partners together were.
    *_interpolated : steady <P> and d32 from the tables at the next lower and the next higher stress alone, with bands that
    hold the error of interpolation, estimated by the other tables between two (nan without any); the attribute
    *_interpolated_inside says how many of how many values lie in these bands
    *_analytical : van de Ven & Mason's efficiency with power-law breakup, which is given <P> at the stress with most
    encounters (attribute `reference`) and P_br ~ stress^-ANALYTICAL_Q; extrapolated : share of encounters in pairs of
    classes nobody sampled
    q_* : of `stresses_*` distinct stresses over `decades_*`; left out for fewer than LEAST_STRESSES
    """
    if len(tables) < 2:
        raise PBEError("a law over stresses needs tables at two stresses or more")
    arguments.draws(draws)
    tables = sorted(tables, key=stress_of)
    stress = np.array([stress_of(t) for t in tables])
    rows = []
    for k, table in enumerate(tables):
        rows.append(_at_stress(table, draws, k))
        if progress is not None:
            progress(0.7 * (k + 1) / len(tables))
    found = xr.Dataset(
        {
            "extrapolated": ("stress", [row.extrapolated for row in rows], {"units": "1"}),
            "no_steady_state": ("stress", np.array([row.refusal for row in rows], dtype=object)),
        },
        {"stress": ("stress", stress, {"units": "Pa"})},
    )
    for name, unit in OVER_STRESSES.items():
        each = np.array([row.values[name] for row in rows])
        limits = np.array([band(row[1:]) if np.isfinite(row[0]) else [np.nan, np.nan] for row in each]).T
        bands = {name: each[:, 0], f"{name}_low": limits[0], f"{name}_high": limits[1]}
        found = found.assign({n: ("stress", v, {"units": unit}) for n, v in bands.items()})
        found.attrs |= _exponent(name, stress, each)
    supported = [k for k, row in enumerate(rows) if not row.refusal]
    if supported and all("hamaker_constant" in t.about for t in tables):
        found = _with_analytical(found, [tables[k] for k in supported], supported)
    with_interpolation = [tables[k] for k in supported]
    if len(with_interpolation) > 2:
        columns = interpolated(with_interpolation, draws)
        for name, values in columns.items():
            column = np.full(len(tables), np.nan)
            column[supported] = values
            found[name] = ("stress", column, {"units": OVER_STRESSES[name.partition("_interpolated")[0]]})
        for name in ("mean_size", "sauter_diameter"):
            if f"{name}_interpolated_low" in found:
                found.attrs[f"{name}_interpolated_inside"] = _inside(found, name)
    if progress is not None:
        progress(1.0)
    return found


def _at_stress(table: KernelTable, draws: int, seed: int) -> _AtStress:
    nothing = np.full(1 + draws, np.nan)
    estimated = EstimatedRates(table, grid_for(table))
    start = start_of(estimated.grid, table)
    steady, evidence = supported_steady_state(estimated, start)
    values = dict.fromkeys(OVER_STRESSES, nothing)
    extrapolated = np.nan
    if steady is not None:
        mean = steady_summary(estimated.mean, steady.population)
        drawn = draws_of(estimated, steady_output(start, guess=steady.population), draws, seed=seed)
        for name in ("mean_size", "sauter_diameter"):
            values[name] = np.append(mean[name], drawn[name].values)
        extrapolated = estimated.extrapolated_flux(steady.population)
    if evidence.breakups >= LEAST_BREAKUPS and breakup_size(estimated) <= evidence.largest:
        rng = np.random.default_rng(seed)
        values["breakup_size"] = np.array(
            [breakup_size(estimated)] + [breakup_size(estimated, rng) for _ in range(draws)]
        )
    return _AtStress(table, values, extrapolated, "" if steady is not None else evidence.refusal(table))


def _exponent(name: str, stress: np.ndarray, each: np.ndarray) -> dict[str, float]:
    """q of X ~ stress^-q with its band, from values and draws (stresses, 1 + draws)."""
    known = np.isfinite(each).all(axis=1)
    distinct = np.unique(stress[known])
    if distinct.size < LEAST_STRESSES:
        return {}
    q = -np.polyfit(np.log(stress[known]), np.log(each[known]), 1)[0]
    low, high = band(q[1:])
    return {
        f"q_{name}": q[0],
        f"q_{name}_low": low,
        f"q_{name}_high": high,
        f"stresses_{name}": distinct.size,
        f"decades_{name}": float(np.log10(distinct[-1] / distinct[0])),
    }


def interpolated(tables: list[KernelTable], draws: int) -> dict[str, np.ndarray]:
    """Steady <P> and d32 [m] at each inner stress from its two neighbours, with bands; nan at both ends.

    The error of interpolation at one stress is estimated from the other inner tables, each predicted without the table at that
    stress.  Empty where tables cannot be interpolated: of one stress, or of other shear rates or shapes.
    """
    stress = [stress_of(t) for t in tables]
    if np.any(np.diff(stress) <= 0) or not all(_alike(tables[0], t) for t in tables[1:]):
        return {}
    grid = common_grid(tables)
    of_tables = [EstimatedRates(t, grid) for t in tables]
    start = start_of(grid, tables[0])
    settled = [steady_state(c.mean, start) for c in of_tables]
    own = [steady_summary(c.mean, s.population) for c, s in zip(of_tables, settled, strict=True)]
    names = ("mean_size", "sauter_diameter")
    found = {
        f"{n}_interpolated{end}": np.full(len(tables), np.nan) for n in names for end in ("", "_low", "_high")
    }
    for k in range(1, len(tables) - 1):
        middle = InterpolatedRates.of(of_tables[k - 1], of_tables[k + 1], stress[k])
        near = steady_output(start, guess=settled[k].population)
        output = lambda b, near=near: {name: near(b)[name] for name in names}
        value = output(middle.mean)
        others = [j for j in range(len(tables)) if j != k]
        errors = leave_out([of_tables[j] for j in others], output, [own[j] for j in others])
        for name in names:
            found[f"{name}_interpolated"][k] = value[name]
        if not errors:
            continue
        drawn = draws_of(middle, output, draws, seed=k)
        for name in names:
            low, high = errors[name].widened(value[name], drawn[name].values, middle.gap)
            found[f"{name}_interpolated_low"][k], found[f"{name}_interpolated_high"][k] = low, high
    return found


def _alike(one: KernelTable, other: KernelTable) -> bool:
    return all(getattr(one, name) == getattr(other, name) for name in ("radius", "shear_rate", "shape_name"))


def _inside(found: xr.Dataset, name: str) -> str:
    """How many of the values lie in the bands of their interpolation."""
    value, low, high = (
        found[f"{name}{end}"].values for end in ("", "_interpolated_low", "_interpolated_high")
    )
    known = np.isfinite(low) & np.isfinite(value)
    return f"{int(((value >= low) & (value <= high))[known].sum())} of {int(known.sum())}"


def _with_analytical(found: xr.Dataset, tables: list[KernelTable], rows: list[int]) -> xr.Dataset:
    stress = found.stress.values[rows]
    laws = _analytical_over_stresses(tables, stress, found.mean_size.values[rows])
    for name in ("mean_size", "sauter_diameter"):
        column = np.full(found.sizes["stress"], np.nan)
        column[rows] = laws[f"{name}_analytical"].values
        found[f"{name}_analytical"] = ("stress", column, {"units": OVER_STRESSES[name]})
        if np.unique(stress).size >= LEAST_STRESSES:
            slope = np.polyfit(np.log(stress), np.log(column[rows]), 1)[0]
            found.attrs[f"q_{name}_analytical"] = -slope
    found.attrs["reference"] = stress[_most_encounters(tables)]
    return found


def _most_encounters(tables: list[KernelTable]) -> int:
    return int(np.argmax([len(t.records) for t in tables]))


def _analytical_over_stresses(
    tables: list[KernelTable], stress: np.ndarray, mean_size: np.ndarray
) -> xr.Dataset:
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
