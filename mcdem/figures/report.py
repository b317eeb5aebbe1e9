"""A page on what a run was and what came of it, with its figures and its warnings."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jinja2

from mcdem.analysis import paper
from mcdem.analysis.breakup import in_convention
from mcdem.analysis.dataset import FEW_BREAKUPS, RunDataset
from mcdem.analysis.paper_comparison import RULE, compare
from mcdem.analysis.statistics import STEADY_TEST, share
from mcdem.effects.sums import contact_equilibrium
from mcdem.encounter.capture_efficiency import van_de_ven_mason
from mcdem.errors import UserError
from mcdem.figures import figures_of
from mcdem.figures.outcomes import pull_off_force
from mcdem.figures.style import COLUMN, look, plural
from mcdem.netcdf.whole_files import FILES
from mcdem.scene import describe

BOLTZMANN, ROOM_TEMPERATURE = 1.380649e-23, 298.15
TEMPLATE = Path(__file__).with_name("report.html.j2")


def parameters(run: RunDataset) -> list[tuple[str, str, str, str]]:
    """(table, key, value in SI, meaning) of everything the scene holds."""
    rows = []
    tables = {(key.table, key.key): key for key in describe()}
    for (table, name), key in tables.items():
        if not name:
            continue
        value: Any = run.scene
        for part in (*table.split("."), name):
            value = getattr(value, part, None)
        if value is None:
            continue
        text = f"{value:.6g}" if isinstance(value, float) else str(value)
        rows.append((table, name, text, key.meaning))
    return rows


def dimensionless_groups(run: RunDataset) -> list[tuple[str, str, float]]:
    """(symbol, meaning, value) of what governs the run."""
    scene, a = run.scene, run.radius
    stress, attraction = scene.flow.shear_stress, scene.effects.attraction
    groups = [
        ("φ", "volume fraction of the primaries", scene.suspension.volume_fraction),
        (
            "Pe",
            f"6πμa³γ̇/k_BT at {ROOM_TEMPERATURE:g} K: flow against Brownian motion, which is not simulated",
            6 * math.pi * stress * a**3 / (BOLTZMANN * ROOM_TEMPERATURE),
        ),
    ]
    if scene.hydrodynamics.lubrication:
        meaning = "gap over radius at which lubrication is cut off"
        groups.insert(1, ("δ", meaning, scene.hydrodynamics.lubrication_cutoff))
    if (adhesion := pull_off_force(run)) is not None:
        groups.append(
            ("6πμγ̇a²/F_adh", "viscous force against pull-off force", scene.reduced.force / adhesion)
        )
        rest, _ = contact_equilibrium(1.0, scene.kernels.contact)
        groups.append(("h_eq/a", "gap of a free contact", rest))
    if attraction is not None:
        number = attraction.number(stress, a)
        groups.append(("C_A = A_H/36πμγ̇a³", "van der Waals attraction against viscous force", number))
        groups.append(
            ("η₁₁", "0.95 C_A^0.18, efficiency of monomer collisions (Eq. 23)", van_de_ven_mason(run.scene))
        )
        groups.append(("ℓ₀/a", "least approach", attraction.minimum_approach / a))
    return groups


def outcomes(run: RunDataset) -> list[dict[str, Any]]:
    """Count, share with 95 % limits and effort of each outcome."""
    words, cpu = run.outcome, run.events["cpu_time"].values
    rows = []
    for name in str(run.events["outcome"].attrs["flag_meanings"]).split():
        chosen = words == name
        portion, low, high = share(int(chosen.sum()), len(words))
        effort = float(cpu[chosen].mean()) if chosen.any() else math.nan
        rows.append(
            {
                "name": name,
                "count": int(chosen.sum()),
                "share": portion,
                "low": low,
                "high": high,
                "cpu": effort,
            }
        )
    return rows


def _too_long(run: RunDataset) -> str:
    """What share of the encounters may be unresolved for the length of their approach; empty outside of simple shear."""
    numerics = run.scene.numerics
    if run.scene.flow.kind != "simple_shear":
        return ""
    # g y dx dy over |y| < h, across the whole of the circle of radius R, is g R h^2 of (2/3) g R^3.
    portion = 1.5 * (numerics.start_distance / numerics.longest_approach) ** 2
    return (
        f" Offsets at which the undisturbed flow takes longer than numerics.longest_approach = {numerics.longest_approach:g} "
        f"carry {portion:.2g} of the flux; of their encounters those are unresolved that did not meet in that time."
    )


def warnings(run: RunDataset) -> Iterator[str]:
    """What a reader should know before believing a number.

    Parameters
    ----------
    run : RunDataset
        What is read.

    Yields
    ------
    str
        A sentence each: no steady state, few breakups, unresolved encounters and the like.

    Examples
    --------
    >>> from mcdem.analysis import RunDataset
    >>> from mcdem.figures import warnings
    >>> for sentence in warnings(RunDataset("notebooks/data/run-750Pa-of-100.nc")):
    ...     print(sentence.partition(":")[0].partition(" (")[0])
    No steady state
    2 encounters were left unresolved
    The sample was doubled 4 times by exact copy
    """
    if not run.steady.reached:
        yield (
            f"No steady state: {run.steady.reason}. Steady means: {STEADY_TEST}. Numbers called steady are those of "
            "the last 40 % of the run."
        )
    late = int(in_convention(run.late_breakups, "paper").sum())
    if late < FEW_BREAKUPS:
        yield (
            f"Few breakups: {late} in the stretch that counts, fewer than {FEW_BREAKUPS}; the shares of fragmentation "
            "and erosion are uncertain by more than 6 % of all."
        )
    unresolved = int((run.outcome == "unresolved").sum())
    if unresolved:
        portion, low, high = share(unresolved, len(run.outcome))
        yield (
            f"{unresolved} encounters were left unresolved ({portion:.2%}, 95 % limits {low:.2%} to {high:.2%}); "
            f"their parents stayed as they were.{_too_long(run)}"
        )
    if run.doublings:
        yield (
            f"The sample was doubled {plural(run.doublings, 'time')} by exact copy: its aggregates are not "
            "independent, and errors from this run alone are lower bounds. Independent seeds give honest ones."
        )
    if not any(paper.holds_for(run.scene, stress) for stress in paper.STRESSES):
        yield "The scene is not one of the paper's three: nothing is compared with it."


def report(file: Path | str) -> str:
    r"""HTML of the report of one run, all in one file.

    Parameters
    ----------
    file : Path or str
        Dataset of `mcdem run`.

    Returns
    -------
    str
        A page that needs no network.

    Raises
    ------
    DataFileError
        Of another file.

    Examples
    --------
    >>> from mcdem.figures import report
    >>> page = report("notebooks/data/run-750Pa-of-100.nc")
    >>> page.startswith("<!"), "src=\"http" in page
    (True, False)
    """
    run = RunDataset(file)
    run.scene.require_one_radius("the report is made of the paper's figures; `mcdem plot` draws its course")
    if not run.events.sizes["event"]:
        raise UserError(f"{run.path}: holds no encounter yet; let `mcdem run` go on with --resume")
    pictures, left_out = [], list[str]()
    for figure in figures_of([run], left_out=left_out.append):
        buffer = io.BytesIO()
        with look():
            drawn = figure.draw(figure.numbers)
            drawn.savefig(buffer, format="png", dpi=150)
        is_wide = drawn.get_size_inches()[0] > 1.3 * COLUMN
        pictures.append((figure.name, figure.caption, base64.b64encode(buffer.getvalue()).decode(), is_wide))
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["percent"] = lambda x: "–" if x != x else f"{100 * x:.2f} %"
    environment.filters["number"] = lambda x: "–" if x != x else f"{x:.4g}"
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        run=run,
        generator=FILES.signature,
        parameters=parameters(run),
        groups=dimensionless_groups(run),
        outcomes=outcomes(run),
        warnings=list(warnings(run)),
        rows=compare([run]),
        rule=RULE,
        figures=pictures,
        left_out=left_out,
        events=run.events.sizes["event"],
        end=float(run.time[-1]),
        mean_size=run.average("mean_size"),
        sauter=run.average("sauter_diameter"),
        source=paper.SOURCE,
    )
