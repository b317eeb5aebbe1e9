"""The table of absent effects: the builds that never had one, and the case that judges it."""

from __future__ import annotations

import ast

import pytest

from mcdem.effects import Effects
from validation import broken
from validation import case as cases_of
from validation.cases.absent_effects_cost import benchmark

TABLE = benchmark()


def branches(effect, package):
    """Branches that are taken if an effect is there, where forces and laws of contacts are put together."""
    found = []
    for name in ("effects/__init__.py", "effects/short_range.py"):
        for node in ast.walk(ast.parse((package / name).read_text(encoding="utf-8"))):
            if isinstance(node, ast.If) and ast.unparse(node.test) == f"{effect} is not None":
                found.append(node)
    return found


@pytest.mark.parametrize("effect", list(Effects.model_fields))
def test_a_build_without_an_effect_has_nothing_of_it_left_where_forces_are_added(effect, tmp_path):
    assert branches(effect, TABLE.ROOT / "mcdem")
    assert not branches(effect, TABLE.build_without(effect, tmp_path) / "mcdem")


def test_every_effect_has_its_row_and_a_scene_with_and_without_it():
    assert set(TABLE.EFFECTS) == set(TABLE.STRENGTH) == set(Effects.model_fields)
    for effect in TABLE.EFFECTS:
        scheme = "implicit" if effect in TABLE.RESISTANCES else "paper"
        for present in (True, False):
            scene = TABLE.scene_of(effect, present, scheme, "free_draining")
            assert (getattr(scene.effects, effect) is not None) == present


@pytest.mark.parametrize("change", [0.0, 1e-9])
def test_the_case_judges_every_row(change):
    """On numbers as if they had just been measured: the saved ones, and a strength zero that is felt or not."""
    case = cases_of.load("absent_effects_cost")

    def verdict():
        from validation import datasets

        numbers = {"kept": datasets.absent_effects(), "zero": {"van_der_waals": change}, "timed": {}}
        return case.judge(case.context(True), numbers).verdict

    assert verdict() == (case.expected if change == 0.0 else "differs")
    with broken.broken("absent_costs"):
        assert verdict() == "differs"
