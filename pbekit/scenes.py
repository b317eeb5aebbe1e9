"""Conditions of a scene file of `mcdem`, which alone knows what its groups are: asked for by name, when a scene is given.

No other file of `pbekit` knows of `mcdem`, and this one needs it for scenes alone: tables, balances and hand-over do without.
"""

from __future__ import annotations

import importlib
from pathlib import Path

from pbekit.errors import PBEError
from pbekit.tables.kernel_table import KernelTable
from pbekit.tables.similarity import Conditions, Group, elsewhere

KNOWS = "mcdem.analysis.similarity"
"""Module whose `conditions_of_file` reads a scene."""


def conditions_of_scene(path: Path | str) -> tuple[Conditions, float]:
    """Conditions of a scene file with all its groups, and its volume fraction.

    Parameters
    ----------
    path : Path or str
        A scene in TOML, with units.

    Returns
    -------
    Conditions, float
        For `solve_table` and `export_table`.

    Raises
    ------
    PBEError
        Of what is no scene of simple shear, or where `mcdem` is not installed.

    Examples
    --------
    >>> from pbekit.scenes import conditions_of_scene
    >>> conditions, volume_fraction = conditions_of_scene("scenes/paper-1000Pa.toml")
    >>> round(conditions.stress), volume_fraction
    (1000, 0.0001)
    """
    try:
        asked = importlib.import_module(KNOWS)
    except ModuleNotFoundError:
        raise PBEError(f"{path}: scenes are read by mcdem, which is not installed") from None
    try:
        found = asked.conditions_of_file(path)
    except asked.UserError as problem:
        raise PBEError(str(problem)) from None
    groups = {name: Group(*values) for name, values in found["groups"].items()}
    conditions = Conditions(found["radius"], found["viscosity"], found["shear_rate"], groups=groups)
    return conditions, float(found["volume_fraction"])


def conditions_given(
    table: KernelTable,
    scene: Path | None,
    volume_fraction: float | None,
    *,
    radius: float | None,
    viscosity: float | None,
    shear_rate: float | None,
    cohesion: float | None,
) -> tuple[Conditions | None, float | None]:
    """What a command's options say: conditions other than the table's, or None, and the volume fraction, or None.

    A volume fraction given stands before that of the scene.  Raises `PBEError` where both a scene and its quantities are given.
    """
    given = {
        "--radius": radius,
        "--viscosity": viscosity,
        "--shear-rate": shear_rate,
        "--cohesion": cohesion,
    }
    named = [name for name, value in given.items() if value is not None]
    if scene is not None:
        if named:
            raise PBEError(f"{named[0]}: the scene {scene} says it already; give one of them")
        conditions, own = conditions_of_scene(scene)
        return conditions, own if volume_fraction is None else volume_fraction
    if not named:
        return None, volume_fraction
    return elsewhere(table, radius, viscosity, shear_rate, cohesion), volume_fraction
