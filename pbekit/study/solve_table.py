"""The balance on tabulated encounters, solved: over time and at steady state, with bands, as one dataset."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbekit import arguments
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.estimated_rates.stress_interpolation import InterpolatedRates, common_grid, interpolate, stress_of
from pbekit.solution.solve import solve
from pbekit.solution.steady import SteadyState
from pbekit.study.evidence import MOST_EXTRAPOLATED, supported_steady_state
from pbekit.study.interpolation_error import InterpolationError, leave_out
from pbekit.study.uncertainty import band, course_output, draws_of, steady_output, steady_summary
from pbekit.tables.kernel_table import KernelTable
from pbekit.tables.similarity import Conditions, at_conditions

COURSE = ("mean_size", "size_deviation", "sauter_diameter")
STEADY = ("mean_size", "relative_deviation", "sauter_diameter")
Progress = Callable[[str, float], None]


def open_table(path: Path | str) -> KernelTable:
    """The table of encounters in a file that `mcdem kernels` wrote; raises `PBEError` for anything else.

    Parameters
    ----------
    path : path
        File of `mcdem kernels` or `mcdem.tabulate`.

    Returns
    -------
    KernelTable
        Encounters in classes.

    Raises
    ------
    PBEError
        Of anything else.

    Examples
    --------
    >>> import pbekit
    >>> table = pbekit.open_table("notebooks/data/designed-1250Pa.nc")
    >>> table.shear_rate, table.radius
    (10000.0, 5e-07)
    """
    if not isinstance(path, str | Path):
        raise PBEError(f"table: got {arguments.shown(path)}, expected the file of one")
    return KernelTable.load(path)


@dataclass(frozen=True)
class Options:
    """How a table is solved.

    until [s, or text such as "10 s"], samples : times kept, from 0 on
    draws : posterior draws for the bands, 0 for none
    scheme : "fixed pivot", "cell average" or "three pivots"; method : integrator of scipy
    outcomes : "table" (classes, with the fitted law as prior) or "smooth" (the law alone)
    """

    until: float = 300.0
    samples: int = 201
    draws: int = 0
    scheme: str = "fixed pivot"
    outcomes: str = "table"
    method: str = "LSODA"
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "until", arguments.until(self.until))
        arguments.whole_number("samples", self.samples, 2, 10**6)
        arguments.draws(self.draws, none=True)
        arguments.whole_number("seed", self.seed, 0, arguments.LARGEST_SEED)
        arguments.method(self.method)
        arguments.scheme(self.scheme)

    @classmethod
    def of(cls, given: dict[str, Any]) -> Options:
        """Options by their names; raises `PBEError` for others."""
        known = [field.name for field in fields(cls)]
        for name in given:
            if name not in known:
                raise PBEError(f"{name}: no option of solve_table, expected one of {', '.join(known)}")
        return cls(**given)


class InterruptedDraws(KeyboardInterrupt):
    """Ctrl-C in the middle of the draws; `solution` holds all but the bands."""

    def __init__(self, solution: xr.Dataset) -> None:
        super().__init__()
        self.solution = solution


def solve_table(
    table: KernelTable | Path | str | Sequence[KernelTable | Path | str],
    *,
    stress: float | None = None,
    conditions: Conditions | None = None,
    volume_fraction: float | None = None,
    shapes: Any = "table",
    exact_to: int = 32,
    largest: int | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> xr.Dataset:
    """Populations over time and at steady state of the balance on a table, with bands.

    Parameters
    ----------
    table : one table or its file; with `stress`, several
    stress : [Pa], interpolated to from the tables at the next lower and the next higher stress.  Bands then hold the error of
        interpolation too, estimated by leaving out each table that lies between two others; with two tables there is none, and
        no band
    conditions : radius of primaries, viscosity, shear rate (and cohesion number) other than the table's; instead of `stress`.
        Of several tables those on both sides of the cohesion number are interpolated between, as between stresses.  The attribute
        `assumed` says what of the other groups differs
    volume_fraction : of primaries; that of the table's scene by default
    shapes : "table", None for one mean shape per size, or boundaries of shape classes
    exact_to, largest : sizes with a class of their own, and the largest size (twice the largest seen by default)
    progress : called with what is being done and the share of all that is done
    **options : of `Options`: until [s], samples, draws, scheme, outcomes, method, seed

    Returns
    -------
    `number` (time, cell) [1/m^3] with its moments `mean_size`, `size_deviation`, `sauter_diameter` [m] and more over `time`
    [s]; `*_low`, `*_high`: 90 % bands, where draws were asked for; `extrapolated_mass` (time): share of the mass that changes
    size which meets in classes nobody sampled.  Where encounters that were seen bear a steady state: `steady_number` (cell),
    `steady_share` (size), the share in number of each size, with its bands, and the attributes `steady_mean_size`,
    `steady_relative_deviation`, `steady_sauter_diameter` with their bands; else the attribute `no_steady_state` says what is
    missing and how to get it.

    Raises
    ------
    PBEError : of a table that cannot be read, or options that do not fit
    InterruptedDraws : (a `KeyboardInterrupt`) with the solution, where the end was asked for in the middle of the draws

    Examples
    --------
    >>> import pbekit
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> solution = pbekit.solve_table(table, until=10.0, samples=5, draws=0, shapes=None, largest=60)
    >>> solution["mean_size"].dims, f"{float(solution['mean_size'][-1]):.0f} primaries after 10 s"
    (('time',), '9 primaries after 10 s')
    """
    chosen, report = Options.of(options), progress or (lambda what, share: None)
    if not isinstance(table, KernelTable | str | Path | Sequence) or (
        isinstance(table, Sequence) and len(table) == 0
    ):
        raise PBEError(f"table: got {arguments.shown(table)}, expected a KernelTable, its file, or several")
    given = [table] if isinstance(table, KernelTable | str | Path) else list(table)
    tables = [t if isinstance(t, KernelTable) else open_table(t) for t in given]
    assumed: list[str] = []
    if conditions is not None:
        if stress is not None:
            raise PBEError("stress: the conditions say it already; give one of them")
        tables, stress, assumed = at_conditions(tables, conditions)
    grid_options = (exact_to, largest, shapes)
    estimated, errors = _rates(tables, stress, chosen, grid_options)
    first = estimated.tables[0]
    start = start_of(estimated.grid, first, volume_fraction)
    times = np.linspace(0.0, chosen.until, chosen.samples)
    report("integrating", 0.0)
    balance = estimated.balance(scheme=chosen.scheme)
    data = solve(
        balance,
        start,
        times,
        method=chosen.method,
        rtol=1e-6,
        progress=lambda t: report("integrating", 0.4 * min(t / chosen.until, 1)),
    )
    data["number"].attrs["units"] = "m-3"
    mass = [estimated.extrapolated_changes(n)[1] for n in data.number.values]
    note = {
        "units": "1",
        "long_name": "share of the mass that changes size in pairs of classes nobody sampled",
    }
    data["extrapolated_mass"] = ("time", mass, note)
    report("steady state", 0.45)
    steady, evidence = supported_steady_state(estimated, start, scheme=chosen.scheme)
    _put_steady(data, estimated, steady)
    if steady is None:
        data.attrs["no_steady_state"] = evidence.refusal(first)
    data.attrs |= {
        "title": "Course of a population balance",
        "unresolved": estimated.unresolved,
        "breakups": evidence.breakups,
    }
    if assumed:
        data.attrs["assumed"] = "\n".join(assumed)
    if stress is None:
        data.attrs["scene"] = str(first.about.get("scene", ""))
    else:
        data.attrs["shear_stress"] = stress
    known = stress is None or len(tables) > 2
    if chosen.draws and known:
        without_bands = data.copy()
        try:
            output = _Output(start, times, steady)
            error = {} if errors is None else errors(output)
            report("draws", 0.5)
            _put_bands(data, estimated, output, error, chosen, report)
        except KeyboardInterrupt:
            without_bands.attrs["no_band"] = "interrupted in the middle of the draws"
            raise InterruptedDraws(without_bands) from None
        _take_back_without_limit(data)
    if stress is not None and not known:
        data.attrs["no_band"] = (
            "two tables leave the error of interpolation between them unknown; give a third, at another stress, for bands"
        )
    report("done", 1.0)
    return data


class _Output:
    """What bands are made of: the course, and the steady state where there is one."""

    def __init__(self, start: np.ndarray, times: np.ndarray, steady: SteadyState | None) -> None:
        self.course = course_output(start, times, rtol=1e-5)
        self.settled = None if steady is None else steady_output(start, guess=steady.population)

    def __call__(self, balance: PopulationBalance) -> dict[str, Any]:
        found: dict[str, Any] = dict(self.course(balance))
        if self.settled is not None:
            steady = self.settled(balance)
            found |= {f"steady_{name}": steady[name] for name in (*STEADY, "share")}
        return found


def _rates(
    tables: list[KernelTable],
    stress: float | None,
    chosen: Options,
    grid_options: tuple[int, int | None, Any],
) -> tuple[EstimatedRates | InterpolatedRates, Callable[[_Output], dict[str, InterpolationError]] | None]:
    """The table on its grid, or those that `stress` lies between; and the error of interpolation of an output."""
    exact_to, largest, shapes = grid_options
    if stress is None:
        if len(tables) != 1:
            raise PBEError(
                f"{len(tables)} tables: say by --stress at which stress between theirs, or give one"
            )
        return EstimatedRates(
            tables[0], grid_for(tables[0], exact_to, largest, shapes), chosen.outcomes
        ), None
    grid = common_grid(tables, exact_to, largest, shapes)
    estimated = interpolate(tables, stress, grid, chosen.outcomes)

    def errors(output: _Output) -> dict[str, InterpolationError]:
        ordered = [EstimatedRates(t, grid, chosen.outcomes) for t in sorted(tables, key=stress_of)]
        return leave_out(ordered, output, [output(c.mean) for c in ordered])

    return estimated, errors


def _put_steady(
    data: xr.Dataset, estimated: EstimatedRates | InterpolatedRates, steady: SteadyState | None
) -> None:
    if steady is None:
        return
    note = {"units": "m-3", "long_name": "steady number concentration"}
    data["steady_number"] = ("cell", steady.population, note)
    summary = steady_summary(steady.balance, steady.population)
    grid = steady.balance.grid
    size = np.bincount(grid.size_of_cell, grid.mass) / np.bincount(grid.size_of_cell)
    data["steady_share"] = (
        "size",
        summary["share"],
        {"units": "1", "long_name": "share in number at steady state"},
    )
    data.coords["size"] = ("size", size, {"units": "1", "long_name": "primaries of an aggregate"})
    number, heavy = estimated.extrapolated_changes(steady.population)
    data.attrs |= {f"steady_{name}": float(summary[name]) for name in STEADY}
    data.attrs |= {
        "steady_extrapolated": number,
        "steady_extrapolated_mass": heavy,
        "edge_flux": float(steady.balance.edge_flux(steady.population)),
    }


def _put_bands(
    data: xr.Dataset,
    estimated: EstimatedRates | InterpolatedRates,
    output: _Output,
    error: dict[str, InterpolationError],
    chosen: Options,
    report: Progress,
) -> None:
    """Bands of the course and of the steady state, the interpolation's error included where there is one."""
    drawn = draws_of(
        estimated,
        output,
        chosen.draws,
        chosen.seed,
        lambda k: report("draws", 0.5 + 0.5 * k / chosen.draws),
        chosen.scheme,
    )
    for name in drawn.data_vars:
        value = data.attrs[name] if name in data.attrs else data[name].values
        rows = drawn[name].values
        if isinstance(estimated, InterpolatedRates) and name in error:
            limits = error[str(name)].widened(value, rows, estimated.gap)
        else:
            limits = band(rows)
        for end, values in zip(("low", "high"), limits, strict=True):
            if name in data.attrs:
                data.attrs[f"{name}_{end}"] = float(values)
            else:
                note = {"units": data[name].attrs.get("units", "1"), "long_name": f"90 % band of {name}"}
                data[f"{name}_{end}"] = (data[name].dims, values, note)


