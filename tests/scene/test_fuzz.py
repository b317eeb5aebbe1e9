"""Encounters from anywhere in the ranges of scenes and starts end, with every law of results held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from validation import fuzz
from validation.fuzz import RANGES, SHAPES, Body, Trial, attempt, draw, numbered


def logarithmic(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


bodies = st.builds(
    Body,
    kind=st.sampled_from(SHAPES),
    size=st.integers(2, 5),
    seed=st.integers(0, 2**31 - 1),
    stretch=st.floats(-1.0, 0.999),
)
trials = st.builds(
    Trial,
    **{name: logarithmic(*ends) for name, ends in RANGES.items() if name != "cutoff"},
    cutoff=st.one_of(st.just(0.0), logarithmic(*RANGES["cutoff"])),
    cutoff_convention=st.sampled_from(["matrix", "gap"]),
    scheme=st.just("implicit"),
    first=bodies,
    second=bodies,
    offset=st.tuples(st.floats(-0.9, 0.9), st.floats(1e-9, 0.4) | st.floats(0.4, 1.0)),
    start_distance=st.floats(1.0, 5.0),
    rotations=st.floats(0.0, 0.3),
    most_steps=st.just(500),
)


@settings(max_examples=250, suppress_health_check=[HealthCheck.too_slow])
@given(trials)
def test_any_encounter_ends_and_holds_the_laws(trial):
    found = attempt(trial)
    assert not found.failures, found


@pytest.mark.slow
@settings(max_examples=2500, suppress_health_check=[HealthCheck.too_slow])
@given(trials.map(lambda trial: replace(trial, most_steps=5000)))
def test_thousands_of_encounters_hold_the_laws(trial):
    found = attempt(trial)
    assert not found.failures, found


def test_a_trial_is_its_seed_and_number_and_survives_its_file():
    trial = numbered(3, 14)
    assert trial == numbered(3, 14) != numbered(3, 15)
    assert Trial.from_json(trial.to_json(failures=["one"], story="two")) == trial


def test_trials_reach_the_ends_of_the_ranges():
    rng = np.random.default_rng(0)
    drawn = [draw(rng) for _ in range(600)]
    for name, (low, high) in RANGES.items():
        values = np.array([getattr(trial, name) for trial in drawn])
        ordinary = values[(values > 0.0) & (values > 1e-50)]
        assert ordinary.min() < low * (high / low) ** 0.05
        assert ordinary.max() > low * (high / low) ** 0.95
    assert min(trial.cutoff for trial in drawn) == 0.0
    assert {trial.scheme for trial in drawn} == {"implicit", "explicit_euler"}
    assert min(abs(trial.offset[1]) for trial in drawn) < 1e-6


def test_a_crash_and_a_broken_law_are_failures(monkeypatch):
    trial = numbered(1, 0)

    def crash(*arguments, **options):
        raise FloatingPointError("boom")

    monkeypatch.setattr("mcdem.simulate_encounter", crash, raising=False)
    found = attempt(trial)
    assert found.outcome == "crash" and "FloatingPointError: boom" in found.failures[0]
    monkeypatch.undo()
    monkeypatch.setitem(fuzz.laws.OF_RESULTS, "finite", lambda whole: (float("nan"), "no number"))
    assert attempt(trial).failures == ("finite: no number",)


def test_failures_are_kept_and_reported(monkeypatch, tmp_path, capsys):
    import typer

    broken = fuzz.Attempt("missed", "", 3, 0.1, ("finite: nothing is",))

    def two(seed, encounters, workers):
        yield 0, numbered(seed, 0), fuzz.Attempt("missed", "", 3, 0.1)
        yield 1, numbered(seed, 1), broken

    monkeypatch.setattr(fuzz, "fuzz", two)
    with pytest.raises(typer.Exit) as ended:
        fuzz.main(encounters=2, workers=1, seed=9, out=tmp_path, replay=None)
    assert ended.value.exit_code == 1
    (kept,) = tmp_path.iterdir()
    assert Trial.from_json(kept.read_text()) == numbered(9, 1)
    assert "finite: nothing is" in capsys.readouterr().out
