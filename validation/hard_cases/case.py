"""What a hard case is, and what is reported of it."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np

import mcdem
from mcdem.errors import UserError
from mcdem.scene import load_scene
from validation.hard_cases import laws
from validation.hard_cases.watch import Start, Watched, side_by_side, watch

if TYPE_CHECKING:
    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.encounter.simulate import EncounterResult
    from mcdem.scene import Scene
    from validation.hard_cases.edges import Edge
    from validation.hard_cases.shapes import Shape

PAPER = Path(__file__).parents[2] / "scenes" / "paper-1000Pa.toml"
"""The scene that the cases change."""

Scheme = Literal["implicit", "explicit_euler"]

WITHOUT_SHORTCUTS: Mapping[str, Any] = {
    "numerics.far_approach": 0.0,
    "numerics.sure_miss": 0.0,
    "numerics.separation": 0.0,
    "numerics.rigid_rotation": False,
    "numerics.end_stable": False,
    "numerics.implicit.far_field_tolerance": 0.0,
}


class Finding(NamedTuple):
    """A law checked on a case."""

    case: str
    law: str
    verdict: str
    """"holds", "broken", or "expected failure"."""
    steps: int
    """Time steps behind the verdict."""
    margin: float
    """What is left of the law's allowance: 1 untouched, 0 used up, negative where it is broken."""
    words: str


class Case(Protocol):
    """Anything with a name and a story that can be judged."""

    @property
    def name(self) -> str: ...

    @property
    def story(self) -> str:
        """What a user does to meet it."""

    @property
    def quick(self) -> bool:
        """Whether it is judged within seconds."""

    def judge(self) -> Iterator[Finding]: ...


def finding(case: Case, law: str, steps: int, margin: float, words: str, expected: str = "") -> Finding:
    """The verdict that a margin makes; `expected` is the reason of a failure that is known."""
    if margin >= 0.0:  # not a number is broken
        return Finding(case.name, law, "holds", steps, margin, words)
    if expected:
        return Finding(case.name, law, "expected failure", steps, margin, f"{words}; {expected}")
    return Finding(case.name, law, "broken", steps, margin, words)


@dataclass(frozen=True)
class Encounter:
    """Two aggregates that meet.

    changes : of the paper's scene at 1000 Pa, by dotted keys
    offset : (x0, y0) in R_i + R_j;  orient : seed of random orientations, None for those of the shapes
    strain : g t that is watched step by step, from a distance of 1.2 (R_i + R_j) on
    chaotic : trajectories part from each other whatever the step, so only statistics are compared under refinement
    schemes : time integration schemes, watched;  expected : law -> why it is known to fail
    """

    name: str
    story: str
    first: Shape
    second: Shape
    offset: tuple[float, float] = (0.1, 0.4)
    changes: Mapping[str, Any] = field(default_factory=dict)
    strain: float = 6.0
    chaotic: bool = False
    schemes: tuple[Scheme, ...] = ("implicit",)
    quick: bool = True
    outcomes: tuple[str, ...] = ()
    """Outcomes of which it must be one; any if empty."""
    expected: Mapping[str, str] = field(default_factory=dict)

    def scene(self, scheme: Scheme = "implicit") -> Scene:
        return load_scene(PAPER).with_changes({**self.changes, "numerics.scheme": scheme})

    def judge(self) -> Iterator[Finding]:
        whole = Whole(self)
        for name, law in laws.OF_RESULTS.items():
            margin, words = law(whole)
            yield finding(self, name, whole.result.steps, margin, words, self.expected.get(name, ""))
        for scheme in self.schemes:
            course = Course(self, scheme)
            suffix = "" if scheme == "implicit" else f" ({scheme})"
            for name, course_law in laws.OF_COURSES.items():
                if name in laws.OF_REGULAR_MOTION and (self.chaotic or scheme == "explicit_euler"):
                    continue  # trajectories say nothing there, or the law is of the other scheme's step
                margin, words = course_law(course)
                full_name = name + suffix
                yield finding(
                    self, full_name, course.seen.steps, margin, words, self.expected.get(full_name, "")
                )


class Whole:
    """An encounter by the default engine, from its start to its end."""

    def __init__(self, case: Encounter) -> None:
        self.case, self.scene, self.outcomes = case, case.scene(), case.outcomes
        self.first, self.second = case.first(self.scene), case.second(self.scene)

    @cached_property
    def result(self) -> EncounterResult:
        radius = self.scene.suspension.radius
        reach = self.first.outer_radius(radius) + self.second.outer_radius(radius)
        x, y = self.case.offset
        return mcdem.simulate_encounter(
            self.scene, self.first, self.second, (x * reach, y * reach), orient=False
        )


class Course:
    """The near part of an encounter by one scheme, every step seen, and its images."""

    def __init__(self, case: Encounter, scheme: Scheme) -> None:
        self.case, self.scene = case, case.scene(scheme)
        self.radius = self.scene.suspension.radius
        first, second = case.first(self.scene), case.second(self.scene)
        reach = first.outer_radius(self.radius) + second.outer_radius(self.radius)
        x, y = case.offset
        self.start = side_by_side(first, second, (x * reach, y * reach, -1.2 * reach))

    @cached_property
    def seen(self) -> Watched:
        return watch(self.scene, self.start, self.case.strain)

    @cached_property
    def compared(self) -> Watched:
        """What images are compared with: all that is seen, but little where rounding grows without bound."""
        if not self.case.chaotic and self.scene.numerics.scheme == "implicit":
            return self.seen
        return watch(self.scene, self.start, min(self.case.strain, 0.3))

    def image(self, start: Start) -> Watched:
        """As much as is compared, from another start."""
        return watch(self.scene, start, self.compared.strain)

    def refined(self, factor: float) -> Watched:
        """The same by shorter steps, with the far field renewed as much sooner."""
        keys = self.scene.numerics.of("implicit")
        tighter = {
            "numerics.implicit.max_step": factor * keys.max_step,
            "numerics.implicit.far_field_tolerance": factor * keys.far_field_tolerance,
        }
        return watch(self.scene.with_changes(tighter), self.start, self.case.strain)


