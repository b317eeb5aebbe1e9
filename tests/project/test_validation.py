"""The validation package: what a verdict is, what is reused, what is written, and that no case passes by construction."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mcdem.errors import UserError
from mcdem.monte_carlo.executors import Here, local_processes
from validation import broken, origin, report
from validation import case as cases_of
from validation.__main__ import chosen
from validation.case import Case, Check, Context, Findings, Verdict, below, cannot_say, near, shown
from validation.run import Outcome, run

ROOT = Path(__file__).parents[2]
ALL = cases_of.names()

# What takes more than a few seconds, broken, is left to `-m slow`.
CHEAP = {
    "batchelor_green_mobility": ("strain_sign", "no_lubrication", "delta_moved"),
}


def keep_case(monkeypatch, name, case):
    """Let a case be known that has no file."""
    monkeypatch.setattr(cases_of, "load", lambda _: case)
    monkeypatch.setattr("validation.run.load", lambda _: case)
    object.__setattr__(case, "name", name)
    return case


# Verdicts


@pytest.mark.parametrize(
    ("check", "verdict"),
    [
        (near("x", 1.01, 1.0, rel=0.02), "agrees"),
        (near("x", 1.03, 1.0, rel=0.02), "differs"),
        (near("x", -1.03, -1.0, rel=0.02), "differs"),
        (near("x", 1.01, 1.0, rel=0.02, error=0.015), "cannot say"),
        (near("x", 1.05, 1.0, rel=0.02, error=0.015), "differs"),
        (near("x", 1.03, 1.0, rel=0.02, gap="known"), "known gap"),
        (near("x", 1.01, 1.0, rel=0.02, gap="known"), "agrees"),
        (near("x", math.nan, 1.0, rel=0.02, gap="known"), "cannot say"),
        (below("x", 0.1, 0.2), "agrees"),
        (below("x", 0.3, 0.2), "differs"),
        (cannot_say("x", "no data"), "cannot say"),
    ],
)
def test_a_verdict_weighs_deviation_error_and_tolerance(check, verdict):
    assert check.verdict == verdict


def test_a_case_comes_to_the_gravest_of_its_checks():
    agrees, gap = near("x", 1, 1, abs=0.1), near("x", 2, 1, abs=0.1, gap="known")
    unknown, differs = cannot_say("x", "no data"), near("x", 2, 1, abs=0.1)
    orientation = shown("x", math.nan)
    assert orientation.verdict is None
    for several, verdict in (
        ((agrees, orientation), "agrees"),
        ((gap, agrees), "known gap"),
        ((gap, unknown), "cannot say"),
        ((differs, unknown, gap), "differs"),
        ((), "cannot say"),
    ):
        assert Findings(several).verdict == verdict


# Running


def counting_case(tmp_path, **more):
    """A case that leaves a mark each time it measures."""

    def measure(context, argument):
        with (tmp_path / "marks").open("a") as file:
            file.write(f"{argument}\n")
        if argument == "bad":
            raise ArithmeticError("as asked")
        return {"value": np.float64(argument), "quick": context.quick, "row": np.arange(2)}

    def judge(context, numbers):
        return Findings(tuple(near(label, n["value"], 1.0, abs=0.5) for label, n in numbers.items()))

    fields = {
        "chapter": 1,
        "claim": "a claim | of two",
        "source": "a source",
        "tolerance": "a tolerance",
        "parts": lambda context: {"one": 1, "two": 1.2},
        "seen": (),
    }
    return Case(measure=measure, judge=judge, **(fields | more))


def marks(tmp_path):
    return (tmp_path / "marks").read_text().split()


def test_numbers_are_reused_until_something_they_rest_on_changes(tmp_path, monkeypatch):
    case = keep_case(monkeypatch, "drag_along_the_line", counting_case(tmp_path))
    (first,) = run([case], tmp_path / "kept", Here())
    assert (first.verdict, first.reused, first.parts) == ("agrees", 0, 2)
    assert [c.quantity for c in first.findings.checks] == ["one", "two"]
    (again,) = run([case], tmp_path / "kept", Here())
    assert (again.reused, again.cpu) == (2, first.cpu)
    assert len(marks(tmp_path)) == 2
    run([case], tmp_path / "kept", Here(), quick=True)
    assert len(marks(tmp_path)) == 4
    run([case], tmp_path / "kept", Here(), fresh=True)
    assert len(marks(tmp_path)) == 6
    monkeypatch.setattr(origin, "_digest", lambda path: "edited")
    run([case], tmp_path / "kept", Here())
    assert len(marks(tmp_path)) == 8
    # A spoilt file counts as none.
    for path in (tmp_path / "kept").rglob("*.json"):
        path.write_text(path.read_text()[:20])
    run([case], tmp_path / "kept", Here())
    assert len(marks(tmp_path)) == 10


def test_what_was_measured_before_a_failure_is_kept(tmp_path, monkeypatch):
    parts = {"one": 1, "two": "bad"}
    case = keep_case(monkeypatch, "drag_along_the_line", counting_case(tmp_path, parts=lambda context: parts))
    (failed,) = run([case], tmp_path / "kept", Here())
    assert failed.verdict == "failed"
    assert not failed.as_expected
    assert "as asked" in failed.problem
    run([case], tmp_path / "kept", Here())
    assert marks(tmp_path) == ["1", "bad", "bad"]


def test_an_input_that_changes_is_measured_anew(tmp_path):
    file = tmp_path / "data.nc"
    case = counting_case(tmp_path, inputs=lambda context: (file,))
    object.__setattr__(case, "name", "drag_along_the_line")
    keys = [origin.key(case, Context(), "all", None, None)]
    for content in ("one", "two"):
        file.write_text(content)
        origin._digest.cache_clear()
        keys.append(origin.key(case, Context(), "all", None, None))
    keys.append(origin.key(case, Context(seed=1), "all", None, None))
    keys.append(origin.key(case, Context(), "all", None, "strain_sign"))
    assert len(set(keys)) == 5


def test_a_cases_numbers_rest_on_what_it_imports():
    reached = {str(p.relative_to(ROOT)) for p in origin.sources(ALL["drag_along_the_line"])}
    assert reached >= {
        "validation/cases/drag_along_the_line.py",
        "validation/exact/bispherical.py",
        "mcdem/hydrodynamics/two_sphere/tables.py",
        "mcdem/hydrodynamics/two_sphere/twin_multipoles.py",
    }
    assert not {"mcdem/monte_carlo/process.py", "mcdem/monte_carlo/run_control.py"} & set(reached)
    assert "mcdem/encounter/motion.py" in {
        str(p.relative_to(ROOT)) for p in origin.sources(ALL["batchelor_green_trajectories"])
    }


def test_what_needs_an_absent_library_is_not_run_and_not_kept(tmp_path, monkeypatch):
    def needs(context, argument):
        raise ModuleNotFoundError("No module named 'mpmath'", name="mpmath")

    case = keep_case(monkeypatch, "drag_along_the_line", counting_case(tmp_path))
    object.__setattr__(case, "measure", needs)
    (outcome,) = run([case], tmp_path / "kept", Here())
    assert (outcome.verdict, outcome.needs, outcome.as_expected) == ("not run", "mpmath", True)
    assert not list((tmp_path / "kept").rglob("*.json"))
    assert "**not run**: needs mpmath: pip install mpmath" in report.markdown([outcome])
    assert "not run" in report.html([outcome], "Validation")


def test_any_executor_gives_the_same_numbers(tmp_path):
    case = cases_of.load("batchelor_green_mobility")
    (here,) = run([case], tmp_path / "here", Here(), quick=True)
    with local_processes(1) as crew:
        (there,) = run([case], tmp_path / "there", crew, quick=True)
    assert here.findings.checks == there.findings.checks
    assert here.verdict == "agrees"


# What is written


def test_page_and_table_say_everything(tmp_path, monkeypatch):
    case = keep_case(
        monkeypatch,
        "drag_along_the_line",
        counting_case(tmp_path, expected=Verdict.differs, because="it is made to", parts=lambda _: {"a": 7}),
    )
    outcomes = run([case], tmp_path / "kept", Here(), quick=True)
    page = report.html(outcomes, "Validation")
    for words in ("a claim | of two", "a source", "a tolerance", "it is made to", "differs", "1 ± 0.5"):
        assert words in page
    assert "python -m validation drag_along_the_line --quick -o report/" in page
    assert "where differs was expected" not in page
    for outside in ("http://", "https://", "<script"):
        assert outside not in page
    table = report.markdown(outcomes)
    (row,) = [line for line in table.splitlines() if line.startswith("| `drag")]
    assert row.replace("\\|", "").count("|") == 6
    assert "**differs**: it is made to" in row
    assert "a: 7 (1 ± 0.5); 0 of 1 checks agree" in row


def test_the_committed_table_holds_every_case_and_its_claim():
    table = report.README.read_text(encoding="utf-8")
    for case in cases_of.load_all():
        (row,) = [line for line in table.splitlines() if line.startswith(f"| `{case.name}` ")]
        assert case.claim.replace("|", "\\|") in row, "run python -m validation -o report/ --readme"
        assert f"**{case.expected.value}**" in row
    listed = [line for line in table.splitlines() if line.startswith("| `")]
    assert len(listed) == len(ALL)
    assert "**failed**" not in table


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "validation", *arguments], capture_output=True, text=True, cwd=ROOT
    )


def test_the_command_ends_with_1_when_a_verdict_is_not_the_one_known(tmp_path):
    arguments = ("batchelor_green_mobility", "--quick", "-o", str(tmp_path), "--workers", "1")
    done = command(*arguments, "--break", "strain_sign")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "unexpected: batchelor_green_mobility: differs, expected agrees" in done.stdout
    assert "Physics was broken on purpose: strain_sign" in (tmp_path / "report.html").read_text()
    # What was measured with broken physics is not taken for the real thing.
    assert command(*arguments).returncode == 0
    assert len(list((tmp_path / "kept").rglob("*.json"))) == 2
    assert json.loads(next((tmp_path / "kept").rglob("*.json")).read_text())["label"] == cases_of.ALONE


def test_mistakes_are_answered_in_a_line():
    assert chosen(["1"]) == [case.name for case in cases_of.load_all() if case.chapter == 1]
    with pytest.raises(UserError, match='case "no": not known; expected a chapter, 1 to 10, or one of'):
        chosen(["no"])
    done = command("--break", "no", "1")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert 'error: --break "no": expected one of strain_sign' in done.stderr


# No case passes by construction


def test_every_case_says_what_it_would_notice():
    for case in cases_of.load_all():
        assert case.seen, f"{case.name}: name at least one way of validation.broken.WAYS that it notices"
        assert set(case.seen) <= set(broken.WAYS)
        assert case.expected == Verdict.agrees or case.because


def differing(outcome: Outcome) -> set[str]:
    return {check.quantity for check in outcome.findings.checks if check.verdict == Verdict.differs}


def notices(name, way, folder):
    """Whether checks of a case that do not differ otherwise differ once physics is broken."""
    case = cases_of.load(name)
    (intact,) = run([case], folder, Here(), quick=True)
    (amiss,) = run([case], folder, Here(), quick=True, way=way)
    assert intact.as_expected, intact.problem or intact.findings
    assert not amiss.problem, amiss.problem
    return bool(differing(amiss) - differing(intact))


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    return tmp_path_factory.mktemp("kept")


@pytest.mark.parametrize(
    ("name", "way"),
    [
        pytest.param(name, way, marks=() if way in CHEAP.get(name, ()) else pytest.mark.slow)
        for name in ALL
        for way in cases_of.load(name).seen
    ],
)
def test_a_case_fails_when_its_physics_is_broken(name, way, kept):
    assert notices(name, way, kept)


def test_what_is_broken_is_mended_afterwards(kept):
    case = cases_of.load("batchelor_green_mobility")
    before = case.measured(case.context(True), cases_of.ALONE)
    for way in broken.WAYS:
        with broken.broken(way):
            pass
    assert case.measured(case.context(True), cases_of.ALONE) == before


def test_a_check_without_verdict_is_shown_with_a_dash():
    assert report.number(math.nan) == "–"
    assert report.expectation(Check("x", 1.0, low=0.5)) == "at least 0.5"
    assert report.expectation(shown("x", 1.0)) == ""
    assert report.expectation(shown("x", 1.0, expected=2.0)) == "beside 2"


def test_a_number_is_written_to_the_digits_that_its_tolerance_distinguishes():
    fine = near("x", 0.73243604, 0.7324360, abs=2e-6)
    assert (report.result(fine), report.expectation(fine)) == ("0.732436", "0.732436 ± 2e-06")
    coarse = near("x", 0.6451234, 0.645, abs=5e-4, error=1.2345e-4)
    assert report.result(coarse) == "0.6451 ± 0.00012"
    assert report.result(near("x", math.nan, 1.0, abs=1e-6)) == "–"
    assert report.result(near("x", 0.0, 0.0, abs=1e-6)) == "0"


# What the user gives


def test_a_run_that_is_given_takes_the_place_of_the_committed_one(tmp_path):
    from small_runs import small_runs

    from validation import datasets
    from validation.case import Given
    from validation.run import Outcome, parts_of

    case = cases_of.load("breakup_fragments")
    given = Given(runs=(Path(small_runs()[1]).resolve(),))
    assert datasets.runs(case.context(True)) != datasets.runs(case.context(True, given)) == given.runs
    keys = {part.key for way in (Given(), given) for part in parts_of(case, True, given=way)}
    assert len(keys) == len(datasets.runs(case.context(True))) + 1
    (outcome,) = run([case], tmp_path / "kept", Here(), quick=True, given=given)
    assert str(given.runs[0]) in outcome.command
    # Of a run that is given no verdict is expected; that it cannot be read is a failure.
    assert outcome.as_expected
    assert not Outcome(case, case.context(True, given), Findings(()), problem="unreadable").as_expected


def test_the_line_by_line_verdict_is_that_of_the_row():
    from mcdem.analysis.paper_comparison import Row
    from validation.cases.paper_line_by_line import check

    for measured, low, high, unsettled, verdict in (
        (1.6, 1.5, 1.7, False, "agrees"),
        (1.5, 1.4, 1.6, False, "differs"),
        (1.6, 1.5, 1.7, True, "cannot say"),
        (1.6, 0.0, 9.0, False, "cannot say"),
    ):
        row = Row("x", "1.68", 1.675, 1.685, measured, low, high, 50, unsettled)
        found = check("1000 Pa", vars(row) | {"agrees": row.agrees})
        assert found.verdict == verdict
        assert ("not steady yet" in found.why) == unsettled


def test_a_saved_table_of_costs_is_read_as_written(tmp_path):
    from mcdem.analysis.accuracy_cost import Price, write_prices
    from mcdem.analysis.paired_encounters import Setting
    from validation import datasets

    price = Price(
        Setting("as given", "as given"), np.arange(4.0), np.arange(4.0) / 8, 0.25, 30.0, 0.5, time_error=0.1
    )
    write_prices([price], tmp_path / "cost.csv")
    (row,) = datasets.prices(tmp_path / "cost.csv")
    assert (row["setting"], row["cpu_time_s"], row["error_eta_11"]) == ("as given", 0.25, 0.0)
    assert (row["error_geometry"], row["standard_error_geometry"]) == (3.0, 3 / 8)
    # Earlier tables call the column `knob`.
    old = (tmp_path / "cost.csv").read_text().replace(",varied,", ",knob,")
    (tmp_path / "old.csv").write_text(old)
    assert datasets.prices(tmp_path / "old.csv") == [row] and row["varied"] == "as given"
    (tmp_path / "other.csv").write_text("setting\n")
    with pytest.raises(UserError, match="expected a table of `mcdem cost`"):
        datasets.prices(tmp_path / "other.csv")


def test_the_peers_numbers_are_of_the_spheres_that_are_compared():
    from validation.cases import peer_pecnut

    kept = json.loads(peer_pecnut.KEPT.read_text())["velocities"]
    for positions, (shipped, turned) in zip(peer_pecnut.configurations(), kept, strict=True):
        x = np.array(positions)
        flow = x[:, [1]] * [0.0, 0.0, 1.0]
        # The disturbance changes sign with the strain, whatever the spheres; the ambient flow does not.
        np.testing.assert_allclose(np.array(shipped) - flow, flow - np.array(turned), atol=1e-6)


def committed(case):
    """Earlier numbers that a case reads; what was read off a publication is its source, not its measurement."""
    folders = ("validation/data", "notebooks/data")
    published = {"durlofsky_1987_fig5.csv", "measured.csv", "pecnut.json"}
    paths = {path for quick in (True, False) for path in case.inputs(case.context(quick))}
    return {p for p in paths if str(p.relative_to(ROOT).parent) in folders and p.name not in published}


@pytest.mark.parametrize("name", ALL)
def test_a_case_that_judges_saved_data_says_so_and_measures_some_of_it_again(name):
    case = cases_of.load(name)
    saved = {path for quick in (True, False) for path in case.saved(case.context(quick))}
    assert committed(case) <= saved
    assert bool(saved) == bool(case.anew)
    outcome = Outcome(case, case.context(True), Findings(()))
    for path in case.saved(case.context(True)):
        assert f"{path.name} (commit " in outcome.saved
    assert ("computed again: " in outcome.saved) == bool(case.saved(case.context(True)))
    for page in (report.html([outcome], "Validation"), report.markdown([outcome])):
        assert ("aved data" in page) == bool(outcome.saved)


# Shapes and statics that cases of breakup rest on


@pytest.mark.parametrize("ratio", [1.0, 3.0])
def test_packings_are_isostatic_and_of_the_shape_asked_for(ratio):
    from mcdem.aggregates.morphology import morphology
    from mcdem.aggregates.rigidity import count_modes
    from validation.exact.packings import isostatic

    x = isostatic(24, ratio, seed=1)
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    bonds = np.argwhere(np.triu((apart < 2.0 + 1e-6) & (apart > 0.0)))
    assert apart[np.triu_indices(24, 1)].min() > 2.0 - 1e-6
    (modes,) = count_modes(x, np.array([24]), bonds, np.array([len(bonds)]))
    assert (len(bonds), *modes) == (3 * 24 - 6, 0, 0)
    assert float(morphology(x, bonds, 1.0).aspect_ratio) == pytest.approx(ratio, rel=0.3)


def test_fractal_trees_have_their_dimension_and_no_loops():
    from validation.exact.packings import FRACTAL_PREFACTOR, fractal

    x, bonds = fractal(5, 1.8, seed=2)
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    np.testing.assert_allclose(apart[tuple(bonds.T)], 2.0, atol=1e-9)
    assert (apart < 2.0 + 1e-6).sum() == 32 + 2 * 31
    gyration = np.sqrt((x**2).sum(axis=1).mean())
    assert FRACTAL_PREFACTOR * gyration**1.8 == pytest.approx(32, rel=0.05)


def test_statics_balance_and_the_worst_orientation_bounds_all_others():
    from scipy.spatial.transform import Rotation

    from validation.exact.alone import Held, bond_tensions, largest_tension
    from validation.exact.packings import isostatic
    from validation.exact.settling import scene

    x = isostatic(7, 1.0, seed=0)
    bonds = np.argwhere(np.triu(np.linalg.norm(x[:, None] - x[None], axis=2) < 2.0 + 1e-6, 1))
    held = Held(scene(5e-3), x)
    balance = lambda forces: bond_tensions(x, bonds, forces)
    forces = held.forces()
    size = np.abs(forces).max()
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-9 * size)
    np.testing.assert_allclose(np.cross(x, forces).sum(axis=0), 0.0, atol=1e-8 * size)
    tensions, direction = balance(forces), x[bonds[:, 1]] - x[bonds[:, 0]]
    left = forces.copy()
    np.add.at(left, bonds[:, 0], tensions[:, None] * direction / 2.0)
    np.add.at(left, bonds[:, 1], -tensions[:, None] * direction / 2.0)
    np.testing.assert_allclose(left, 0.0, atol=1e-8 * size)
    worst = largest_tension(held, balance)
    turns = Rotation.random(300, rng=np.random.default_rng(1)).as_matrix()
    most = max(balance(held.forces(turn)).max() for turn in turns)
    assert 0.9 * worst < most <= worst * (1 + 1e-9)


# Slow references and statistics that cases rest on


def test_inflow_of_extension_is_all_within_the_cone_on_which_the_flow_turns():
    from scipy.integrate import quad

    from validation.exact.two_spheres import inflow_below

    assert inflow_below(0.0) == 0.0
    assert inflow_below(2.0 / np.sqrt(3.0)) == pytest.approx(1.0)
    # The share by quadrature of the inward velocity -(3 c^2 - 1)/2 over the sphere.
    inward = lambda c: 0.5 - 1.5 * c**2
    share = quad(inward, 0.0, 0.2)[0] / quad(inward, 0.0, np.sqrt(1.0 / 3.0))[0]
    assert inflow_below(0.4) == pytest.approx(share)


def test_the_mean_field_of_doublings_starts_at_the_rate_of_its_unit_of_time(monkeypatch):
    from validation.cases import monte_carlo_doubling as case

    monkeypatch.setattr(case, "TIMES", (1e-3, 2.0))
    early, late = case.mean_field()
    # dn/dt = -n^2 at the start; at the end the size at which pairs split bounds the mean.
    assert early == pytest.approx(1.0 - 1e-3, abs=1e-5)
    assert 1.0 / case.LARGEST < late < 3.0 / case.LARGEST


def test_a_rank_is_small_only_for_what_strays():
    from validation.cases.balance_against_monte_carlo import rank

    several = np.random.default_rng(0).normal(size=(99, 5))
    assert rank(several.mean(axis=0), several) == 1.0
    assert rank(several.mean(axis=0) + [0, 0, 9, 0, 0], several) == pytest.approx(0.01)


def test_a_printed_cluster_is_judged_by_how_odd_it_is_among_ours():
    from validation.cases.paper_line_by_line import likeness

    for off, count, clusters, verdict in (
        (0.5, 100, 1, "agrees"),
        (4.0, 100, 1, "differs"),
        (2.4, 40, 1, "cannot say"),
        (math.nan, 3, 1, "cannot say"),
        (1.2, 400, 10, "differs"),
    ):
        assert likeness("1000 Pa", "x", "1", off, count, clusters).verdict == verdict


def test_trees_of_fractal_motion_are_read_as_saved_and_their_exponent_is_that_of_a_power_law():
    from validation.cases import breakup_fractal_motion as case

    saved = case.measure(Context(), None)
    assert set(saved) == {case.named(*part) for part in case.parts(Context()).values()}
    rows = [{"primaries": p, "first": 900.0 * p ** (-1 / 0.9)} for p in (8, 16, 32)]
    assert case.exponent(rows, "first")[0] == pytest.approx(0.9)
