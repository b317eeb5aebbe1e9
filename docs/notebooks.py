"""The notebooks, executed: the pages of the gallery.

They are stored without their output.  What they show is kept in `build/notebooks` under a name that changes with the notebook,
the committed data and the code of both packages.
"""

from __future__ import annotations

import ast
import hashlib
import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import nbformat

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "build/notebooks"
LONG = ("02", "05")
"""Numbers of the notebooks that take longest."""


def notebooks() -> list[Path]:
    """All of them, in the order of their numbers."""
    return sorted((ROOT / "notebooks").glob("*.ipynb"))


def code_of(text: str) -> str:
    """A program without its docstrings and comments, which no output shows."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [
                line
                for line in node.body
                if not (
                    isinstance(line, ast.Expr)
                    and isinstance(line.value, ast.Constant)
                    and isinstance(line.value.value, str)
                )
            ]
    return ast.dump(tree)


@cache
def _sources() -> str:
    """Changes with what any notebook rests on."""
    found = hashlib.sha256()
    for path in sorted(
        [*ROOT.glob("mcdem/**/*.py"), *ROOT.glob("pbekit/**/*.py"), *ROOT.glob("scenes/**/*.toml")]
    ):
        text = path.read_text(encoding="utf-8")
        found.update(
            f"{path.relative_to(ROOT).as_posix()} {code_of(text) if path.suffix == '.py' else text}".encode()
        )
    for path in sorted(ROOT.glob("notebooks/data/*")):
        found.update(f"{path.name} {path.stat().st_size}".encode())
    return found.hexdigest()


def kept(path: Path) -> Path:
    """Where a notebook with its output is kept."""
    name = hashlib.sha256(_sources().encode() + path.read_bytes()).hexdigest()[:12]
    return KEPT / f"{path.stem}-{name}.ipynb"


def run(path: Path) -> nbformat.NotebookNode:
    """The notebook, executed now; raises nbclient's CellExecutionError of a cell that fails."""
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(
        notebook, timeout=1200, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}}
    ).execute()
    return notebook


def executed(path: Path) -> Path:
    """The notebook with its output, executed unless it is kept."""
    place = kept(path)
    if not place.exists():
        print(f"notebook {path.name}", flush=True)
        keep(path, run(path))
    return place


def all_executed() -> dict[Path, Path]:
    """Every notebook and where it lies with its output; as many are executed at a time as there are processors, at most four."""
    # The longest first: begun last, one of them would keep one processor busy alone at the end.
    order = sorted(notebooks(), key=lambda path: path.stem[:2] not in LONG)
    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as pool:
        return dict(zip(order, pool.map(executed, order), strict=True))


def keep(path: Path, notebook: nbformat.NotebookNode) -> None:
    """Keep a notebook that was executed."""
    place = kept(path)
    place.parent.mkdir(parents=True, exist_ok=True)
    for old in place.parent.glob(f"{path.stem}-*.ipynb"):
        old.unlink()
    nbformat.write(notebook, place)
