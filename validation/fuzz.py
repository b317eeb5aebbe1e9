"""Random scenes and starts, anywhere in their ranges: `python -m validation.fuzz --encounters 5000 --workers 2`.

Each encounter is a `Trial`, drawn from a seed and its number, and can be written as JSON and repeated:
`python -m validation.fuzz --replay FILE`.  Failures kept in `hard_cases/found/` are cases of the catalogue.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import mcdem
from mcdem.aggregates.aggregate import Aggregate
from mcdem.effects.sums import contact_equilibrium, contact_pull_off_gap
from mcdem.monte_carlo import executors
from mcdem.scene import Scene, load_scene
from pbekit import endings
from validation.hard_cases import laws
from validation.hard_cases import shapes as made
from validation.hard_cases.case import PAPER, Finding, finding

SHAPES = ("monomer", "chain", "walk", "ring", "raft", "ball")
RANGES = {
    "viscosity": (1e-3, 10.0),
    "shear_rate": (1.0, 1e6),
    "cutoff": (1e-5, 0.1),
    "hamaker_constant": (1e-22, 1e-18),
    "surface_energy": (1e-6, 0.1),
    "elastic_modulus": (1e7, 1e12),
    "minimum_approach": (0.1e-9, 1e-9),
}
"""Ends of what is drawn, evenly in the logarithm; SI."""
HANG = 300.0
"""Wall-clock time [s] without any encounter ending after which those under way count as hung."""


@dataclass(frozen=True)
class Body:
    """One aggregate: its kind, primaries and seed (of shape and orientation), and how its contacts are strained.

    stretch : gap of the contacts, -1 twice and 0 once the overlap at rest, 1 pull-off
    """

    kind: str
    size: int
    seed: int
    stretch: float

    def build(self, scene: Scene) -> Aggregate:
        if self.kind == "monomer" or self.size < 2:
            return Aggregate.monomer()
        centres = {
            "chain": lambda: made.chain_centres(self.size),
            "walk": lambda: made.walk_centres(self.size, self.seed),
            "ring": lambda: made.ring_centres(max(self.size, 4)),
            "raft": lambda: made.raft_centres(2)[: self.size],
            "ball": lambda: made.ball_centres(self.size),
        }[self.kind]()
        settled = made.settled(scene, centres, self.seed)
        contact = scene.kernels.contact
        (rest, _), end = contact_equilibrium(1.0, contact), contact_pull_off_gap(1.0, contact)
        gap = rest + self.stretch * (end - rest if self.stretch > 0.0 else -rest)
        return Aggregate(settled.positions * (2.0 + gap) / (2.0 + rest), settled.bonds)


@dataclass(frozen=True)
class Trial:
    """An encounter that can be repeated.  SI units; the offset in R_i + R_j."""

    viscosity: float
    shear_rate: float
    cutoff: float
    cutoff_convention: str
    hamaker_constant: float
    minimum_approach: float
    surface_energy: float
    elastic_modulus: float
    scheme: str
    first: Body
    second: Body
    offset: tuple[float, float]
    start_distance: float
    rotations: float
    most_steps: int = 5_000

    @classmethod
    def from_json(cls, text: str) -> Trial:
        values: dict[str, Any] = json.loads(text)
        known = {f.name for f in fields(cls)}
        bodies = {name: Body(**values[name]) for name in ("first", "second")}
        given = {name: value for name, value in values.items() if name in known}
        return cls(**{**given, **bodies, "offset": tuple(values["offset"])})

    def to_json(self, **more: Any) -> str:
        return json.dumps({**asdict(self), **more}, indent=1)

    @property
    def changes(self) -> dict[str, Any]:
        """Of the paper's scene."""
        return {
            "flow.viscosity": f"{self.viscosity!r} Pa s",
            "flow.shear_rate": f"{self.shear_rate!r} 1/s",
            "effects.van_der_waals.hamaker_constant": f"{self.hamaker_constant!r} J",
            "effects.van_der_waals.minimum_approach": f"{self.minimum_approach!r} m",
            "effects.jkr.surface_energy": f"{self.surface_energy!r} J/m^2",
            "effects.jkr.elastic_modulus": f"{self.elastic_modulus!r} Pa",
            "hydrodynamics.lubrication_cutoff": self.cutoff,
            "hydrodynamics.cutoff_convention": self.cutoff_convention,
            "numerics.scheme": self.scheme,
            "numerics.start_distance": self.start_distance,
            "numerics.rotations": self.rotations,
            "numerics.longest_approach": 200.0,
            "numerics.most_steps": self.most_steps,
        }