def _take_back_without_limit(data: xr.Dataset) -> None:
    """A steady state that a draw in twenty has no limit for is none."""
    limit = data.attrs.get("steady_mean_size_high", 0.0)
    if np.isfinite(limit):
        return
    for name in [name for name in data.data_vars if str(name).startswith("steady_")]:
        del data[name]
    for name in [name for name in data.attrs if str(name).startswith("steady_")]:
        del data.attrs[name]
    data.attrs["no_steady_state"] = (
        "no steady state: the encounters leave open whether sizes stay finite (in more than 5 % of the draws they grow without "
        "end); more encounters between the largest aggregates are needed (mcdem kernels ... --resume --encounters)"
    )


def cautions(
    tables: Sequence[KernelTable], volume_fraction: float | None, exact_to: int, largest: int | None
) -> list[str]:
    """What is not taken as it was given, and what is doubtful, before tables are solved; arguments as of `solve_table`."""
    lines = []
    seen = max(int(table.records.size.max(initial=1)) for table in tables)
    if largest is not None and seen <= largest < exact_to:
        lines.append(f"exact_to = {exact_to} is taken as {largest}, the largest size")
    phi = tables[0].about.get("volume_fraction") if volume_fraction is None else volume_fraction
    if phi is not None and float(phi) > arguments.DILUTE:
        lines.append(
            f"warning: at a volume fraction of {float(phi):g} encounters are not of two aggregates alone (above "
            f"{arguments.DILUTE:g}): the balance of binary encounters is no longer that of the suspension"
        )
    return lines


def extrapolated_from(data: xr.Dataset) -> float | None:
    """The first time [s] at which too much of the mass that changes size meets in classes nobody sampled, or None."""
    late = np.flatnonzero(data.extrapolated_mass.values > MOST_EXTRAPOLATED)
    return float(data.time.values[late[0]]) if late.size else None
