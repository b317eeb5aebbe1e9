"""All figures of a set of datasets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from mcdem.analysis.dataset import RunDataset, by_stress
from mcdem.encounter import trajectory
from mcdem.encounter.trajectory import Trajectory
from mcdem.errors import UserError
from mcdem.figures import (
    breakup,
    clusters,
    encounter,
    forces,
    growth,
    outcomes,
    shape,
    size_distribution,
    strength,
)
from mcdem.figures.figure import Figure
from mcdem.figures.style import look
from mcdem.netcdf.whole_files import FILES

OF_ALL_RUNS = (
    growth.mean_size,
    growth.sauter_diameter,
    clusters.cluster_pictures,
    clusters.table_2,
    breakup.critical_size,
)
"""One figure for all stresses together."""
OF_ONE_STRESS = (
    size_distribution.by_primaries,
    size_distribution.by_radius,
    shape.mass_size,
    shape.solid_fraction,
    shape.aspect_distribution,
    shape.aspect_against_size,
    shape.coordination,
    shape.isostaticity,
    breakup.largest_fragment,
    outcomes.outcome_offset,
    outcomes.first_bond_loss,
    outcomes.bond_tension,
    strength.static_load,
)
"""One figure for each stress, its replicas together."""


def figures_of(runs: Sequence[RunDataset], trajectories: Sequence[Trajectory] = ()) -> Iterator[Figure]:
    """Every figure that the datasets allow."""
    ordered = sorted(runs, key=lambda run: run.stress)
    if ordered:
        if (force := forces.pair_force(ordered[0].scene)) is not None:
            yield force
        for make in OF_ALL_RUNS:
            yield make(ordered)
    groups = by_stress(ordered)
    for group in groups.values():
        several = f"_{group[0].stress:.4g}Pa" if len(groups) > 1 else ""
        for figure in (growth.width(group[0]), *(make(group) for make in OF_ONE_STRESS)):
            if figure is not None:
                yield figure.named(figure.name + several)
    for k, course in enumerate(trajectories):
        figure = encounter.snapshots(course)
        yield figure.named(figure.name + (f"_{k + 1}" if len(trajectories) > 1 else ""))


def draw_all(files: Sequence[Path], directory: Path) -> Iterator[Path]:
    """Write every figure and its numbers into the directory, over those that it wrote before; yields each picture as it is done.

    files : datasets of `mcdem run`, and trajectories of `mcdem encounter`, in any order
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
        for figure in figures_of(runs, trajectories):
            yield figure.save(directory)


def plot_run(file: Path, output: Path) -> None:
    """<P>(t) and d32(t) of one run, with the slope of Eq. 22 at the start."""
    numbers = growth.course(RunDataset(file))
    with look():
        canvas = growth.draw_course(numbers)
        FILES.write_picture(output, canvas)
