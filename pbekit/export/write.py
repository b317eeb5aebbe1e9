"""Write a table for a solver: the files of its target, and a page that says what each is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pbekit.errors import PBEError
from pbekit.export.menu import target
from pbekit.export.plain_files import NOTES, plain_files
from pbekit.export.target import MARK, HandOver, Target
from pbekit.files import Kind
from pbekit.outputs import FILES
from pbekit.study.fitted_laws import fitted_laws
from pbekit.study.size_rates import size_rates
from pbekit.study.solve_table import open_table, solve_table
from pbekit.tables.kernel_table import KernelTable
from pbekit.tables.similarity import Conditions, at_conditions

TABLES = Kind("table of pbekit export", (b"class,", b"class_i,", b"time [s],mean_size"), (b"[1]",))
MARKED = Kind("file of pbekit export", (b"",), (MARK.encode(),))


@dataclass(frozen=True)
class Exported:
    """What a call of `export_table` left.

    Parameters
    ----------
    folder : where
    files : written, by name
    given : what was written

    Examples
    --------
    >>> import tempfile
    >>> import pbekit
    >>> table = "notebooks/data/designed-1000Pa.nc"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     exported = pbekit.export_table(table, "csv", folder, draws=20, largest=40, until=10.0)
    >>> exported.given.source
    'designed-1000Pa.nc'
    """

    folder: Path
    files: tuple[str, ...]
    given: HandOver


def hand_over(
    table: KernelTable | Path | str,
    *,
    source: str | None = None,
    conditions: Conditions | None = None,
    draws: int = 60,
    seed: int = 0,
    until: float = 300.0,
    volume_fraction: float | None = None,
    exact_to: int = 32,
    largest: int | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> HandOver:
    """Rates, fitted laws and solution of a table, as targets take them.

    Parameters
    ----------
    table : KernelTable, str or Path
        Of encounters, or its file.
    source : str
        What the table is called on the page; its file's name by default.
    conditions : Conditions
        Other than the table's, of the same cohesion number.
    draws : int
        Posterior draws for all limits and bands.
    seed : int
        Of the draws.
    until : float
        End of the course [s].
    volume_fraction : float
        Of primaries [-]; that of the table's scene by default.
    exact_to, largest : int
        Sizes with a class of their own, and the largest size (twice the largest seen by default).
    progress : callable
        Called with what is being done and the share of all that is done.

    Returns
    -------
    HandOver
        What `export_table` writes, for several targets at the price of one.

    Raises
    ------
    PBEError
        Of a table that cannot be read, or options that do not fit.

    Examples
    --------
    >>> from pbekit.export import hand_over
    >>> given = hand_over("notebooks/data/designed-1000Pa.nc", draws=20, largest=40, until=10.0)
    >>> given.rates.aggregation_rate.value.shape, "mean_size" in given.solution
    ((34, 34), True)
    """
    report = progress or (lambda what, share: None)
    if source is None:
        source = "the table" if isinstance(table, KernelTable) else Path(table).name
    opened = table if isinstance(table, KernelTable) else open_table(table)
    assumed: list[str] = []
    if conditions is not None:
        (opened, *_), _, assumed = at_conditions([opened], conditions)
    rates = size_rates(
        opened,
        draws=draws,
        seed=seed,
        exact_to=exact_to,
        largest=largest,
        volume_fraction=volume_fraction,
        progress=lambda share: report("rates", 0.4 * share),
    )
    report("fits", 0.4)
    laws = fitted_laws(rates)
    solution = solve_table(
        opened,
        shapes=None,
        draws=draws,
        seed=seed,
        until=until,
        volume_fraction=volume_fraction,
        exact_to=exact_to,
        largest=largest,
        progress=lambda what, share: report(what, 0.5 + 0.5 * share),
    )
    return HandOver(rates, laws, solution, source, tuple(assumed))


def export_table(
    table: KernelTable | Path | str | HandOver,
    to: str,
    folder: Path | str,
    *,
    overwrite: bool = False,
    progress: Callable[[str, float], None] | None = None,
    **options: object,
) -> Exported:
    """Write a table of encounters for a solver.

    Parameters
    ----------
    table : of encounters, its file, or what `hand_over` made of it
    to : one of `TARGETS`
    folder : to write to; made if it is not there
    overwrite : replace files of an export that are there
    progress : called with what is being done and the share of all that is done
    **options : of `hand_over`

    Raises
    ------
    PBEError : of a target that is not known, a table that lacks what the target needs, or a folder that holds other files of
        these names

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import pbekit
    >>> table = "notebooks/data/designed-1000Pa.nc"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     exported = pbekit.export_table(table, "csv", folder, draws=20, largest=40, until=10.0)
    >>> exported.files[:3]
    ('classes.csv', 'pairs.csv', 'daughters.csv')
    """
    chosen = target(to)
    given = table if isinstance(table, HandOver) else hand_over(table, progress=progress, **options)  # type: ignore[arg-type]
    if np.isnan(given.volume_fraction):
        raise PBEError(f"{given.source}: the table does not say its volume fraction; give one")
    files: dict[str, str | bytes] = {**plain_files(given), **chosen.files(given)}
    files["README.md"] = page(to, chosen, given, list(files))
    place = Path(folder)
    with FILES.folder(place):
        for name in files:
            FILES.check(place / name, _kind(name), overwrite=overwrite)
        for name, content in files.items():
            with FILES.replacing(place / name, _kind(name)) as beside:
                beside.write_bytes(content if isinstance(content, bytes) else content.encode())
    return Exported(place, tuple(files), given)


def exported_report(done: Exported) -> list[str]:
    """What was left, in lines."""
    given = done.given
    lines = [f"{done.folder}: {', '.join(done.files)}"]
    steady = given.steady_mean_size
    if steady is None:
        lines.append(str(given.solution.attrs.get("no_steady_state", "no steady state")))
    else:
        lines.append(
            f"a solver should come to the steady <P> = {steady[0]:.4g} ({steady[1]:.4g} ... {steady[2]:.4g})"
        )
    residuals = [
        f"{name} {100 * law['largest_residual']:.2g} %"
        for name, law in given.laws.record().items()
        if law is not None
    ]
    lines.append(f"largest residuals of the short forms: {', '.join(residuals)}")
    return lines


def _kind(name: str) -> Kind:
    return TABLES if name.endswith(".csv") else MARKED


def page(name: str, chosen: Target, given: HandOver, files: list[str]) -> str:
    """README.md: what each file is, what the target cannot represent, how to check."""
    rates = given.rates
    about = rates.table.about
    lines = [
        f"# Kernels for {chosen.title}",
        "",
        f"Written by {MARK} from `{given.source}`: {len(rates.table.records)} encounters of aggregates of primaries of "
        f"{given.radius * 1e9:g} nm in simple shear at g = {given.shear_rate:g} 1/s"
        + (
            f", viscosity {float(about['viscosity']):g} Pa s (stress {float(about['viscosity']) * given.shear_rate:g} Pa)"
            if "viscosity" in about
            else ""
        )
        + (
            f", cohesion number N = {float(about['cohesion_number']):.4g}"
            if "cohesion_number" in about
            else ""
        )
        + f". Sizes are numbers of primaries P, seen up to {int(rates.table.records.size.max())}; everything is the mean over "
        "shapes. Limits are 90 %.",
        "",
        "The balance, with the sum over pairs i <= j of classes:",
        "",
        "    dn_k/dt = sum n_i n_j / (1 + delta_ij) [K_ij (a_k - delta_ki - delta_kj) + B_ij (nu_k - delta_ki - delta_kj)]",
        "",
        "a_k shares the aggregate of P_i + P_j between the two pivots beside it so that number and mass are "
        "kept (fixed pivot); nu_k "
        "are the daughters. What would be beyond the last class is put on it with its mass. "
        f"It starts from n_1 = {given.primaries:.6g} 1/m^3, a volume fraction of {given.volume_fraction:g}.",
        "",
        "| file | what it is |",
        "|---|---|",
    ]
    notes = {**NOTES, **chosen.notes}
    lines += [f"| `{file}` | {notes[file]} |" for file in files]
    lines += ["", "## What it comes to", ""]
    steady = given.steady_mean_size
    if steady is None:
        lines.append(str(given.solution.attrs.get("no_steady_state", "No steady state.")))
    else:
        lines.append(f"Steady mean size <P> = {steady[0]:.4g} ({steady[1]:.4g} to {steady[2]:.4g}).")
    first = rates.first_order
    if not rates.breaks:
        lines += ["", "No encounter of the table broke an aggregate: there is no breakup in these files."]
    elif first is None:
        lines += ["", f"No first-order rates: {rates.no_first_order}"]
    else:
        lines += [
            "",
            "Breakup here happens in encounters, of second order in number. The first-order rates are those in "
            f"{first.words} at a "
            f"volume fraction of {first.volume_fraction:g}; they are proportional to phi g, and wrong in any other population.",
        ]
    share = float(rates.extrapolated.mean())
    lines += [
        "",
        f"{100 * share:.2g} % of the pairs of classes lie where no encounter was made (extrapolated = 1): there the rates are a "
        "fitted law's. The fits of `fit.json` hold within their ranges only:",
        "",
        "| law | form | largest residual | of |",
        "|---|---|---|---|",
    ]
    for law, record in given.laws.record().items():
        if record is None:
            lines.append(f"| {law} | none: too few encounters | | |")
        else:
            formula = str(record["formula"]).replace("|", "abs ")
            lines.append(
                f"| {law} | {formula} | {100 * record['largest_residual']:.2g} % | {record['largest_residual_of']} |"
            )
    if given.assumed:
        lines += ["", "## Other conditions than the table's", "", *(f"- {text}" for text in given.assumed)]
    lines += ["", f"## What {name} cannot represent", "", *(f"- {text}" for text in chosen.cannot)]
    lines += ["", "## How to check", "", chosen.check, ""]
    return "\n".join(lines)
