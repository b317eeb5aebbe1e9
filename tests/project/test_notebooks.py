"""Notebooks are stored without their output and use what there is; the manual executes them, and so does `-m slow`."""

import ast
import pydoc
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")


def code_of(path):
    """The program of a notebook, without its magics."""
    return "\n".join(
        cell.source.replace("%", "#", 1) if cell.source.startswith("%") else cell.source
        for cell in nbformat.read(path, as_version=4).cells
        if cell.cell_type == "code"
    )


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} >= {
        "01_first_scene",
        "02_paper_figures",
        "03_one_encounter",
        "04_kernels",
        "05_population_balance",
        "06_your_own_effect",
    }


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stored_clean(path):
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "code":
            assert cell.execution_count is None and cell.outputs == []


@pytest.mark.slow  # and again as the manual is built
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, monkeypatch):
    pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    from docs.notebooks import run

    monkeypatch.setenv("PYTHONPATH", str(path.parent.parent))
    assert any(
        output.output_type != "stream" for cell in run(path).cells for output in cell.get("outputs", [])
    )


def names_used(source):
    """(module, name) of what a program takes from a module of ours: `import m as n` with `n.name`, `from m import name`."""
    tree, alias = ast.parse(source), {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            alias |= {one.asname or one.name: one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom):
            yield from ((node.module, one.name) for one in node.names)
            alias |= {one.asname or one.name: f"{node.module}.{one.name}" for one in node.names}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in alias:
            yield alias[node.value.id], node.attr


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_a_notebook_uses_is_there(path):
    ours = {
        (module, name)
        for module, name in names_used(code_of(path))
        if module.partition(".")[0] in ("mcdem", "pbekit")
    }
    assert ours
    for module, name in ours:
        assert hasattr(pydoc.locate(module), name), f"{module}.{name}"


FACES = {"mcdem", "pbekit", "pbekit.atlas_figures"} | {
    f"{package}.{folder.name}"
    for package in ("mcdem", "pbekit")
    for folder in (NOTEBOOKS[0].parents[1] / package).iterdir()
    if (folder / "__init__.py").is_file() and folder.name != "commands"
}
"""What a notebook may import of: the packages, and pbekit's figures."""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_uses_public_names_alone(path):
    for node in ast.walk(ast.parse(code_of(path))):
        if isinstance(node, ast.Import):
            named = {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            named = {node.module or ""}
        else:
            continue
        ours = {name for name in named if name.partition(".")[0] in ("mcdem", "pbekit")}
        assert ours <= FACES, ours - FACES
