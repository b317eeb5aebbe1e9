"""The fast part of the catalogue of hard cases holds its laws; and a law sees what breaks it."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import mcdem
from mcdem.scene import load_scene
from validation.hard_cases import laws
from validation.hard_cases.case import PAPER, Course, Encounter, Finding, Shortcut, Whole, worst
from validation.hard_cases.catalogue import CATALOGUE
from validation.hard_cases.shapes import doublet, monomer, one_redundant_centres, shape, tetrahedron_centres
from validation.hard_cases.table import README, Judged, markdown, warm_up
from validation.hard_cases.watch import look


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    warm_up()  # what the compiler takes is no case's time


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, id=case.name, marks=[] if case.quick else pytest.mark.slow) for case in CATALOGUE],
)
def test_the_laws_hold(case):
    found = list(case.judge())
    assert found
    broken = [f"{f.law}: {f.words} (margin {f.margin:.2g})" for f in found if f.verdict == "broken"]
    assert not broken, f"{case.story}: {broken}"
    # An expected failure that has been mended is one no more.
    expected = {f.law for f in found if f.verdict == "expected failure"}
    assert expected == set(getattr(case, "expected", {}))


def test_names_are_distinguished():
    assert len({case.name for case in CATALOGUE}) == len(CATALOGUE)


@pytest.fixture(scope="module")
def case() -> Encounter:
    return Encounter("synthetic", "", shape(tetrahedron_centres()), monomer, strain=1.0)


def test_the_shape_with_one_redundant_contact_has_one():
    from mcdem.aggregates.rigidity import count_modes

    aggregate = shape(one_redundant_centres())(load_scene(PAPER))
    sizes, counts = np.array([aggregate.size]), np.array([len(aggregate.bonds)])
    modes = count_modes(aggregate.positions, sizes, aggregate.bonds, counts)
    assert modes.tolist() == [[0, 1]]


def test_laws_of_results_see_what_breaks_them(case):
    whole = Whole(case)
    good = whole.result

    def margin(law, **changes):
        whole.__dict__["result"] = replace(good, **changes)
        return law(whole)[0]

    assert margin(laws.conserves) > 0
    assert margin(laws.conserves, members=(np.array([0, 1, 2, 3]), np.array([3]))) < 0
    assert margin(laws.conserves, outcome="fragmentation") < 0
    assert margin(laws.ends, outcome="unresolved", reason="", state=np.zeros((5, 3))) < 0
    assert margin(laws.ends, outcome="unresolved", reason="told", state=None) < 0
    assert margin(laws.ends, outcome="unresolved", reason="told", state=np.zeros((5, 3))) > 0
    assert margin(laws.is_finite, largest_tension=np.nan) < 0
    assert margin(laws.ends_in_time, cpu_time=61.0) < 0
    stretched = mcdem.Aggregate(1.01 * good.products[0].positions, good.products[0].bonds)
    assert margin(laws.products_hold_together, products=(stretched, *good.products[1:])) < 0


def test_laws_of_courses_see_what_breaks_them(case, monkeypatch):
    course = Course(case, "implicit")
    good = course.seen

    def margin(law, **changes):
        course.__dict__["seen"] = course.__dict__["compared"] = replace(good, **changes)
        return law(course)[0]

    for changes in ({"made_at": 1e-9}, {"lost_at": 1e-5}, {"kept_to": 1e-3}, {"free_from": -1e-9}):
        assert margin(laws.contacts_by_their_law, **changes) < 0
    assert margin(laws.contacts_by_their_law) > 0
    assert margin(laws.overlaps_as_contacts_bear, deepest=-0.01) < 0
    assert margin(laws.stays_finite, finite=False) < 0
    assert margin(laws.stays_finite, code=2) < 0
    elsewhere = good.positions + [0.0, 0.0, 1e-5]
    elsewhere[0] += 1e-5
    for law in (laws.symmetric, laws.numbering, laws.translation):
        assert margin(law) > 0
        assert margin(law, positions=elsewhere) < 0
    piled = [(np.zeros((5, 3)) + 1e-3 * np.arange(5)[:, None], np.zeros((5, 5), bool))]
    assert margin(laws.factorises) > 0
    monkeypatch.setattr(laws, "resistance", lambda scene, positions: np.diag([-1e-3, 1.0, 1.0]))
    assert margin(laws.factorises, states=piled) < 0


def test_an_edge_that_a_shortcut_moves_is_broken_and_so_is_one_off_theory():
    def edge(scene):
        return 1.0 + 0.01 * scene.numerics.separation  # 1.015 with it, 1 without

    def verdicts(moved, off_by):
        case = Shortcut("moved", "", ("separation",), edge, moved, exact=lambda scene: 1.0, off_by=off_by)
        return [finding.verdict for finding in case.judge()]

    assert verdicts(0.02, 0.02) == ["holds", "holds"]
    assert verdicts(0.01, 0.02) == ["broken", "holds"]
    assert verdicts(0.02, 0.01) == ["holds", "broken"]
    nowhere = Shortcut("nowhere", "", ("separation",), lambda scene: float("nan"), 0.1)
    assert [finding.verdict for finding in nowhere.judge()] == ["broken"]


def test_watching_sees_every_contact_made_and_lost(case):
    seen = Course(case, "implicit").seen
    pairs = np.triu(np.ones((3, 3), bool), 1)
    before, after = np.zeros((3, 3), bool), np.zeros((3, 3), bool)
    before[0, 1] = after[1, 2] = True
    gaps = np.array([[0, 3e-4, 1.0], [3e-4, 0, -1e-5], [1.0, -1e-5, 0]])
    look(seen, before, after, gaps, pairs)
    assert (seen.changes, seen.made_at, seen.lost_at) == (2, -1e-5, 3e-4)


def test_two_ensembles_of_different_outcomes_are_distinguished():
    def results(outcome, contacts):
        product = SimpleNamespace(bonds=np.zeros((contacts, 2)), size=1)
        return [SimpleNamespace(outcome=outcome, products=(product,)) for _ in range(40)]

    assert laws.same_outcomes(results("missed", 3), results("missed", 3))[0] > 0
    assert laws.same_outcomes(results("missed", 3), results("aggregation", 3))[0] < 0
    assert laws.same_contacts(results("missed", 3), results("missed", 3))[0] > 0
    assert laws.same_contacts(results("missed", 3), results("missed", 4))[0] < 0


def test_the_worst_finding_is_the_one_with_the_least_left(case):
    found = list(Encounter("doublet", "", doublet(0.0), monomer, strain=0.2).judge())
    assert worst(found).margin == min(f.margin for f in found)


def test_the_page_says_what_does_not_hold():
    def found(verdict, margin):
        return Finding("a case", "a law", verdict, 7, margin, "words")

    stand_in = SimpleNamespace(name="a case", story="a story")
    judged = [
        Judged(stand_in, (found("holds", 0.5), found("broken", -2.0)), 1.0),
        Judged(stand_in, (found("holds", 0.9),), 2.0),
    ]
    page = markdown(judged)
    assert "| a case | a story | 2 | broken | 7 | -2 | a law: words |" in page
    assert "| a case | a story | 1 | holds | 7 | 0.9 | a law: words |" in page
    assert "- a case, a law: **broken**, words" in page
    assert "2 cases: 2 holds, 1 broken; the longest, a case, took 2.0 s" in page


def test_the_page_has_a_row_for_each_case_as_it_is_now():
    """README.md is regenerated by `python -m validation.hard_cases --readme`, never edited."""
    rows = re.findall(r"^\| (.+?) \| (.+?) \| \d+ \| [\w ]+ \| \d+ \|", README.read_text(), re.MULTILINE)
    assert rows == [(case.name, case.story) for case in CATALOGUE]


def test_a_last_gap_is_closed_however_strong_the_attraction():
    """No shortest step of 1e-9/g keeps primaries from landing on a stiff contact in a weak flow."""
    scene = load_scene(PAPER).with_changes(
        {
            "flow.shear_rate": "1 1/s",
            "flow.viscosity": "1e-3 Pa s",
            "effects.van_der_waals.hamaker_constant": "1e-18 J",
            "effects.jkr.elastic_modulus": "1 TPa",
        }
    )
    result = mcdem.simulate_encounter(
        scene, mcdem.Aggregate.monomer(), mcdem.Aggregate.monomer(), (0.0, 0.3 * scene.suspension.radius)
    )
    assert result.outcome == "aggregation"
