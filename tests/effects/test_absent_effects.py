"""The table of absent effects: the builds that never had one, and the case that judges it."""

from __future__ import annotations

import ast
import os
import subprocess
import sys

import pytest

from mcdem.effects import EFFECTS
from validation import broken
from validation import case as cases_of
from validation.cases.absent_effects_cost import benchmark

TABLE = benchmark()


def modules_imported(package):
    """Every module that a file of a package imports from mcdem.effects."""
    found = set()
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("mcdem.effects"):
                found |= {node.module.rpartition(".")[2], *(alias.name for alias in node.names)}
    return found


@pytest.mark.parametrize("effect", list(EFFECTS))
def test_a_build_without_an_effect_holds_nothing_of_it(effect, tmp_path):
    """It lacks the file and the line in the menu, and nothing else of the package asks for them."""
    assert (TABLE.ROOT / "mcdem" / "effects" / f"{effect}.py").exists()
    without = TABLE.build_without(effect, tmp_path) / "mcdem"
    assert not (without / "effects" / f"{effect}.py").exists()
    assert f'"{effect}",' not in (without / "effects" / "__init__.py").read_text(encoding="utf-8")
    gone = TABLE.RESISTANCES if effect in TABLE.RESISTANCES else (effect,)
    assert not modules_imported(without) & set(gone)


@pytest.mark.parametrize("effect", ["van_der_waals", "rods"])
def test_a_build_without_an_effect_reads_a_scene(effect, tmp_path):
    """The package runs without the file: an effect is one."""
    program = (
        "import sys; from mcdem.scene import load_scene; from mcdem.effects import EFFECTS; "
        f"assert {effect!r} not in EFFECTS; load_scene(sys.argv[1]).with_changes({{'effects': None}}).kernels"
    )
    environment = os.environ | {"PYTHONPATH": str(TABLE.build_without(effect, tmp_path))}
    scene = TABLE.scene_of(effect, False, "explicit_euler", "free_draining")
    path = tmp_path / "scene.toml"
    path.write_text(scene.text, encoding="utf-8")
    command = [sys.executable, "-c", program, str(path)]
    subprocess.run(command, env=environment, cwd=tmp_path, check=True, timeout=120)


def test_every_effect_has_its_row_and_a_scene_with_and_without_it():
    assert set(TABLE.EFFECTS) == set(TABLE.STRENGTH) == set(EFFECTS)
    for effect in TABLE.EFFECTS:
        scheme = "implicit" if effect in TABLE.RESISTANCES else "explicit_euler"
        for present in (True, False):
            scene = TABLE.scene_of(effect, present, scheme, "free_draining")
            assert (scene.effects.get(effect) is not None) == present


@pytest.mark.parametrize("change", [0.0, 1e-9])
def test_the_case_judges_every_row(change):
    """On numbers as if they had just been measured: the saved ones, and a strength zero that changes something or not."""
    case = cases_of.load("absent_effects_cost")

    def verdict():
        from validation import datasets

        numbers = {"kept": datasets.absent_effects(), "zero": {"van_der_waals": change}, "timed": {}}
        return case.judge(case.context(True), numbers).verdict

    assert verdict() == (case.expected if change == 0.0 else "differs")
    with broken.broken("absent_costs"):
        assert verdict() == "differs"