@dataclass(frozen=True)
class Shortcut:
    """An edge at which a shortcut could lie, with it, without it, and by exact theory where there is one.

    key : of [numerics], or several with the same purpose;  changes : of the paper's scene at 1000 Pa
    edge : the number that the shortcut must not move;  moved : by how much it may, in parts of it, or outright if `outright`
    exact : the same by theory;  off_by : by how much the edge with the shortcut may differ from it
    """

    name: str
    story: str
    keys: tuple[str, ...]
    edge: Edge
    moved: float
    changes: Mapping[str, Any] = field(default_factory=dict)
    outright: bool = False
    exact: Edge | None = None
    off_by: float = 0.0
    quick: bool = True

    def judge(self) -> Iterator[Finding]:
        scene = load_scene(PAPER).with_changes({**WITHOUT_SHORTCUTS, **self.changes})
        defaults = type(scene.numerics)()
        taken = scene.with_changes({f"numerics.{key}": attrgetter(key)(defaults) for key in self.keys})
        short = self.edge(taken)
        pairs = [("as without the shortcut", self.edge(scene), self.moved)]
        if self.exact is not None:
            pairs.append(("as by exact theory", self.exact(taken), self.off_by))
        for law, other, allowed in pairs:
            size = 1.0 if self.outright else abs(other)
            margin, words = laws.below(
                abs(short - other),
                allowed * size,
                f"{short:.5g} for {other:.5g}, within {allowed * size:.2g}",
            )
            yield finding(self, law, 0, margin, words)


@dataclass(frozen=True)
class Refused:
    """Something that is not begun: the user reads why, in one line that says what to do."""

    name: str
    story: str
    attempt: Callable[[Scene], Any]
    says: str
    """Words that the answer must hold."""
    quick: bool = True

    def judge(self) -> Iterator[Finding]:
        try:
            self.attempt(load_scene(PAPER))
        except UserError as problem:
            message = str(problem).replace(f"{PAPER.parent}/", "")
            margin = 1.0 if self.says in message and "\n" not in message else -1.0
        else:
            message, margin = "nothing was refused", -1.0
        yield finding(self, "refused at the door", 0, margin, message)


@dataclass(frozen=True)
class Suspension:
    """A whole run of the Monte Carlo."""

    name: str
    story: str
    changes: Mapping[str, Any]
    events: int
    ended_by: tuple[str, ...]
    quick: bool = True
    sticks: bool | None = None
    """Whether aggregates must form (True), must not (False), or may."""
    unresolved: bool = False
    """Whether some encounters must be left unresolved, and be counted."""

    def judge(self) -> Iterator[Finding]:
        from mcdem.monte_carlo import run_control

        scene = load_scene(PAPER).with_changes({"run.until": None, **self.changes})
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "run.nc"
            began = time.process_time()
            summary = run_control.run(scene, path, events=self.events, seed=1)
            seconds = time.process_time() - began
            margins = laws.of_a_run(path, summary, self)
        steps = int(margins.pop("steps")[0])
        margins["ends in time"] = laws.in_time(seconds)
        for law, (margin, words) in margins.items():
            yield finding(self, law, steps, margin, words)


@dataclass(frozen=True)
class Ensemble:
    """Many encounters whose trajectories part from each other, while their statistics must not."""

    name: str
    story: str
    shapes: tuple[Shape, ...]
    encounters: int
    changes: Mapping[str, Any] = field(default_factory=dict)
    finer: float = 0.5
    """Step of the second ensemble over that of the first."""
    quick: bool = False

    def judge(self) -> Iterator[Finding]:
        scene = load_scene(PAPER).with_changes(self.changes)
        step = scene.numerics.step
        pair = [
            self.results(scene.with_changes({"numerics.implicit.max_step": factor * step}))
            for factor in (1.0, self.finer)
        ]
        steps = sum(result.steps for results in pair for result in results)
        for law, judge in laws.OF_ENSEMBLES.items():
            margin, words = judge(*pair)
            yield finding(self, law, steps, margin, words)

    def results(self, scene: Scene) -> list[EncounterResult]:
        """The encounters, from the same starts for every scene of these sizes."""
        rng = np.random.default_rng(1)
        made: list[Aggregate] = [shape(scene) for shape in self.shapes]
        found = []
        for _ in range(self.encounters):
            first, second = (made[rng.integers(len(made))].turned(rng) for _ in range(2))
            reach = sum(a.outer_radius(scene.suspension.radius) for a in (first, second))
            # Within half the circle, so that most of them meet.
            y = 0.5 * reach * math.sqrt(rng.uniform(0.01, 1.0))
            x = 0.5 * reach * rng.uniform(-1.0, 1.0)
            found.append(mcdem.simulate_encounter(scene, first, second, (x, y), orient=False))
        return found


def worst(findings: Sequence[Finding]) -> Finding:
    """The finding with the least left."""
    return min(findings, key=lambda f: f.margin if f.margin == f.margin else -math.inf)