def draw(rng: np.random.Generator) -> Trial:
    """A trial from anywhere in the ranges."""
    values: dict[str, Any] = {
        name: float(math.exp(rng.uniform(math.log(low), math.log(high))))
        for name, (low, high) in RANGES.items()
    }
    # The ends that are apart from the rest: no cut-off, no attraction to speak of.
    if rng.random() < 0.1:
        values["cutoff"] = 0.0
    if rng.random() < 0.1:
        values["hamaker_constant"] = 1e-60
    # Explicit steps are short: two primaries only, and not for long.
    explicit = rng.random() < 0.03
    y = float(math.exp(rng.uniform(math.log(1e-9), 0.0)) if rng.random() < 0.1 else math.sqrt(rng.random()))
    x = float(rng.uniform(-1.0, 1.0) * math.sqrt(1.0 - y * y))

    def body() -> Body:
        kind = "monomer" if explicit else SHAPES[rng.integers(len(SHAPES))]
        stretch = float(rng.uniform(-1.0, 0.999))
        return Body(kind, 1 if explicit else int(rng.integers(2, 9)), int(rng.integers(2**31)), stretch)

    return Trial(
        **values,
        cutoff_convention=("matrix", "gap")[rng.integers(2)],
        scheme="explicit_euler" if explicit else "implicit",
        first=body(),
        second=body(),
        offset=(x, y if rng.random() < 0.9 else -y),
        start_distance=float(rng.uniform(1.0, 5.0)),
        rotations=0.1 if explicit else 0.5,
    )


@dataclass(frozen=True)
class Attempt:
    """What came of a trial.  failures : laws that were broken, with words; empty if all hold"""

    outcome: str
    reason: str
    steps: int
    seconds: float
    failures: tuple[str, ...] = ()


NAMED = ("the approach is longer than numerics.longest_approach", "more steps than numerics.most_steps")
"""Reasons of an unresolved encounter that are the user's own limits."""


class _Encounter:
    """What the laws of results look at."""

    def __init__(self, trial: Trial) -> None:
        self.scene = load_scene(PAPER).with_changes(trial.changes)
        self.first, self.second = trial.first.build(self.scene), trial.second.build(self.scene)
        self.outcomes: tuple[str, ...] = ()
        reach = sum(a.outer_radius(self.scene.suspension.radius) for a in (self.first, self.second))
        x, y = trial.offset
        self.result = mcdem.simulate_encounter(
            self.scene, self.first, self.second, (x * reach, y * reach), orient=False
        )


def excused(trial: Trial, scene: Scene) -> bool:
    """Whether the scene's numerics are known not to bear it; what is left undone is then reported by name.

    Explicit steps have a limit of stability; and below the cut-off the convention "matrix" lets the strain squeeze a pair by
    cutoff - h against a resistance that grows as 1/cutoff, without bound once contacts overlap by more than the cut-off.
    """
    overlap = -contact_equilibrium(1.0, scene.kernels.contact)[0]
    return trial.scheme == "explicit_euler" or (
        trial.cutoff_convention == "matrix" and trial.cutoff < overlap
    )


def attempt(trial: Trial) -> Attempt:
    """Follow a trial and hold it against the laws of results; whatever is raised is a failure too."""
    began = time.process_time()
    try:
        followed = _Encounter(trial)
        result = followed.result
        broken = [
            f"{name}: {words}"
            for name, law in laws.OF_RESULTS.items()
            for margin, words in [law(followed)]
            if not margin >= 0.0
        ]
        # An explicit step past its limit is the scheme's own, and named; an implicit one has no such excuse.
        if result.reason and result.reason not in NAMED and not excused(trial, followed.scene):
            broken.append(f"unresolved: {result.reason}")
        outcome, reason, steps = result.outcome, result.reason, result.steps
    except Exception as problem:  # a crash is what is looked for
        outcome, reason, steps = "crash", "", 0
        broken = [f"crash: {type(problem).__name__}: {problem}"]
    return Attempt(outcome, reason, steps, time.process_time() - began, tuple(broken))


def numbered(seed: int, number: int) -> Trial:
    """The trial of this number."""
    return draw(np.random.default_rng([seed, number]))


