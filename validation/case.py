"""What a case is: a claim that can be wrong, how it is measured, and how what was measured is judged.

A file of `validation/cases/` holds one:

    CASE = Case(
        chapter=1,
        claim="Drag of two spheres along their line of centres is the bispherical series.",
        source="Stimson & Jeffery 1926; Brenner 1961",
        tolerance="1e-7: the series is summed to that near contact",
        measure=measure,          # costly; its numbers are kept and reused while nothing they rest on changes
        judge=judge,              # cheap; done afresh every time: checks, verdicts, figure
        seen=("strain_sign",),    # physics broken on purpose (`validation.broken`) that this case must notice
    )

`measure(context)` returns anything JSON can hold, numpy numbers and arrays too.  With `parts(context) -> {label: argument}` it
is called as `measure(context, argument)` for each, side by side on the executor, and `judge` gets {label: numbers}.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Canvas

ROOMS = ("validation.cases", "validation.hard_cases")
"""Packages in which a file with a `CASE` is a case."""

CHAPTERS = {
    1: "Two spheres",
    2: "Several spheres and rigid clusters",
    3: "Efficiency",
    4: "Monte Carlo",
    5: "Breakup",
    6: "The paper, line by line",
    7: "Population balance",
    8: "Accuracy, hard cases and cost",
    9: "Peers",
    10: "Measurements",
}


class Verdict(StrEnum):
    """What a check, and a case, comes to; a case comes to the gravest of its checks, in this order."""

    agrees = "agrees"
    known_gap = "known gap"
    cannot_say = "cannot say"
    differs = "differs"
    not_run = "not run"
    failed = "failed"

    @property
    def gravity(self) -> int:
        return list(Verdict).index(self)


@dataclass(frozen=True)
class Check:
    """One number beside what it should be.

    measured +- error, against the range from `low` to `high`: agrees inside, differs outside, cannot say where the error
    reaches over an edge.  A check without a range is shown for orientation and has no verdict.
    """

    quantity: str
    measured: float = math.nan
    low: float = -math.inf
    high: float = math.inf
    error: float = 0.0
    expected: float | None = None
    """What the range is about, where it is one number."""
    unit: str = ""
    gap: str = ""
    """Why a difference here is known and left; the check then reads "known gap" where it would differ."""
    why: str = ""
    """What a reader should know; for "cannot say", the reason."""
    judged: bool = True

    @property
    def verdict(self) -> Verdict | None:
        if not self.judged:
            return None
        below, above = self.measured - self.error, self.measured + self.error
        if math.isnan(below) or math.isnan(above):
            return Verdict.cannot_say
        if self.low <= below and above <= self.high:
            return Verdict.agrees
        if above < self.low or below > self.high:
            return Verdict.known_gap if self.gap else Verdict.differs
        return Verdict.cannot_say


def near(
    quantity: str,
    measured: float,
    expected: float,
    *,
    rel: float = 0.0,
    abs: float = 0.0,
    **more: Any,
) -> Check:
    """The measured number is the expected one within `abs` plus `rel` times it."""
    width = abs + rel * math.fabs(expected)
    return Check(quantity, float(measured), expected - width, expected + width, expected=expected, **more)


def between(quantity: str, measured: float, low: float, high: float, **more: Any) -> Check:
    """The measured number lies between two."""
    return Check(quantity, float(measured), low, high, **more)


def below(quantity: str, measured: float, high: float, **more: Any) -> Check:
    """The measured number, a size, is at most `high`."""
    return Check(quantity, float(measured), -math.inf, high, **more)


def above(quantity: str, measured: float, low: float, **more: Any) -> Check:
    """The measured number is at least `low`."""
    return Check(quantity, float(measured), low, math.inf, **more)


def shown(quantity: str, measured: float, **more: Any) -> Check:
    """A number for orientation, not judged."""
    return Check(quantity, float(measured), judged=False, **more)


def cannot_say(quantity: str, why: str) -> Check:
    """Nothing could be measured, for this reason."""
    return Check(quantity, why=why)


@dataclass(frozen=True)
class Findings:
    """What came of a case: its checks, and a figure drawn from the numbers."""

    checks: tuple[Check, ...]
    figure: Callable[[], Canvas] | None = None
    caption: str = ""

    @property
    def verdict(self) -> Verdict:
        verdicts = [check.verdict for check in self.checks if check.verdict is not None]
        return max(verdicts, key=lambda v: v.gravity, default=Verdict.cannot_say)


@dataclass(frozen=True)
class Given:
    """What the user gives for cases to read."""

    runs: tuple[Path, ...] = ()
    """Datasets of `mcdem run`, in place of the committed one."""
    pecnut: Path | None = None
    """Checkout of Pecnut/stokesian-dynamics."""


NOTHING_GIVEN = Given()


@dataclass(frozen=True)
class Context:
    """How a case is run."""

    quick: bool = False
    """A few minutes for all cases together, instead of hours: fewer points, shorter runs, the same claims."""
    seed: int = 0
    """Of the case; every random number of it descends from this."""
    given: Given = NOTHING_GIVEN

    def rng(self, *place: int) -> np.random.Generator:
        """A stream of its own for each place."""
        return np.random.default_rng([self.seed, *place])


ALONE = "all"
"""Label of the only part of a case without parts."""


def _one_part(_: Context) -> Mapping[str, Any]:
    return {ALONE: None}


@dataclass(frozen=True)
class Case:
    """A claim, and how it is put to the test (fields: see the module)."""

    chapter: int
    claim: str
    source: str
    tolerance: str
    measure: Callable[..., Any]
    judge: Callable[[Context, Any], Findings]
    parts: Callable[[Context], Mapping[str, Any]] | None = None
    seen: tuple[str, ...] = ()
    seed: int = 0
    inputs: Callable[[Context], tuple[Path, ...]] = lambda context: ()
    """Files that the numbers rest on beside the sources that the case imports; they need not exist."""
    saved: Callable[[Context], tuple[Path, ...]] = lambda context: ()
    """Those among them that were computed before, by a command that takes long: what is judged is read, not measured."""
    anew: str = ""
    """What of them is computed again each time, or in the full mode, and compared."""
    expected: Verdict = Verdict.agrees
    """The verdict as it was last understood; another one ends the command with exit code 1."""
    because: str = ""
    """Why it is expected not to agree."""
    name: str = field(default="", compare=False)

    def labelled(self, context: Context) -> Mapping[str, Any]:
        """{label: argument} of the parts."""
        return (self.parts or _one_part)(context)

    def measured(self, context: Context, label: str) -> Any:
        """The numbers of one part."""
        argument = self.labelled(context)[label]
        return self.measure(context) if self.parts is None else self.measure(context, argument)

    def judged(self, context: Context, numbers: Mapping[str, Any]) -> Findings:
        """The findings from the numbers of all parts."""
        return self.judge(context, numbers[ALONE] if self.parts is None else dict(numbers))

    def context(self, quick: bool, given: Given = NOTHING_GIVEN) -> Context:
        return Context(quick, self.seed, given)


# The cases there are


def names() -> dict[str, str]:
    """{case: module} of all cases, without importing their machinery."""
    found = {}
    for room in ROOMS:
        try:
            package = importlib.import_module(room)
        except ModuleNotFoundError:
            continue
        for module in pkgutil.iter_modules(package.__path__):
            path = Path(package.__path__[0]) / f"{module.name}.py"
            if not module.ispkg and "\nCASE = " in path.read_text(encoding="utf-8"):
                found[module.name] = f"{room}.{module.name}"
    return found


def load(name: str) -> Case:
    """The case of this name; raises `KeyError` if there is none."""
    module = importlib.import_module(names()[name])
    case: Case = module.CASE
    object.__setattr__(case, "name", name)
    return case


def load_all() -> list[Case]:
    """All cases by chapter, then name."""
    return sorted((load(name) for name in names()), key=lambda case: (case.chapter, case.name))
