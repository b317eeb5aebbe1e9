"""Encounters of runs into an atlas."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from mcdem.analysis.dataset import RunDataset
from mcdem.errors import DataFileError, UserError
from mcdem.kernel_tables.runs import groups_of_scene, records_of_run, same_physics
from mcdem.netcdf.whole_files import FILES
from mcdem.scene import Scene
from pbekit.errors import PBEError
from pbekit.tables.atlas import Atlas, Part
from pbekit.tables.kernel_table import KernelTable


def into_atlas(scene: Scene, runs: Sequence[Path | str], path: Path | str) -> Atlas:
    """Add the encounters of runs of a scene to an atlas, each run as a part of its own; made if it is not there.

    Parameters
    ----------
    scene : that the runs are of
    runs : datasets of `mcdem run`
    path : the atlas (.nc)

    Raises
    ------
    UserError : of runs of another scene
    DataFileError : of an atlas of other groups than the scene's, or one that holds a run already

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-750Pa.toml")
    >>> mcdem.into_atlas(scene, ["notebooks/data/run-750Pa.nc"], "my-atlas.nc")  # doctest: +SKIP
    """
    path = Path(path)
    if path.suffix != ".nc":
        raise UserError(f"{path}: expected a name that ends in .nc, the atlas that is written is NetCDF")
    scene.require_one_radius("an atlas counts equal primaries")
    with FILES.locked(path):
        try:
            atlas = Atlas.load(path) if path.exists() else Atlas(())
            for place in runs:
                run = RunDataset(place)
                differs = same_physics(scene, run.scene)
                if differs:
                    raise UserError(f"{place}: was run with another [{differs}] than {scene.name}")
                about = {
                    "scene": run.scene.text,
                    "scene_name": scene.name,
                    "runs": Path(place).name,
                    "seed": str(run.attributes.get("seed", "")),
                    "command": shlex.join(["mcdem", *sys.argv[1:]]),
                    **groups_of_scene(scene),
                }
                flow = scene.flow
                table = KernelTable.of(
                    records_of_run(run), scene.suspension.radius, flow.shear_rate, shapes=1, about=about
                )
                atlas = atlas.merged(Part.of(table))
            atlas.save(path)
        except PBEError as problem:
            raise DataFileError(str(problem)) from None
    return atlas
