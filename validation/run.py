"""Run cases side by side on an executor, reuse what is unchanged, judge what came of it."""

from __future__ import annotations

import contextlib
import json
import time
import traceback
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mcdem.monte_carlo import executors
from pbekit import endings
from validation import broken, origin
from validation.case import NOTHING_GIVEN, Case, Context, Findings, Given, Verdict, load


@dataclass(frozen=True)
class Part:
    """One piece of a case's measuring."""

    case: Case
    context: Context
    label: str
    key: str
    way: str | None
    """How physics is broken, if it is."""

    @property
    def name(self) -> str:
        return self.case.name

    def kept(self, folder: Path) -> Path:
        """Where its numbers are kept."""
        return folder / self.name / f"{self.key}.json"


@dataclass
class Outcome:
    """What came of a case."""

    case: Case
    context: Context
    findings: Findings
    cpu: float = 0.0
    """Processor time that the numbers took when they were measured [s]."""
    reused: int = 0
    parts: int = 0
    problem: str = ""
    """Traceback, if it failed."""
    needs: str = ""
    """The library without which it was not run."""
    notes: list[str] = field(default_factory=list)

    @property
    def verdict(self) -> Verdict:
        if self.problem:
            return Verdict.failed
        return Verdict.not_run if self.needs else self.findings.verdict

    @property
    def as_expected(self) -> bool:
        """Of what the user gave, nothing is expected but an answer; and nothing of what could not be run."""
        if self.needs:
            return True
        if self.read:
            return self.verdict != Verdict.failed
        return self.verdict == self.case.expected

    @property
    def read(self) -> list[Path]:
        """Files given by the user that the numbers rest on."""
        asked = self.case.inputs(self.context)
        return [path for path in given_paths(self.context.given) if path in asked]

    @property
    def command(self) -> str:
        mode = " --quick" if self.context.quick else ""
        runs = "".join(f" --run {path}" for path in self.read if path in self.context.given.runs)
        peer = " --pecnut CHECKOUT" if self.context.given.pecnut in self.read else ""
        return f"python -m validation {self.case.name}{mode}{runs}{peer} -o report/"


def given_paths(given: Given) -> list[Path]:
    """All paths that the user gave."""
    return [*given.runs, *([given.pecnut] if given.pecnut else [])]


def perform(
    name: str, quick: bool, label: str, way: str | None, given: Given = NOTHING_GIVEN
) -> dict[str, Any]:
    """Measure one part, in whatever process; what goes wrong is returned, not raised."""
    import threadpoolctl

    cpu, wall = time.process_time(), time.perf_counter()
    result: dict[str, Any] = {}
    with threadpoolctl.threadpool_limits(limits=1):
        try:
            case = load(name)
            with broken.broken(way):
                result["numbers"] = case.measured(case.context(quick, given), label)
            result = json.loads(json.dumps(result, default=_plain))
        except ModuleNotFoundError as problem:
            if (problem.name or "").partition(".")[0] in origin.PACKAGES:
                result = {"problem": traceback.format_exc()}
            else:
                result = {"needs": problem.name or str(problem)}
        except Exception:
            result = {"problem": traceback.format_exc()}
    return result | {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(
        f"a case measured {type(value).__name__}: expected numbers, texts, lists and dictionaries"
    )


def parts_of(case: Case, quick: bool, way: str | None = None, given: Given = NOTHING_GIVEN) -> list[Part]:
    """The parts of a case, each with the key of its numbers."""
    context = case.context(quick, given)
    return [
        Part(case, context, label, origin.key(case, context, label, argument, way), way)
        for label, argument in case.labelled(context).items()
    ]


def run(
    cases: Iterable[Case],
    folder: Path,
    executor: Executor,
    *,
    quick: bool = False,
    way: str | None = None,
    given: Given = NOTHING_GIVEN,
    fresh: bool = False,
    progress: Callable[[str, Any], None] = lambda event, what: None,
) -> list[Outcome]:
    """Outcomes of the cases, in their order.

    folder : where numbers are kept from run to run, each part's as soon as it is there
    way : how to break physics (`validation.broken`)
    given : files for the cases that read any
    fresh : measure again what is kept
    progress : called with ("part", part) when one is measured, ("case", outcome) when one is judged
    """
    parts = {case.name: parts_of(case, quick, way, given) for case in cases}
    results: dict[str, dict[str, dict[str, Any]]] = {name: {} for name in parts}
    reused = dict.fromkeys(parts, 0)
    waiting: dict[Future[dict[str, Any]], Part] = {}
    outcomes: dict[str, Outcome] = {}

    def settle(part: Part, result: dict[str, Any]) -> None:
        results[part.name][part.label] = result
        progress("part", part)
        if len(results[part.name]) == len(parts[part.name]):
            outcomes[part.name] = _judge(parts[part.name], results[part.name], reused[part.name])
            progress("case", outcomes[part.name])

    to_measure = []
    for part in (p for several in parts.values() for p in several):
        known = None if fresh else _read(part.kept(folder))
        if known is None:
            to_measure.append(part)
        else:
            reused[part.name] += 1
            settle(part, known)
    try:
        for part in to_measure:
            future = executors.submit(executor, perform, part.name, quick, part.label, way, given)
            waiting[future] = part
            if future.done():  # computed here, at once
                _finish(future, waiting.pop(future), folder, settle)
        for future in as_completed(list(waiting)):
            _finish(future, waiting.pop(future), folder, settle)
    except BaseException:
        for future in waiting:
            future.cancel()
        raise
    return [outcomes[name] for name in parts]


def _finish(
    future: Future[dict[str, Any]], part: Part, folder: Path, settle: Callable[[Part, dict], None]
) -> None:
    try:
        result = executors.result_of(future)
    except (
        executors.ExecutorError
    ) as problem:  # a case that takes its worker down, or whoever stopped them all
        if endings.asked(within=0.5):
            raise KeyboardInterrupt from None
        raise executors.ExecutorError(
            f"{part.name} {part.label}: {problem}; {folder} holds what was measured: the same command goes on from there"
        ) from problem
    if "numbers" in result:
        _write(part.kept(folder), result | {"label": part.label, "software": origin.on_this_machine()})
    settle(part, result)


def _read(path: Path) -> dict[str, Any] | None:
    with contextlib.suppress(OSError, ValueError):
        result = json.loads(path.read_text(encoding="utf-8"))
        if "numbers" in result:
            return result
    return None


def _write(path: Path, result: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(result), encoding="utf-8")
    unfinished.replace(path)


def _judge(parts: list[Part], results: dict[str, dict[str, Any]], reused: int) -> Outcome:
    case, context = parts[0].case, parts[0].context
    outcome = Outcome(case, context, Findings(()), reused=reused, parts=len(parts))
    outcome.cpu = sum(result["cpu"] for result in results.values())
    problems = [result["problem"] for result in results.values() if "problem" in result]
    outcome.needs = next((result["needs"] for result in results.values() if "needs" in result), "")
    if not problems and not outcome.needs:
        try:
            # In the order of the parts, whichever came first.
            numbers = {part.label: results[part.label]["numbers"] for part in parts}
            outcome.findings = case.judged(context, numbers)
        except Exception:
            problems = [traceback.format_exc()]
    outcome.problem = problems[0] if problems else ""
    return outcome
