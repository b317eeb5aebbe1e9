"""What an assumption changes: the same encounters under the scene as given and with other values of its keys.

The same aggregates meet in the same orientations and offsets, so differences are paired and a change shows with few
encounters.  Numerics have `mcdem cost`, which also weighs them; here stands whatever a scene can say: cut-off, materials,
effects, rotations, the scheme.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcdem.analysis.paired_encounters import GIVEN, Pair, Progress, Sample, Setting, sampled
from mcdem.analysis.statistics import mean_limits, share
from mcdem.encounter.simulate import OUTCOMES
from mcdem.monte_carlo.sweep import toml_value
from mcdem.netcdf.whole_files import FILES, SENSITIVITY
from mcdem.scene import Scene

ETA = "eta_11"
"""Efficiency of two primaries, from the boundaries of capture: not sampled."""
STRICT = "breakup, strict"
"""Exchange and fragmentation together."""


@dataclass(frozen=True)
class Difference:
    """One quantity under one setting, and how it differs from the scene as given.

    error : paired standard error of the difference; 0 where nothing was sampled
    low, high : 95 % limits of `value`, which stay apart where no encounter differed; nan where nothing is sampled
    differing : encounters in which the quantity differed
    """

    setting: Setting
    quantity: str
    given: float
    changed: float
    error: float
    encounters: int
    cpu_time: float
    """[s] an encounter under the setting"""
    low: float = float("nan")
    high: float = float("nan")
    differing: int = 0

    @property
    def is_seen(self) -> bool:
        """Whether the limits leave nought out."""
        return self.low > 0.0 or self.high < 0.0

    @property
    def value(self) -> float:
        """Difference of a share or mean; of eta_11 relative to the scene's, nan where nothing sticks."""
        if self.quantity != ETA:
            return self.changed - self.given
        return self.changed / self.given - 1.0 if self.given else float("nan")


def settings_from(given: dict[str, list[str]]) -> list[Setting]:
    """One setting for each value of each key, after the scene as given; every key is changed alone.

    Parameters
    ----------
    given : dict
        {dotted key: values as in a scene file}.

    Returns
    -------
    list of Setting
        The scene as given, and one for each value.

    Examples
    --------
    >>> from mcdem.analysis import settings_from
    >>> found = settings_from({"hydrodynamics.lubrication_cutoff": ["1e-3", "1e-2"]})
    >>> len(found)
    3
    """
    return [
        Setting(GIVEN, "as given"),
        *(
            Setting(f"{key} = {value}", key, {key: toml_value(value)})
            for key, values in given.items()
            for value in values
        ),
    ]


def differences(
    setting: Setting, eta: tuple[float, float], given: Sequence[Sample], changed: Sequence[Sample]
) -> list[Difference]:
    """Every quantity; eta : under the scene as given and under the setting."""
    count, time = len(given), float(np.mean([s.cpu_time for s in changed]))
    found = [Difference(setting, ETA, *eta, 0.0, count, time)]

    def add(name: str, one: NDArray[np.float64], other: NDArray[np.float64]) -> None:
        spread = other - one
        error = float(spread.std(ddof=1)) / np.sqrt(count) if count > 1 else np.inf
        low, high = limits_of(spread, is_share=name not in ("fragment", "geometry"))
        changed = int(np.count_nonzero(spread))
        if setting.name == GIVEN:
            low = high = np.nan
        found.append(
            Difference(
                setting, name, float(one.mean()), float(other.mean()), error, count, time, low, high, changed
            )
        )

    codes = [np.array([s.outcome for s in samples]) for samples in (given, changed)]
    for k, name in enumerate(OUTCOMES):
        add(name, *((code == k).astype(float) for code in codes))
    strict = [OUTCOMES.index(name) for name in ("exchange", "fragmentation")]
    add(STRICT, *(np.isin(code, strict).astype(float) for code in codes))
    for name in ("fragment", "geometry"):
        add(name, *(np.array([getattr(s, name) for s in samples]) for samples in (given, changed)))
    return found


def limits_of(spread: NDArray[np.float64], *, is_share: bool) -> tuple[float, float]:
    """95 % limits of a mean of paired differences (n,).

    Of shares, whose differences are 1, 0 and -1, Wilson's limits of gains and of losses are put together (Newcombe 1998, Zou &
    Donner 2008), so that none of 60 is not nought.  Of other means Student's, and nan where none differs, or one alone: what
    differs so seldom has no mean worth a limit.
    """
    count = len(spread)
    if not is_share:
        if np.count_nonzero(spread) < 2:
            return float("nan"), float("nan")
        mean, half = mean_limits(spread)
        return mean - half, mean + half
    gain, loss = (share(int((sign * spread > 0.0).sum()), count) for sign in (1.0, -1.0))
    value = gain[0] - loss[0]
    low = value - np.hypot(gain[0] - gain[1], loss[2] - loss[0])
    high = value + np.hypot(gain[2] - gain[0], loss[0] - loss[1])
    return float(low), float(high)


def compare_settings(
    scene: Scene,
    settings: Sequence[Setting],
    pairs: Sequence[Pair],
    *,
    seed: int = 0,
    rays: int = 4,
    executor: Executor | None = None,
    progress: Progress = lambda state, share: None,
) -> Iterator[list[Difference]]:
    """Differences under each setting, one after another; the first, the scene as given, has none but is yielded too.

    Parameters
    ----------
    scene : Scene
        As given.
    settings : sequence of Setting
        The scene as given and its changes (`settings_from`).
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
    list of Difference
        Of one setting from the scene as given, each with 95 % limits.
    """
    eta_given, given = float("nan"), list[Sample]()
    for setting, eta, samples in sampled(scene, settings, pairs, seed, rays, executor, progress):
        if not given:
            eta_given, given = eta, samples
        yield differences(setting, (eta_given, eta), given, samples)


def sensitivity_report(found: Sequence[Difference]) -> list[str]:
    """The differences in words, a line each; those that are surely there are marked."""
    count = found[0].encounters
    lines = [f"{count} encounters; [95 % limits of the difference]; * where they leave nought out"]
    for name in dict.fromkeys(d.setting.name for d in found):
        of = [d for d in found if d.setting.name == name]
        lines.append(f"{name}  ({1e3 * of[0].cpu_time:.1f} ms)")
        for d in of:
            if d.given != d.given:
                continue
            line = f"  {d.quantity:16s} {d.given:8.4f} -> {d.changed:8.4f}"
            if d.setting.name == GIVEN:
                line = f"  {d.quantity:16s} {d.given:8.4f}"
            elif d.quantity == ETA:
                line += f"  {d.value:+.4f}"
            elif not d.differing:
                line += f"  none of {count} differs [at most {share(0, count)[2]:.1%} do]"
            elif d.low == d.low:
                line += f"  {d.value:+.4f} [{d.low:+.4f}, {d.high:+.4f}]{' *' * d.is_seen}"
            else:
                line += f"  {d.value:+.4f}, of one encounter"
            lines.append(line)
    return lines


def write_differences(found: Sequence[Difference], path: Path) -> None:
    """The differences as a table of text (CSV), a row each; raises `UserError` where it cannot be written."""
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(
        "setting key quantity as_given changed difference standard_error low high differing encounters cpu_time_s".split()
    )
    for d in found:
        rows.writerow(
            [d.setting.name, d.setting.varied, d.quantity, d.given, d.changed, d.value, d.error,
             d.low, d.high, d.differing, d.encounters, d.cpu_time]
        )  # fmt: skip
    FILES.write(path, SENSITIVITY, text.getvalue())
