"""One encounter in a process of its own, so that the one that asked for it can report its progress, and end it.

A step of two large aggregates may take longer than anybody waits for an answer to Ctrl-C.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import wait
from datetime import timedelta
from typing import Any

import numpy as np
from scipy.linalg import cho_factor

from mcdem.aggregates.aggregate import Aggregate
from mcdem.encounter.simulate import EncounterResult, Recorder, simulate_encounter
from mcdem.monte_carlo import executors
from mcdem.scene import Scene

LARGE = 100
"""From so many primaries on an encounter gets a process of its own."""
STEPS = 300
"""Steps of an encounter, as a rule at least."""
LONG = 10.0
"""[s] from which on it is worth saying beforehand how long an encounter is going to take."""

Followed = tuple[EncounterResult, Recorder | None]


def follow(
    scene: Scene, pair: tuple[Aggregate, Aggregate], offset: Any, seed: int, recorder: Recorder | None
) -> Followed:
    """Follow an encounter; returns what came of it, and its course if it was recorded."""
    return simulate_encounter(scene, *pair, offset=offset, seed=seed, record=recorder), recorder


def follow_apart(
    scene: Scene,
    pair: tuple[Aggregate, Aggregate],
    offset: tuple[float, float] | None,
    seed: int,
    recorder: Recorder | None = None,
    progress: Callable[[str], None] = lambda state: None,
) -> Followed:
    """The same, in a process of its own where the aggregates are large.

    Parameters
    ----------
    offset, seed, recorder : as of `simulate_encounter`; the recorder that is returned is the one that is filled
    progress : called with where it stands, a few times a second
    """
    count = pair[0].size + pair[1].size
    if count < LARGE:
        return follow(scene, pair, offset, seed, recorder)
    with executors.opened("process", 1, apart=True) as crew:
        future = executors.submit(crew.executor, follow, scene, pair, offset, seed, recorder)
        while wait([future], timeout=0.2).not_done:
            progress(f"{count} primaries")
        found: Followed = executors.result_of(future)
        return found


def duration_note(count: int) -> str:
    """How long an encounter of so many primaries is going to take, in words; empty where that is short."""
    seconds = STEPS * step_time(count) if count >= LARGE else 0.0
    if seconds <= LONG:
        return ""
    return (
        f"note: {count} primaries: {timedelta(seconds=float(f'{seconds:.1g}'))} is to be expected, or a few times that; an "
        "encounter is kept when it is over"
    )


def step_time(count: int) -> float:
    """[s] that a step of so many primaries takes here at least: a factorisation of its 11 unknowns a primary, as measured."""
    size = 500
    matrix = np.eye(size) + 1e-3
    began = time.perf_counter()
    for _ in range(3):
        cho_factor(matrix)
    return (time.perf_counter() - began) / 3 * (11 * count / size) ** 3
