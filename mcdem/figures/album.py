"""All figures of a set of datasets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from mcdem.analysis.dataset import RunDataset, by_stress
from mcdem.encounter import trajectory
from mcdem.encounter.trajectory import Trajectory
from mcdem.errors import UserError
from mcdem.figures import (
    bonds,
    breakup,
    clusters,
    early_growth,
    encounter,
    forces,
    growth,
    mass_size,
    outcomes,
    shape,
    size_distribution,
    strength,
)
from mcdem.figures.figure import Figure, NothingToShowError
from mcdem.figures.style import look
from mcdem.netcdf.whole_files import FILES


def _pair_force(runs: Sequence[RunDataset]) -> Figure:
    return forces.pair_force(runs[0].scene)


OF_ALL_RUNS = (
    _pair_force,
    growth.mean_size,
    early_growth.initial_growth,
    growth.sauter_diameter,
    clusters.cluster_pictures,
    clusters.table_2,
    breakup.critical_size,
)
"""One figure for all stresses together."""
OF_ONE_STRESS = (
    growth.width,
    size_distribution.by_primaries,
    size_distribution.by_radius,
    mass_size.mass_size,
    mass_size.exponents_in_time,
    shape.solid_fraction,
    shape.aspect_distribution,
    shape.aspect_against_size,
    bonds.coordination,
    bonds.isostaticity,
    breakup.largest_fragment,
    outcomes.outcome_offset,
    outcomes.first_bond_loss,
    outcomes.bond_tension,
    strength.static_load,
)
"""One figure for each stress, its replicas together."""


def unheard(line: str) -> None:
    """Say nothing of a figure that is left out."""


def figures_of(
    runs: Sequence[RunDataset],
    trajectories: Sequence[Trajectory] = (),
    left_out: Callable[[str], None] = unheard,
) -> Iterator[Figure]:
    """Every figure that the datasets allow.

    Parameters
    ----------
    runs : of any stresses, in any order; those of one stress are replicas
    trajectories : of encounters
    left_out : called with a line of its name and why for each figure that would show nothing

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.figures import figures_of
    >>> run = mcdem.open_run("notebooks/data/run-750Pa-of-100.nc")
    >>> first = next(figures_of([run]))
    >>> first.name
    'fig05_pair_force'
    """
    ordered = sorted(runs, key=lambda run: run.stress)
    groups = by_stress(ordered)
    wanted = [(partial(make, ordered), "") for make in OF_ALL_RUNS if ordered]
    for group in groups.values():
        several = f"_{group[0].stress:.4g}Pa" if len(groups) > 1 else ""
        wanted += [(partial(make, group), several) for make in OF_ONE_STRESS]
    for k, course in enumerate(trajectories):
        wanted.append((partial(encounter.snapshots, course), f"_{k + 1}" if len(trajectories) > 1 else ""))
    for make, ending in wanted:
        try:
            figure = make()
        except NothingToShowError as why:
            left_out(str(why))
        else:
            yield figure.named(figure.name + ending)


def draw_all(
    files: Sequence[Path], directory: Path, left_out: Callable[[str], None] = unheard
) -> Iterator[Path]:
    """Write every figure and its numbers into the directory, over those that it wrote before; yields each picture as it is done.

    Parameters
    ----------
    files : sequence of Path
        Datasets of `mcdem run`, and trajectories of `mcdem encounter`, in any order.
    directory : Path
        Made if it is not there.
    left_out : callable
        Called with a line of its name and why for each figure that would show nothing.

    Yields
    ------
    Path
        Of a picture; its numbers lie beside it as NetCDF.

    Raises
    ------
    DataFileError
        Of a file that is neither.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from mcdem.figures import draw_all
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pictures = [picture.name for picture in draw_all([Path("notebooks/data/run-750Pa-of-100.nc")], Path(folder))]
    >>> "fig06a_mean_size.png" in pictures
    True
    """
    runs, trajectories = [], []
    for file in files:
        if trajectory.is_trajectory(file):
            trajectories.append(trajectory.read(file))
        else:
            runs.append(RunDataset(file))
    for run in runs:
        run.scene.require_one_radius("the paper's figures are of such; `mcdem plot` draws its course")
        if not run.events.sizes["event"]:
            raise UserError(f"{run.path}: holds no encounter yet; let `mcdem run` go on with --resume")
    with FILES.folder(directory):
        for figure in figures_of(runs, trajectories, left_out):
            yield figure.save(directory)


def plot_run(file: Path, output: Path) -> None:
    """Draw <P>(t) and d32(t) of one run, with the slope of Eq. 22 of Frungieri & Vanni (2021) at the start.

    Parameters
    ----------
    file : Path
        Dataset of `mcdem run`.
    output : Path
        Picture to write; its ending says in which format.

    Raises
    ------
    DataFileError
        Of another file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from mcdem.figures import plot_run
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     picture = Path(folder) / "growth.png"
    ...     plot_run(Path("notebooks/data/run-750Pa-of-100.nc"), picture)
    ...     print(picture.exists())
    True
    """
    numbers = early_growth.course(RunDataset(file))
    with look():
        canvas = early_growth.draw_course(numbers)
        FILES.write_picture(output, canvas)