@dataclass(frozen=True)
class Found:
    """A failure of fuzzing that was mended and must stay so, or is known: the user's own limits are no excuse here."""

    path: Path
    quick: bool = True

    @property
    def name(self) -> str:
        return self.path.stem.replace("-", " ")

    @property
    def story(self) -> str:
        return str(json.loads(self.path.read_text())["story"])

    @property
    def expected(self) -> dict[str, str]:
        """Law -> why it is known to fail, where it is not mended yet."""
        reason = json.loads(self.path.read_text()).get("expected")
        return {"all laws of results": reason} if reason else {}

    def judge(self) -> Iterator[Finding]:
        found = attempt(Trial.from_json(self.path.read_text()))
        sound = not found.failures and found.outcome != "unresolved"
        words = "; ".join(found.failures) or " ".join([found.outcome, found.reason]).strip()
        law = "all laws of results"
        yield finding(self, law, found.steps, 1.0 if sound else -1.0, words, self.expected.get(law, ""))


FOUND = tuple(Found(path) for path in sorted((Path(__file__).parent / "hard_cases" / "found").glob("*.json")))


def fuzz(seed: int, encounters: int, workers: int) -> Iterator[tuple[int, Trial, Attempt]]:
    """Trials as they end.  Those under way when a worker dies or nothing ends for `HANG` are reported as failures."""
    with executors.opened("process", workers, apart=True) as (pool, _):
        waiting: dict[Future[Attempt], int] = {}
        numbers = iter(range(encounters))
        while True:
            while len(waiting) < 2 * workers and (number := next(numbers, None)) is not None:
                waiting[pool.submit(attempt, numbered(seed, number))] = number
            if not waiting:
                return
            done, _ = wait(waiting, HANG, FIRST_COMPLETED)
            if not done:
                for number in waiting.values():
                    found = Attempt("hang", "", 0, HANG, (f"nothing ended within {HANG:.0f} s",))
                    yield number, numbered(seed, number), found
                for process in getattr(pool, "_processes", {}).values():
                    process.kill()
                return
            for future in done:
                number = waiting.pop(future)
                try:
                    found = future.result()
                except BrokenExecutor as problem:
                    found = Attempt("crash", "", 0, 0.0, (f"crash: a worker died ({problem})",))
                    yield number, numbered(seed, number), found
                    return
                yield number, numbered(seed, number), found


def keep(folder: Path, name: str, trial: Trial, found: Attempt) -> Path:
    """Write a failure so that it can be repeated."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.json"
    path.write_text(trial.to_json(failures=found.failures))
    return path


def main(
    encounters: Annotated[int, typer.Option(help="How many.")] = 5000,
    workers: Annotated[int, typer.Option(help="Processes.")] = 2,
    seed: Annotated[int, typer.Option(help="Of all that is drawn.")] = 1,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for failures.")] = Path("fuzz-failures"),
    replay: Annotated[Path | None, typer.Option(help="A failure to repeat instead.")] = None,
) -> None:
    """Follow random encounters and hold each against the laws; exit code 1 if one is broken."""
    if replay is not None:
        trial = Trial.from_json(replay.read_text())
        found = attempt(trial)
        print(f"{found.outcome} {found.reason} after {found.steps} steps, {found.seconds:.2f} s")
        print(*found.failures, sep="\n")
        raise typer.Exit(1 if found.failures else 0)
    outcomes: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    failed, seconds, longest, steps, done = 0, 0.0, 0.0, 0, 0
    began = shown = time.monotonic()
    for number, trial, found in fuzz(seed, encounters, workers):
        done += 1
        outcomes[found.outcome] += 1
        if found.reason:
            reasons[f"{found.reason} ({trial.scheme})"] += 1
        seconds, steps = seconds + found.seconds, steps + found.steps
        longest = max(longest, found.seconds)
        if found.failures:
            failed += 1
            path = keep(out, f"seed-{seed}-number-{number}", trial, found)
            print(f"{path}: {'; '.join(found.failures)}", flush=True)
        if time.monotonic() - shown > 30.0:
            shown = time.monotonic()
            left = (shown - began) * (encounters - done) / done
            print(f"{done} of {encounters}, {failed} failed, {left:.0f} s left", file=sys.stderr, flush=True)
    print(f"{done} encounters with seed {seed}, {steps} steps, {seconds:.0f} s of processor:")
    print("  " + ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common()))
    for reason, count in reasons.most_common():
        print(f"  unresolved: {count} x {reason}")
    print(f"  the longest took {longest:.1f} s; {failed} broke a law")
    if failed or done < encounters:
        raise typer.Exit(1)


if __name__ == "__main__":
    endings.program(lambda: typer.run(main))
