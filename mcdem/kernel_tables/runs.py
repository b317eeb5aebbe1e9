"""Encounters of a run's event log as records of a table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.similarity import COHESION, groups
from mcdem.errors import UserError
from mcdem.scene import Scene
from pbekit.tables.kernel_table import OUTCOMES, SOURCES, KernelTable, Records

PHYSICS = ("suspension", "flow", "effects", "hydrodynamics", "numerics")
"""Tables of a scene that decide what an encounter does."""


def outcome_of(word: str, contact: bool) -> int:
    """pbekit's outcome of mcdem's."""
    if word == "fragmentation":
        word += " with contact" if contact else " without contact"
    return OUTCOMES.index(word)


def records_of_run(run: RunDataset) -> Records:
    """Every encounter of a run's event log."""
    e = run.events
    names = [
        f"{of}_{name}" for of in ("parent", "product") for name in ("aspect_ratio", "radius_of_gyration")
    ]
    # Runs made before these were recorded are told apart by outer radius alone.
    shapes = [
        e[n].values if n in e else np.full_like(e[n.partition("_")[0] + "_outer_radius"].values, np.nan)
        for n in names
    ]
    touched = e["contact"].values.astype(bool)
    return Records(
        size=e["parent_size"].values,
        aspect_ratio=shapes[0],
        outer_radius=e["parent_outer_radius"].values,
        radius_of_gyration=shapes[1],
        offset=e["offset"].values,
        outcome=np.array(
            [outcome_of(str(w), c) for w, c in zip(run.outcome, touched, strict=True)], np.int64
        ),
        source=np.full(len(touched), SOURCES.index("run")),
        time=e["time"].values,
        solves=e["solves"].values,
        cpu_time=e["cpu_time"].values,
        products=e["number_of_products"].values,
        product_size=e["product_size"].values,
        product_from_first=e["product_from_first"].values,
        product_aspect_ratio=shapes[2],
        product_outer_radius=e["product_outer_radius"].values,
        product_radius_of_gyration=shapes[3],
    )


def same_physics(one: Scene, other: Scene) -> str | None:
    """The first table in which two scenes differ in what an encounter does, or None."""
    for table in PHYSICS:
        if getattr(one, table) != getattr(other, table) and table != "suspension":
            return table
    return None if one.suspension.radius == other.suspension.radius else "suspension"


def with_runs(designed: KernelTable, runs: Sequence[RunDataset]) -> KernelTable:
    """The table that `tabulate` made of these runs, from its designed encounters alone and the event logs again.

    Parameters
    ----------
    designed : KernelTable
        Of which only the designed encounters were kept; its classes stay as they are.
    runs : sequence of RunDataset
        Those that it names in `about["runs"]`.

    Returns
    -------
    KernelTable
        With every encounter of the runs.

    Raises
    ------
    UserError
        Of other runs.

    Examples
    --------
    >>> import mcdem
    >>> import pbekit
    >>> designed = pbekit.open_table("notebooks/data/designed-1500Pa.nc")
    >>> run = mcdem.open_run("notebooks/data/run-1500Pa-of-100.nc")
    >>> table = mcdem.with_runs(designed, [run])
    >>> designed.records.size.shape[0], table.records.size.shape[0]
    (400, 105800)
    """
    names = " ".join(run.path.name for run in runs)
    if names != designed.about["runs"]:
        raise UserError(f"runs = {names}: expected {designed.about['runs']}, with which the table was made")
    table = designed.with_records(
        Records.join([*(records_of_run(run) for run in runs), only_designed(designed).records])
    )
    return replace(table, about={**table.about, **groups_of_scene(runs[0].scene)}) if runs else table


def only_designed(table: KernelTable) -> KernelTable:
    """The designed encounters of a table, in its classes; `with_runs` gives it back."""
    return table.with_records(table.records.select(table.records.source == SOURCES.index("designed")))


def groups_of_scene(scene: Scene) -> dict[str, Any]:
    """Attributes of a table that say the dimensionless groups of its scene."""
    found = groups(scene)
    about: dict[str, Any] = {"groups": json.dumps(found)}
    if COHESION in found:
        about[COHESION] = found[COHESION].value
    return about
