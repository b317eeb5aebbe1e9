"""Functions that are compiled apart: what they return, what passes through them, and how often they are compiled."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mcdem.compiled_once import CompilationWatch

MODULE = """
from typing import NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled


class Inner(NamedTuple):
    values: np.ndarray
    factor: int


class Outer(NamedTuple):
    count: np.ndarray
    absent: None
    inner: Inner
    grows: bool
    shares: tuple


@compiled
def share_of(outer):
    return outer.shares[0] if outer.grows else 0.0


@separately_compiled()
def add_factor(inner):
    inner.values[:] += inner.factor


@separately_compiled(types.Tuple((types.int64, types.float64)))
def step(x, outer, twice):
    outer.count[0] += 1
    if x.shape[0] > 4:
        raise ValueError("too long")
    if outer.absent is None:
        add_factor(outer.inner)
        add_factor(Inner(outer.count, 3))
    for i in range(outer.inner.values.shape[0]):
        outer.inner.values[i] += share_of(outer)
    return x.shape[0], outer.count[0] + (1.0 if twice else 0.0) + outer.inner.values.sum()


@compiled
def two_steps(x, outer):
    n, first = step(x, outer, False)
    m, second = step(x, outer, True)
    return n + m, first + second
"""

RUN = """
import json, sys
from numba.core import event

compiled = []


class Listener(event.Listener):
    def on_start(self, found):
        if found.data["dispatcher"].py_func.__module__ in ("small", "mcdem.compilation"):
            compiled.append(found.data["dispatcher"].py_func.__qualname__)

    def on_end(self, found):
        pass


event.register("numba:compile", Listener())
import numpy as np
import small


def outer():
    return small.Outer(np.zeros(2), None, small.Inner(np.ones(3), 2), True, (0.5,))


found = small.two_steps(np.zeros(3), outer())
direct = small.step(np.zeros(3), outer(), True)
try:
    small.two_steps(np.zeros(5), outer())
    refused = ""
except ValueError as error:
    refused = str(error)
print(json.dumps([found, direct, refused, compiled]))
"""

FUNCTIONS = {"share_of", "add_factor", "step", "two_steps", "two_steps_from_python", "step_from_python"}


@pytest.fixture
def start(tmp_path):
    """Starts a process that calls the functions of MODULE, on a cache of its own."""
    (tmp_path / "small.py").write_text(MODULE)
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])]),
    }

    def begin(text=RUN):
        return subprocess.Popen(
            [sys.executable, "-c", text], env=environment, stdout=subprocess.PIPE, text=True
        )

    return begin


def answer(process):
    found = json.loads(process.communicate(timeout=300)[0])
    assert process.returncode == 0
    return found


def test_processes_that_start_together_compile_each_function_once(start):
    """And get the same, from a function of both kinds, from Python and from compiled code; errors pass through."""
    first, second = start(), start()
    answers = answer(first), answer(second)
    for values, direct, refused, _ in answers:
        # By hand: values 1 + 2 + 0.5 and counts (0 + 1) + 3, then 3.5 + 2 + 0.5 and (4 + 1) + 3.
        assert values == [6, (4 + 10.5) + (8 + 18 + 1)]
        assert direct == [3, 4 + 10.5 + 1]
        assert refused == "too long"
    compiled = answers[0][3] + answers[1][3]
    assert sorted(compiled) == sorted(FUNCTIONS)
    assert answer(start())[3] == []  # what comes from the cache finds its way to others as well


HOLD = """
import sys, time
import small
from mcdem.compiled_once import _lock_of

with _lock_of(small.step.kernel, lambda question: None):
    print("held", flush=True)
    time.sleep(600)
"""


def test_whoever_waits_goes_on_when_the_owner_of_a_lock_is_killed(start):
    owner = start(HOLD)
    assert owner.stdout.readline() == "held\n"
    waiting = start()
    with pytest.raises(subprocess.TimeoutExpired):
        waiting.wait(timeout=8)
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    assert answer(waiting)[2] == "too long"
    owner.stdout.close()


INTERRUPT = """
import json, signal
import mcdem.compilation
import numpy as np
import small


def end(*_):
    raise KeyboardInterrupt


def asked_for_the_end(question):
    signal.raise_signal(signal.SIGTERM)


signal.signal(signal.SIGINT, signal.SIG_IGN)  # as under nohup
signal.signal(signal.SIGTERM, end)
outer = small.Outer(np.zeros(2), None, small.Inner(np.ones(3), 2), True, (0.5,))
compile_question = mcdem.compilation._compile_question
mcdem.compilation._compile_question = asked_for_the_end
try:
    small.two_steps(np.zeros(3), outer)
    ended = False
except KeyboardInterrupt:
    ended = True
mcdem.compilation._compile_question = compile_question
print(json.dumps([ended, small.two_steps(np.zeros(3), outer)]))
"""


def test_the_end_can_be_asked_for_while_a_function_is_compiled(start):
    """And what was asked for then is compiled when it is called again."""
    ended, values = answer(start(INTERRUPT))
    assert ended
    assert values == [6, (4 + 10.5) + (8 + 18 + 1)]


def test_the_watch_says_how_long_compiling_takes_about(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    now = [0.0]
    monkeypatch.setattr("mcdem.compiled_once.time.monotonic", lambda: now[0])
    (tmp_path / "integrators").mkdir()

    def compile_until(count):
        for number in range(count):
            (tmp_path / "integrators" / f"f{number}.nbc").touch()

    watch = CompilationWatch()
    assert watch() == "compiling (first run only)"
    compile_until(CompilationWatch.WHOLE // 2)
    now[0] = 30.0
    assert watch() == "compiling (first run only), about 30 s left"
    now[0] += 2 * CompilationWatch.QUIET
    assert watch() == ""

    second = CompilationWatch()
    assert second() == ""
    compile_until(CompilationWatch.WHOLE // 2 + 1)
    now[0] += 1.0
    assert second() == "compiling what no scene before has called for"
