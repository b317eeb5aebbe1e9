"""Every notebook runs to its end, and is stored without its output."""

import ast
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")


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


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    from docs.notebooks import keep

    monkeypatch.setenv("PYTHONPATH", str(path.parent.parent))
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=1200, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}}
    ).execute()
    keep(path, notebook)  # for the gallery of the manual
    assert any(
        output.output_type != "stream" for cell in notebook.cells for output in cell.get("outputs", [])
    )


FACES = {"mcdem", "pbekit", "pbekit.atlas_figures"} | {
    f"{package}.{folder.name}"
    for package in ("mcdem", "pbekit")
    for folder in (NOTEBOOKS[0].parents[1] / package).iterdir()
    if (folder / "__init__.py").is_file() and folder.name != "commands"
}
"""What a notebook may import of: the packages, and pbekit's figures."""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_uses_public_names_alone(path):
    source = "\n".join(
        cell.source.replace("%", "#", 1) if cell.source.startswith("%") else cell.source
        for cell in nbformat.read(path, as_version=4).cells
        if cell.cell_type == "code"
    )
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            named = {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            named = {node.module or ""}
        else:
            continue
        ours = {name for name in named if name.partition(".")[0] in ("mcdem", "pbekit")}
        assert ours <= FACES, ours - FACES
