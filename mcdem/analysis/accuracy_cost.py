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

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcdem.analysis.paired_encounters import (
    GIVEN,
    REFERENCE,
    Pair,
    Progress,
    Sample,
    Setting,
    level_changes,
    sampled,
    warm_up,
)
from mcdem.analysis.statistics import mean_limits, share, shares
from mcdem.encounter.simulate import OUTCOMES, simulate_encounter
from mcdem.errors import UserError
from mcdem.hydrodynamics import LEVELS
from mcdem.integrators import SCHEMES
from mcdem.monte_carlo import executors
from mcdem.netcdf.whole_files import COST, FILES
from mcdem.quantities.random_streams import stream
from mcdem.quantities.toml_tables import choices
from mcdem.scene import Scene

if TYPE_CHECKING:
    from rich.table import Table

QUANTITIES = ("eta_11", "outcome", "fragment", "geometry")


def settings_of(scene: Scene, *, quick: bool = False) -> list[Setting]:
    """The reference, the scene as given, and every setting changed alone and all together.

    Parameters
    ----------
    scene : Scene
        Whose numerics are changed.
    quick : bool
        Fewer of them.

    Returns
    -------
    list of Setting
        The reference first.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.analysis import settings_of
    >>> len(settings_of(mcdem.load_scene("scenes/quickstart.toml"), quick=True)) > 3
    True
    """
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

    def try_each(name: str, values: Iterable[Any]) -> None:
        of, place = (own, table) if hasattr(own, name) else (n, "numerics")
        found.extend(
            Setting(f"{name} = {value:g}", name, {f"{place}.{name}": value})
            for value in values
            if value != getattr(of, name)
        )

    try_each(step_key, [step * f for f in ((0.5, 2.0) if quick else (0.25, 0.5, 1.5, 2.0))])
    try_each("far_field_tolerance", (0.0, 0.6) if quick else (0.0, 0.1, 0.2, 0.5, 0.8))
    try_each("far_approach", (0.0,) if quick else (0.0, 1.2, 1.5, 2.0, 3.0))
    try_each("sure_miss", (0.0,) if quick else (0.0, 0.25, 1.0))
    try_each("separation", (0.0,) if quick else (0.0, 1.2, 1.5, 2.0, 3.0))
    try_each("rotations", (2.0,) if quick else (1.0, 2.0, 4.0, 16.0))
    try_each("start_distance", () if quick else (2.5, 5.0, 10.0))
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
    progress: Progress = lambda state, share: None,
) -> Iterator[Price]:
    """Price of each setting, one after another; the first must be the reference.

    Parameters
    ----------
    scene : Scene
        As given.
    settings : sequence of Setting
        Ways to compute, the reference first.
    pairs : sequence of Pair
        Aggregates that meet (`mcdem.analysis.sample_for`).
    seed : int
        Of orientations and offsets.
    rays : int
        Directions from which eta_11 is found.
    executor : concurrent.futures.Executor
        Computes the encounters.
    progress : callable
        Called with where it stands, in words, and the share done.

    Yields
    ------
    Price
        Processor time of an encounter [s], and errors of outcomes and eta_11 against the reference with 95 % limits [-].
    """
    if settings[0].name != REFERENCE:
        raise ValueError("settings: the first must be the reference")
    eta_ref, ref = float("nan"), list[Sample]()
    for setting, eta, samples in sampled(scene, settings, pairs, seed, rays, executor, progress):
        if setting.name == REFERENCE:
            eta_ref, ref = eta, samples
        yield price(setting, eta, samples, eta_ref, ref)


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

    Parameters
    ----------
    prices : sequence of Price
        Of `measure`.
    error : float
        Wanted error [-].

    Returns
    -------
    Price or None
        Which it is.
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


def price_table(prices: Sequence[Price], count: int) -> Table:
    """The prices as a table; `count` : encounters in the sample."""
    from rich.table import Table

    table = Table(
        "setting",
        "CPU, ms",
        "steps",
        "eta_11",
        "outcome",
        "fragment",
        "geometry",
        "other outcome",
        title=f"error against the reference, {count} encounters (below: 95 % limit); * changes physics, not only numerics",
    )
    for p in prices:
        errors = [
            f"{e:.4f}" + (f" (below {limit:.2g})" if k and p.setting.name != REFERENCE else "")
            for k, (e, limit) in enumerate(zip(p.error, p.limit, strict=True))
        ]
        time = f"{1e3 * p.cpu_time:.1f}"
        if p.time_error > 0.0:
            time += f" +- {1e3 * p.time_error:.1f}"
        low, high = share(round(p.differing * count), count)[1:]
        name = p.setting.name + (" *" if p.setting.of_physics else "")
        table.add_row(name, time, f"{p.steps:.0f}", *errors, f"{p.differing:.1%} ({low:.1%} to {high:.1%})")
    return table


def recommendation(prices: Sequence[Price], pairs: Sequence[Pair], error: float) -> list[str]:
    """In words, which setting is the cheapest within `error`, or what it takes to find one; a warning of a poor sample first."""
    best, count = cheapest(prices, error), len(pairs)
    warning = few_aggregates(pairs)
    lines = [f"Beware: {warning}."] if warning else []
    if best is None:
        lines.append(
            f"No setting is shown to be within {error:g}: of {count} encounters none that differs still leaves a share of "
            f"{share(0, count)[2]:.2g} (95 %). It takes {encounters_to_decide(error)} without a difference, more with some: "
            "raise --encounters, or --error."
        )
    else:
        changes = ", ".join(f"{k} = {v}" for k, v in best.setting.changes.items()) or "the scene as it is"
        lines.append(
            f"Cheapest within {error:g}: {best.setting.name} ({changes}), {1e3 * best.cpu_time:.1f} ms an encounter, "
            f"{prices[0].cpu_time / best.cpu_time:.1f} times less than the reference."
        )
    return lines


def write_prices(prices: Sequence[Price], path: Path) -> None:
    """The prices as a table of text (CSV), a row each; raises `UserError` where it cannot be written."""
    text = io.StringIO()
    rows = csv.writer(text)
    names = [name for q in QUANTITIES for name in (f"error_{q}", f"standard_error_{q}", f"limit_{q}")]
    rows.writerow(["setting", "varied", "cpu_time_s", "time_error_s", "steps", "other_outcome", *names])
    for p in prices:
        values = [v for row in zip(p.error, p.deviation, p.limit, strict=True) for v in row]
        first = [p.setting.name, p.setting.varied, p.cpu_time, p.time_error]
        rows.writerow([*first, p.steps, p.differing, *values])
    FILES.write(path, COST, text.getvalue())


def read_prices(path: Path | str) -> list[dict[str, Any]]:
    """Rows of a table that `write_prices` or `mcdem cost` wrote, numbers as numbers.

    In earlier tables the column `varied` is called `knob`; here it is `varied`.  Raises `UserError` for any other file.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, ValueError) as problem:
        raise UserError(f"{path}: cannot be read: {problem}") from None
    if not text.encode().startswith(COST.begins):
        raise UserError(f"{path}: expected a {COST.words}, with the columns setting, varied, cpu_time_s, ...")
    rows = [
        {"varied" if k == "knob" else k: v for k, v in row.items()}
        for row in csv.DictReader(io.StringIO(text))
    ]
    return [{k: v if k in ("setting", "varied") else float(v) for k, v in row.items()} for row in rows]
