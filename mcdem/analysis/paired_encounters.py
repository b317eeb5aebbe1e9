"""The same encounters under several settings of a scene: what `accuracy_cost` and `sensitivity` compare.

Aggregates that a run made meet in the same orientations and offsets whatever the setting, so that differences are paired and
a change shows with few encounters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mcdem.aggregates.aggregate import Aggregate
from mcdem.analysis.dataset import RunDataset
from mcdem.encounter.capture_efficiency import Capture, fejer
from mcdem.encounter.simulate import OUTCOMES, physics_of, simulate_encounter
from mcdem.errors import UserError
from mcdem.hydrodynamics import LEVELS
from mcdem.monte_carlo import executors
from mcdem.netcdf.whole_files import FILES
from mcdem.quantities.random_streams import stream
from mcdem.scene import Scene

REFERENCE = "reference"
"""Name of the setting that others are compared with where accuracy is in question, ..."""
GIVEN = "as given"
"""... and of the scene without a change."""

Progress = Callable[[str, float], None]
"""Called with where it stands, in words, and the share that is done."""


@dataclass(frozen=True)
class Setting:
    """One way to compute.

    varied : what is varied: a key of the scene, or a word for several
    changes : keys of the scene and their values

    Examples
    --------
    >>> from mcdem.analysis import Setting
    >>> coarse = Setting("twice the step", "numerics.implicit.max_step", {"numerics.implicit.max_step": 0.1})
    >>> coarse.varied
    'numerics.implicit.max_step'
    """

    name: str
    varied: str
    changes: dict[str, Any] = field(default_factory=dict)

    @property
    def of_physics(self) -> bool:
        """Whether it changes what is computed and not only how: such settings are shown but never named as the cheapest."""
        return any(key == "numerics.rotations" or not key.startswith("numerics.") for key in self.changes)

    def of(self, scene: Scene) -> Scene:
        """The scene under this setting."""
        return scene.with_changes(self.changes, as_in_file=True) if self.changes else scene


def level_changes(level: str) -> dict[str, Any]:
    """Keys that bring a scene to a level of hydrodynamics; those of lubrication go where there is none."""
    changes: dict[str, Any] = {"hydrodynamics.level": level}
    if not LEVELS[level].lubrication:
        changes |= {"hydrodynamics.lubrication_cutoff": None, "hydrodynamics.cutoff_convention": None}
    return changes


Pair = tuple[Aggregate, Aggregate]


def draw_pairs(scene: Scene, runs: Sequence[Path | str], count: int, seed: int) -> list[Pair]:
    """Pairs of aggregates as they meet: from the late snapshots of runs, in proportion to (R_i + R_j)^3.

    Raises `UserError` for runs of other primaries, or whose populations have no two aggregates.
    """
    radius, rng = scene.suspension.radius, stream(seed, "cost pairs")
    populations: list[list[Aggregate]] = []
    for path in runs:
        run = RunDataset(path)
        if not np.isclose(run.scene.suspension.radius, radius, rtol=1e-6):
            raise UserError(
                f"{path}: its primaries have a radius of {run.scene.suspension.radius:g} m, those of {scene.name} "
                f"{radius:g} m; expected a run of the same suspension"
            )
        populations += [run.aggregates(snapshot) for snapshot in run.late_snapshots[-5:]]
    populations = [population for population in populations if len(population) > 1]
    if not populations:
        raise UserError(
            f"{', '.join(map(str, runs))}: no late snapshot has two aggregates that could meet; take a larger sample volume"
        )
    pairs: list[Pair] = []
    for _ in range(count):
        population = populations[rng.integers(len(populations))]
        radii = np.array([a.outer_radius(radius) for a in population])
        weight = (radii[:, None] + radii[None, :]) ** 3
        np.fill_diagonal(weight, 0.0)
        i, j = divmod(int(rng.choice(weight.size, p=(weight / weight.sum()).ravel())), len(population))
        pairs.append((population[i], population[j]))
    return pairs


def young_population(
    scene: Scene,
    events: int,
    workers: int,
    executor: Executor | None,
    folder: Path,
    progress: Progress = lambda state, share: None,
) -> Path:
    """A short run of the scene with two rotations an encounter, for aggregates to try the settings on."""
    from mcdem.monte_carlo.run_control import run

    path = folder / "young.nc"
    quick = scene.with_changes({"numerics.rotations": min(2.0, scene.numerics.rotations)})
    done = run(
        quick,
        path,
        events=events,
        seed=scene.run.seed,
        workers=workers,
        executor=executor,
        progress=lambda now: progress("aggregates to try on", now.done),
    )
    if done.ended_by == "interruption":
        raise KeyboardInterrupt
    return path


@dataclass(frozen=True)
class Sample:
    """What came of one encounter under one setting."""

    outcome: int
    fragment: float
    """Mass share of the largest product."""
    geometry: float
    """Relative change of the radius of gyration, mass-weighted mean over the products against that over the parents."""
    cpu_time: float
    """[s]"""
    steps: int


def _gyration(aggregates: Iterable[Aggregate], radius: float) -> float:
    """Mass-weighted mean radius of gyration over the radius of primaries, with their own size."""
    total = mass = 0.0
    for a in aggregates:
        squares = float(((a.positions - a.positions.mean(axis=0)) ** 2).sum()) / a.size / radius**2
        total += a.size * np.sqrt(squares + 0.6)
        mass += a.size
    return total / mass


_WARM: set[tuple[Any, ...]] = set()
"""What this process has compiled or loaded: the types of flow and physics, and the scheme."""


def warm_up(scene: Scene, pair: Pair) -> None:
    """Have the code of such a scene compiled before anything is timed in this process."""
    flow, physics = physics_of(scene)
    signature = (*map(type, flow), *map(type, physics), scene.numerics.scheme)
    if signature not in _WARM:
        simulate_encounter(scene, *pair, seed=0)
        if scene.effects.contact is not None:
            warm_up_bodies(scene)
        _WARM.add(signature)


def warm_up_bodies(scene: Scene) -> None:
    """Two tetrahedra meet, or miss each other and turn on as bodies."""
    radius = scene.suspension.radius
    corners = radius / np.sqrt(2.0) * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    bonds = [(i, j) for j in range(4) for i in range(j)]
    tetrahedron = Aggregate.from_positions(scene, corners, bonds)
    turning = scene.with_changes({"numerics.end_stable": False, "numerics.rotations": 0.1})
    for height in (1.0, 5.0):
        simulate_encounter(turning, tetrahedron, tetrahedron, offset=(0.0, height * radius), seed=0)


def follow(scene: Scene, seed: int, number: int, pair: Pair) -> Sample:
    """Follow one encounter of the sample."""
    warm_up(scene, pair)
    result = simulate_encounter(scene, *pair, seed=stream(seed, "cost encounter", number))
    radius = scene.suspension.radius
    sizes = np.array([a.size for a in result.products])
    before, after = _gyration(pair, radius), _gyration(result.products, radius)
    return Sample(
        OUTCOMES.index(result.outcome),
        float(sizes.max() / sizes.sum()),
        after / before - 1.0,
        result.cpu_time,
        result.steps,
    )


def efficiency(scene: Scene, rays: int) -> float:
    """eta_11 from `rays` directions, nan in a scene where nothing sticks."""
    if scene.effects.contact is None:
        return float("nan")
    angles, weights = fejer(rays)
    _, share = Capture(scene).along(angles)
    return float(weights @ share)


def sampled(
    scene: Scene,
    settings: Sequence[Setting],
    pairs: Sequence[Pair],
    seed: int,
    rays: int,
    executor: Executor | None,
    progress: Progress,
) -> Iterator[tuple[Setting, float, list[Sample]]]:
    """Each setting with its eta_11 from `rays` directions and what came of every pair, one after another."""
    pool: Executor = executor or executors.Here()
    wanted = len(pairs) + 1
    for number, setting in enumerate(settings):

        def show(done: int, number: int = number, name: str = setting.name) -> None:
            progress(f"{name}: {done} of {wanted}", (number + done / wanted) / len(settings))

        changed = setting.of(scene)
        # Compiled code and tables are not part of the price.
        capture = executors.submit(pool, efficiency, changed, rays)
        tasks = [
            executors.submit(pool, partial(follow, changed, seed), k, pair) for k, pair in enumerate(pairs)
        ]
        samples = []
        for task in tasks:
            samples.append(executors.result_of(task))
            show(len(samples))
        eta = executors.result_of(capture)
        show(wanted)
        yield setting, eta, samples


def sample_for(
    scene: Scene,
    runs: Sequence[Path | str],
    count: int,
    seed: int = 0,
    *,
    events: int = 4000,
    workers: int = 1,
    executor: Executor | None = None,
    progress: Progress = lambda state, share: None,
) -> list[Pair]:
    """Pairs from the late populations of runs, or from a young population made for the purpose.

    Parameters
    ----------
    scene : Scene
        Whose suspension is sampled.
    runs : sequence of Path or str
        Datasets of `mcdem run`; with none a run of `events` encounters is made first.
    count : int
        Of pairs.
    seed : int
        Of the sample.
    events : int
        Encounters of the run that is made.
    workers : int
        Processes that compute that run.
    executor : concurrent.futures.Executor
        Computes that run instead.
    progress : callable
        Called with where that run stands, and the share of it that is done.

    Returns
    -------
    list of Pair
        Of aggregates, as they would meet: by their encounter rates.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.analysis import sample_for
    >>> scene = mcdem.load_scene("scenes/paper-750Pa.toml")
    >>> pairs = sample_for(scene, ["notebooks/data/run-750Pa-of-100.nc"], count=3, seed=1)
    >>> len(pairs)
    3
    """
    if runs:
        return draw_pairs(scene, runs, count, seed)
    with FILES.scratch() as folder:
        run = young_population(scene, events, workers, executor, folder, progress)
        return draw_pairs(scene, [run], count, seed)
