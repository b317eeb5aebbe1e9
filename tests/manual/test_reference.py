"""The reference leaves nothing out: every public name, key of a scene and variable of a dataset is in it, each with its unit."""

from __future__ import annotations

import doctest
import importlib
import inspect
import re
from pathlib import Path

import netCDF4
import pytest
from toy_encounters import toy_encounter

pytest.importorskip("sphinx", reason="Sphinx is not installed (pip install 'pbekit[docs]')")

from docs.extensions import reference
from docs.extensions.docstrings import readable
from mcdem.monte_carlo import run
from mcdem.scene import describe, load_scene

ROOT = Path(__file__).parents[2]
PUBLIC = [(package, name) for package in reference.packages() for name in reference.public(package)]


def found(package, name):
    return getattr(importlib.import_module(package), name)


def own():
    """Every public function and class once, under the name by which it is documented."""
    for package, name in PUBLIC:
        if reference.face_of(package, name) == package and callable(found(package, name)):
            yield f"{package}.{name}", found(package, name)


def sections(thing) -> dict[str, str]:
    """{title: text} of the sections of a docstring in numpydoc's form."""
    text = inspect.getdoc(thing) or ""
    parts = re.split(r"^([A-Z][A-Za-z ]+)\n-{3,}\n", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_package_is_found():
    assert len(PUBLIC) > 120
    assert {"mcdem", "pbekit", "mcdem.analysis", "pbekit.balance"} <= set(reference.packages())


def test_every_public_name_says_what_it_is():
    for name, thing in own():
        assert inspect.getdoc(thing), name


def test_parameters_are_described_or_on_the_list_of_those_that_are_not():
    """The list gets shorter only."""
    lacking = set()
    for name, thing in own():
        if not inspect.isfunction(thing):
            continue
        described = {
            word.strip(" *")
            for line in sections(thing).get("Parameters", "").splitlines()
            if re.match(r"[\w*]", line)
            for word in line.partition(" : ")[0].split(",")
        }
        if set(inspect.signature(thing).parameters) - described - {"progress"}:
            lacking.add(name)
    listed = set((Path(__file__).parent / "without_parameters.txt").read_text().split())
    assert lacking == listed, f"described now: {listed - lacking}; not described: {lacking - listed}"


def test_examples_are_there_or_on_the_list_of_names_without():
    """The list gets shorter only; what is compiled, or takes minutes, is shown in the notebooks instead."""
    lacking = {name for name, thing in own() if "Examples" not in sections(thing)}
    listed = set((Path(__file__).parent / "without_example.txt").read_text().split())
    assert lacking == listed, f"has one now: {listed - lacking}; has none: {lacking - listed}"


SLOW = {
    "mcdem.EncounterResult",
    "mcdem.PairEfficiency",
    "mcdem.Recorder",
    "mcdem.RunSummary",
    "mcdem.Velocities",
    "mcdem.critical_offset",
    "mcdem.encounter.worst_loads",
    "mcdem.figures.draw_all",
    "mcdem.figures.plot_run",
    "mcdem.figures.report",
    "mcdem.monte_carlo.RunProgress",
    "mcdem.monte_carlo.compress",
    "mcdem.pair_efficiency",
    "mcdem.run",
    "mcdem.simulate_encounter",
    "mcdem.tabulate",
    "mcdem.velocities",
    "pbekit.SteadyState",
    "pbekit.compare_table",
    "pbekit.export.Exported",
    "pbekit.export.HandOver",
    "pbekit.export.hand_over",
    "pbekit.export_table",
    "pbekit.solution.population_course",
}
"""Names whose example compiles an encounter, or takes more than a few seconds."""


def test_slow_examples_exist():
    assert not SLOW - {name for name, thing in own() if "Examples" in sections(thing)}


@pytest.mark.parametrize(
    "thing",
    [
        pytest.param(thing, id=thing.__name__, marks=[pytest.mark.slow] if name in SLOW else [])
        for name, thing in own()
        if "Examples" in sections(thing)
    ],
)
def test_examples_run(thing, monkeypatch):
    monkeypatch.chdir(ROOT)
    finder, runner = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    (test,) = finder.find(thing, thing.__name__, globs={})
    assert test.examples
    assert runner.run(test).failed == 0


def test_every_key_of_a_scene_has_its_meaning_and_what_it_expects():
    keys = [key for key in describe() if key.key]
    assert len(keys) > 60
    assert not [key for key in keys if not key.meaning or not key.expected]


def test_every_variable_of_a_run_is_in_its_layout_with_its_unit(tmp_path):
    scene = load_scene(ROOT / "scenes/paper-1000Pa.toml").with_changes({"population.initial": 10})
    run(scene, tmp_path / "run.nc", events=5, encounter=toy_encounter)
    documented = {(group, name): (dims, unit) for group, name, dims, _, unit, _ in reference.layout("runs")}
    groups = {"/", "/events", "/snapshots", "/kept"}
    seen = 0
    with netCDF4.Dataset(tmp_path / "run.nc") as data:
        for group in groups - {"/"} | {""}:
            holder = data[group] if group else data
            for name, variable in holder.variables.items():
                dims, unit = documented[group or "/", name]
                assert unit == variable.units, (group, name)
                assert len(dims.split(", ")) == len(variable.dimensions), (group, name)
                assert dims.split(", ")[1:] == list(variable.dimensions[1:]), (group, name)
                seen += 1
    assert seen > 40


def test_every_option_of_a_command_has_its_help():
    for program in ("mcdem", "pbekit"):
        for name, function in reference.commands(program).items():
            assert inspect.getdoc(function), name
            for parameter in reference.parameters_of(function):
                assert parameter.meaning, (program, name, parameter.name)


def test_docstrings_in_plain_text_are_read():
    given = """Moves |u| by u_.

    F = a b

x : (N,) [m]
    more
y : [s]

Parameters
----------
a : [m]"""
    shown = """Moves \\|u\\| by u\\_.

::

        F = a b

``x``
    (N,) [m]
    more
``y``
    [s]

Parameters
----------
a : [m]"""
    assert readable(given.splitlines()) == shown.splitlines()
