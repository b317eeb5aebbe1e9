"""What accuracy costs in time: encounters of a scene under each setting of its numerics, against a reference.

The same encounters (aggregates, orientations, offsets) are followed under every setting, so that differences are paired.
Large aggregates exchange contacts for ever and their paths diverge; what must not differ are the statistics of what comes
out of encounters.  Errors are therefore of means:

    eta_11      relative error of the efficiency of two primaries, from the boundaries of capture along a few rays
    outcome     total variation distance of the outcomes: half the sum of |p - p_ref| over the six of them
    fragment    mean mass share of the largest product
    geometry    mean relative change of the radius of gyration from the aggregates that met to what came out

Each has its paired standard error and a 95 % limit that stays above nought where nothing was seen: no encounter of 12 that
differs leaves a share of up to 24 % of them.  Times are compared on the same encounters, each followed under all settings one
after another in an order of its own, in warm processes: what the machine does meanwhile falls on all alike.

Keys of physics (rotations, cut-off, level) are tried as well, for how much rests on them; the cheapest setting that is named is
one of numerics alone.  The reference has all shortcuts off, a fresh far field in each step and a quarter of the
scene's step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcdem.aggregates.aggregate import Aggregate
from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.statistics import mean_limits, share, shares
from mcdem.encounter.capture_efficiency import Capture, fejer
from mcdem.encounter.simulate import OUTCOMES, physics_of, simulate_encounter
from mcdem.errors import UserError
from mcdem.hydrodynamics import LEVELS
from mcdem.integrators import SCHEMES
from mcdem.monte_carlo import executors
from mcdem.netcdf.whole_files import FILES
from mcdem.quantities.random_streams import stream
from mcdem.quantities.toml_tables import choices
from mcdem.scene import Scene

REFERENCE = "reference"
GIVEN = "as given"
QUANTITIES = ("eta_11", "outcome", "fragment", "geometry")


@dataclass(frozen=True)
class Setting:
    """One way to compute: which setting is changed, and to what; `changes` are keys of the scene."""

    name: str
    knob: str
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


def settings_of(scene: Scene, *, quick: bool = False) -> list[Setting]:
    """The reference, the scene as given, and every setting changed alone and all together."""
    if not SCHEMES[scene.numerics.scheme].shortcuts:
        raise UserError(
            f'{scene.name}: [numerics] scheme = "{scene.numerics.scheme}"; mcdem cost weighs the settings of '
            f"{choices(SCHEMES, 'shortcuts')}, and takes its own reference"
        )
    n = scene.numerics
    own, table = n.own, f"numerics.{n.scheme}"
    step_key, step = SCHEMES[n.scheme].step_key, n.step
    exact = {
        f"{table}.far_field_tolerance": 0.0,
        "numerics.far_approach": 0.0,
        "numerics.sure_miss": 0.0,
        "numerics.separation": 0.0,
        "numerics.rigid_rotation": False,
        "numerics.end_stable": False,
    }
    found = [
        Setting(REFERENCE, "reference", {**exact, f"{table}.{step_key}": 0.25 * step}),
        Setting(GIVEN, "as given"),
        Setting("all shortcuts off", "shortcuts", exact),
    ]

    def turn(knob: str, values: Iterable[Any]) -> None:
        of_scheme = hasattr(own, knob)
        now, key = (
            (getattr(own, knob), f"{table}.{knob}") if of_scheme else (getattr(n, knob), f"numerics.{knob}")
        )
        found.extend(Setting(f"{knob} = {value:g}", knob, {key: value}) for value in values if value != now)

    turn(step_key, [step * f for f in ((0.5, 2.0) if quick else (0.25, 0.5, 1.5, 2.0))])
    turn("far_field_tolerance", (0.0, 0.6) if quick else (0.0, 0.1, 0.2, 0.5, 0.8))
    turn("far_approach", (0.0,) if quick else (0.0, 1.2, 1.5, 2.0, 3.0))
    turn("sure_miss", (0.0,) if quick else (0.0, 0.25, 1.0))
    turn("separation", (0.0,) if quick else (0.0, 1.2, 1.5, 2.0, 3.0))
    turn("rotations", (2.0,) if quick else (1.0, 2.0, 4.0, 16.0))
    turn("start_distance", () if quick else (2.5, 5.0, 10.0))
    found.append(Setting("rigid rotation off", "rigid_rotation", {"numerics.rigid_rotation": False}))
    found.append(Setting("stable ends off", "end_stable", {"numerics.end_stable": False}))
    if not quick and scene.hydrodynamics.lubrication:
        delta = scene.hydrodynamics.lubrication_cutoff
        found.extend(
            Setting(f"cut-off = {value:g}", "lubrication_cutoff", {"hydrodynamics.lubrication_cutoff": value})
            for value in (1e-3, 5e-3, 1e-2, 2e-2)
            if value != delta
        )
    if not quick:
        found.extend(
            Setting(f"level = {level}", "level", level_changes(level))
            for level in LEVELS
            if level != scene.hydrodynamics.level
        )
    coarse = {f"{table}.{step_key}": 2.0 * step, f"{table}.far_field_tolerance": 0.6}
    found.append(Setting("coarse", "together", coarse))
    if not quick:
        found.append(Setting("coarse, 2 rotations", "together", {**coarse, "numerics.rotations": 2.0}))
    return found


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
        reach = np.array([a.outer_radius(radius) for a in population])
        weight = (reach[:, None] + reach[None, :]) ** 3
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
    progress: Callable[[float], None] = lambda share: None,
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
        progress=lambda now: progress(now.done),
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


@dataclass(frozen=True, eq=False)
class Price:
    """Error and time of one setting.

    error, deviation : of each of QUANTITIES, and the paired standard error (0 for eta_11, which is not sampled)
    cpu_time : [s] an encounter;  differing : share of encounters with another outcome than under the reference
    limit : 95 % upper limits of the errors;  time_error : half width of the 95 % limits of cpu_time against the scene as given
    [s], nan where times were not compared side by side
    """

    setting: Setting
    error: NDArray[np.float64]
    deviation: NDArray[np.float64]
    cpu_time: float
    steps: float
    differing: float
    limit: NDArray[np.float64] = field(default_factory=lambda: np.full(len(QUANTITIES), np.inf))
    time_error: float = float("nan")

    @property
    def worst_sampled(self) -> float:
        """The largest of the sampled errors."""
        return float(self.error[1:].max())


def price(
    setting: Setting, eta: float, samples: Sequence[Sample], eta_ref: float, ref: Sequence[Sample]
) -> Price:
    """Compare a setting with the reference, encounter by encounter."""
    count = len(samples)
    one_hot = np.eye(len(OUTCOMES))
    outcome = one_hot[[s.outcome for s in samples]] - one_hot[[s.outcome for s in ref]]
    # The spread of a sum of absolute means, as if its largest term carried it.
    spread = outcome.std(axis=0, ddof=1).max() / np.sqrt(count) if count > 1 else np.inf
    changed = [
        (s.outcome, s.fragment, s.geometry) != (r.outcome, r.fragment, r.geometry)
        for s, r in zip(samples, ref, strict=True)
    ]
    # Encounters like none of the sample's may differ as well: so many, by as much as any of them was changed.
    unseen = share(sum(changed), count)[2] - sum(changed) / count
    largest = {"fragment": 1.0, "geometry": max(abs(s.geometry) for s in (*samples, *ref))}
    errors, deviations = (
        [
            abs(eta / eta_ref - 1.0) if eta_ref > 0.0 else float("nan"),
            0.5 * float(np.abs(outcome.mean(axis=0)).sum()),
        ],
        [0.0, spread],
    )
    differing = int(np.sum([s.outcome != r.outcome for s, r in zip(samples, ref, strict=True)]))
    limits = [errors[0], share(differing, count)[2]]
    for name in ("fragment", "geometry"):
        difference = np.array(
            [getattr(s, name) - getattr(r, name) for s, r in zip(samples, ref, strict=True)]
        )
        errors.append(abs(float(difference.mean())))
        limits.append(errors[-1] + max(mean_limits(difference)[1], unseen * largest[name]))
        deviations.append(float(difference.std(ddof=1)) / np.sqrt(count) if count > 1 else np.inf)
    return Price(
        setting,
        np.array(errors),
        np.array(deviations),
        float(np.mean([s.cpu_time for s in samples])),
        float(np.mean([s.steps for s in samples])),
        differing / count,
        np.array(limits),
    )


def measure(
    scene: Scene,
    settings: Sequence[Setting],
    pairs: Sequence[Pair],
    *,
    seed: int = 0,
    rays: int = 4,
    executor: Executor | None = None,
    progress: Callable[[str, int, int], None] = lambda name, done, wanted: None,
) -> Iterator[Price]:
    """Price of each setting, one after another; the first must be the reference.

    progress : called with the setting's name, and how many of its tasks are done of how many
    """
    if settings[0].name != REFERENCE:
        raise ValueError("settings: the first must be the reference")
    eta_ref, ref = float("nan"), list[Sample]()
    for setting, eta, samples in sampled(scene, settings, pairs, seed, rays, executor, progress):
        if setting.name == REFERENCE:
            eta_ref, ref = eta, samples
        yield price(setting, eta, samples, eta_ref, ref)


def sampled(
    scene: Scene,
    settings: Sequence[Setting],
    pairs: Sequence[Pair],
    seed: int,
    rays: int,
    executor: Executor | None,
    progress: Callable[[str, int, int], None],
) -> Iterator[tuple[Setting, float, list[Sample]]]:
    """Each setting with its eta_11 from `rays` directions and what came of every pair, one after another.

    progress : called with the setting's name, and how many of its tasks are done of how many
    """
    pool: Executor = executor or executors.Here()
    wanted = len(pairs) + 1
    for setting in settings:
        changed = setting.of(scene)
        # Compiled code and tables are not part of the price.
        capture = executors.submit(pool, efficiency, changed, rays)
        tasks = [
            executors.submit(pool, partial(follow, changed, seed), number, pair)
            for number, pair in enumerate(pairs)
        ]
        samples = []
        for task in tasks:
            samples.append(executors.result_of(task))
            progress(setting.name, len(samples), wanted)
        eta = executors.result_of(capture)
        progress(setting.name, wanted, wanted)
        yield setting, eta, samples


TIMED, ROUNDS = 12, 3
"""Encounters whose times are compared side by side, and how often each is followed; the shortest of each
counts, since a busy machine only adds."""


def race(scene: Scene, settings: Sequence[Setting], seed: int, number: int, pair: Pair) -> list[float]:
    """Shortest CPU time [s] of one encounter under each setting, all in this process in ROUNDS shuffled orders."""
    scenes = [setting.of(scene) for setting in settings]
    for changed in scenes:
        warm_up(changed, pair)
    best = np.full(len(scenes), np.inf)
    rng = stream(seed, "cost order", number)
    for _ in range(ROUNDS):
        for k in rng.permutation(len(scenes)).tolist():
            result = simulate_encounter(scenes[k], *pair, seed=stream(seed, "cost encounter", number))
            best[k] = min(best[k], result.cpu_time)
    return list(best.tolist())


def timed(
    scene: Scene,
    prices: Sequence[Price],
    pairs: Sequence[Pair],
    seed: int = 0,
    executor: Executor | None = None,
) -> list[Price]:
    """The prices with times of the first TIMED pairs side by side, and their errors against the scene as given."""
    pool: Executor = executor or executors.Here()
    settings = [p.setting for p in prices]
    tasks = [
        pool.submit(partial(race, scene, settings, seed), k, pair) for k, pair in enumerate(pairs[:TIMED])
    ]
    times = np.array([task.result() for task in tasks])
    given = next((k for k, setting in enumerate(settings) if setting.name == GIVEN), 0)
    return [
        replace(p, cpu_time=float(time.mean()), time_error=mean_limits(time - times[:, given])[1])
        for p, time in zip(prices, times.T, strict=True)
    ]


def encounters_to_decide(error: float) -> int:
    """Encounters of which none may differ for the 95 % limit of the share that does to be within `error`."""
    count = 2
    while count < 10**7 and shares(0, count)[2] > error:
        count = count + max(1, count // 100)
    return count


def few_aggregates(pairs: Sequence[Pair]) -> str:
    """A warning where hardly any of the pairs can break or restructure; empty otherwise."""
    large = sum(max(a.size for a in pair) > 3 for pair in pairs)
    if 2 * large >= len(pairs):
        return ""
    return (
        f"only {large} of {len(pairs)} pairs hold an aggregate of more than three primaries: breakup and restructuring are "
        "hardly tried; give a run with a late population by --from"
    )


def front(prices: Sequence[Price], error: Callable[[Price], float]) -> list[Price]:
    """The settings that no other beats in both time and error, cheapest first."""
    found: list[Price] = []
    for p in sorted(prices, key=lambda p: (p.cpu_time, error(p))):
        if not found or error(p) < error(found[-1]):
            found.append(p)
    return found


def cheapest(prices: Sequence[Price], error: float) -> Price | None:
    """The cheapest setting of numerics whose 95 % limits all stay within `error`; None if there is none.

    The scene as given, if it is among them and no other is faster by more than the error of their difference.
    """
    good = [
        p
        for p in prices
        if p.setting.name != REFERENCE
        and not p.setting.of_physics
        and (np.nan_to_num(p.limit, posinf=np.inf) <= error).all()
    ]
    if not good:
        return None
    best = min(good, key=lambda p: p.cpu_time)
    given = next((p for p in good if p.setting.name == GIVEN), None)
    if given is not None and not given.cpu_time - best.cpu_time > best.time_error:
        return given
    return best


def sample_for(
    scene: Scene,
    runs: Sequence[Path],
    count: int,
    seed: int,
    events: int,
    workers: int,
    executor: Executor | None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Pair]:
    """Pairs from the runs given, or from a young population made for the purpose.

    progress : called with the share of that run that is done
    """
    if runs:
        return draw_pairs(scene, runs, count, seed)
    with FILES.scratch() as folder:
        run = young_population(scene, events, workers, executor, folder, progress)
        return draw_pairs(scene, [run], count, seed)
