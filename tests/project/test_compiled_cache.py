"""Compiled code is kept for exactly the sources that it depends on."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import mcdem
from mcdem.compiled_cache import digest, imported, key_by_sources, sources

PACKAGE = Path(mcdem.__file__).parent

MADE_UP = {
    "__init__.py": "",
    "kernel.py": "from numba import njit\n\nfrom small.numbers import (\n    HALF,  # of it\n    TWICE,\n)\n"
    "from small.deep import inner\n\n@njit(cache=True)\ndef f(x):\n    return HALF * x\n",
    "numbers.py": "from typing import TYPE_CHECKING\n\nfrom .units import ONE\n\nif TYPE_CHECKING:\n"
    "    from small.report import Page\n\nHALF, TWICE = ONE / 2, 2 * ONE\n",
    "units.py": "ONE = 1.0\n",
    "deep/__init__.py": "",
    "deep/inner.py": "from ..units import ONE\n",
    "tuples.py": "from typing import NamedTuple\n\nfrom small import report\n\nclass T(NamedTuple):\n    x: float\n",
    "command.py": "def run():\n    from small.kernel import f\n\n    return f(1.0)\n",
    "report.py": "WORDS = 'numba is not imported here'\n",
}
COMPILED = {"kernel.py", "numbers.py", "units.py", "deep/__init__.py", "deep/inner.py", "tuples.py"}


@pytest.fixture
def package(tmp_path) -> Path:
    for name, text in MADE_UP.items():
        path = tmp_path / "small" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "small"


@pytest.mark.parametrize("name", MADE_UP)
def test_the_key_changes_with_what_compiled_code_depends_on_and_with_nothing_else(package, name):
    before = digest(package)
    path = package / name
    path.write_text(path.read_text() + "# edited\n")
    assert (digest(package) != before) == (name in COMPILED)


def test_a_folder_of_the_users_is_keyed_too(package, tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "numba", raising=False)  # as before it is loaded
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "scratch"))
    folder = key_by_sources(package)
    assert folder.parent == tmp_path / "scratch"
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder)
    assert key_by_sources(package) == folder  # as a worker that inherits it
    (package / "units.py").write_text("ONE = 2.0\n")
    assert key_by_sources(package).parent == tmp_path / "scratch" != folder
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert key_by_sources(package).parent == tmp_path / "cache" / "small"


def test_numba_takes_the_folder():
    program = "import mcdem, numba, os; print(numba.config.CACHE_DIR == os.environ['NUMBA_CACHE_DIR'])"
    environment = os.environ | {"PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == "True\n"


def test_of_mcdem_commands_and_figures_are_left_out():
    found = {str(path.relative_to(PACKAGE)) for path in sources(PACKAGE)}
    assert {"effects/jkr.py", "hydrodynamics/stokesian.py", "integrators/state.py"} <= found
    assert not [name for name in found if name.startswith(("commands/", "figures/"))]
    assert not found & {"monte_carlo/process.py", "monte_carlo/sweep.py", "figures/report.py"}


def test_no_import_is_overlooked():
    """The lines of imports against those that Python finds itself."""
    for path in PACKAGE.rglob("*.py"):
        inside = (PACKAGE.name, *path.relative_to(PACKAGE).parent.parts)
        text, wanted = path.read_text(), set()
        tree = ast.parse(text)
        for node in ast.walk(tree):  # what is imported for types alone does not count
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                node.body = [ast.Pass()]
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                start = ".".join(inside[: len(inside) - node.level + 1]) if node.level else ""
                module = ".".join(part for part in (start, node.module) if part)
                wanted |= {module} | {f"{module}.{alias.name}" for alias in node.names}
        assert wanted <= imported(text.encode(), path, PACKAGE), path


def test_files_of_an_effect_of_another_package_count(tmp_path, monkeypatch):
    (tmp_path / "own_force.py").write_text("EFFECT = None\n")
    info = tmp_path / "own_force-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-force\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text("[mcdem.effects]\nown = own_force:EFFECT\n")
    before = digest(PACKAGE)
    monkeypatch.syspath_prepend(tmp_path)
    with_it = digest(PACKAGE)
    (tmp_path / "own_force.py").write_text("EFFECT = ...\n")
    assert len({before, with_it, digest(PACKAGE)}) == 3
