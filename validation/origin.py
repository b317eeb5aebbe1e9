"""What a case's numbers rest on, as one hash: the sources it reaches by imports, its input files, versions, mode and seed."""

from __future__ import annotations

import ast
import hashlib
import json
import platform
import subprocess
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import netCDF4

from validation.case import Case, Context, names

PACKAGES = ("mcdem", "pbekit", "validation")
LIBRARIES = ("numpy", "scipy", "numba")
ROOT = Path(__file__).parent.parent
WITHOUT_NUMBERS = {"validation.case"}
"""Sources that shape how a case is run and shown, not what it measures."""


@cache
def _source(module: str) -> Path | None:
    """File of a module of this project; None for other modules and for names that are no module."""
    if module.partition(".")[0] not in PACKAGES:
        return None
    path = ROOT.joinpath(*module.split("."))
    return next((p for p in (path.with_suffix(".py"), path / "__init__.py") if p.is_file()), None)


def _module(module: str, name: str) -> str:
    """Where a name that a package shows lies: in a module of its own, where its stub says, or in the package itself."""
    inner = f"{module}.{name}"
    if _source(inner):
        return inner
    shown = _shown(module)
    return _module(*shown[name]) if name in shown else module


@cache
def _shown(package: str) -> dict[str, tuple[str, str]]:
    """{name that the stub of a package shows: (module, name there)}; packages load these when they are first used."""
    path = _source(package)
    stub = path.with_suffix(".pyi") if path is not None else None
    if path is None or stub is None or not stub.is_file():
        return {}
    return {
        alias.asname or alias.name: (
            f"{package}.{node.module}" if node.level else str(node.module),
            alias.name,
        )
        for node in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }


@cache
def _named(path: Path) -> frozenset[str]:
    """Modules of this project that a file names in its imports, inside functions too, and by names of packages."""
    package = path.relative_to(ROOT).parent.parts
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found: set[str] = set()
    packages: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
            packages |= {alias.asname or alias.name: alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            start = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (start, node.module) if part)
            for alias in node.names:
                found.add(_module(module, alias.name))
                if alias.name != "*":
                    packages[alias.asname or alias.name] = f"{module}.{alias.name}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in packages:
            found.add(_module(packages[node.value.id], node.attr))
    return frozenset(name for name in found if _source(name) and name not in WITHOUT_NUMBERS)


def sources(module: str) -> list[Path]:
    """Every file of this project that a module reaches by imports, itself included."""
    reached, waiting = set(), [module]
    while waiting:
        path = _source(waiting.pop())
        if path is not None and path not in reached:
            reached.add(path)
            waiting += _named(path)
    return sorted(reached)


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "absent"


def key(case: Case, context: Context, label: str, argument: Any, broken: str | None) -> str:
    """Changes whenever the numbers of a part might."""
    rests_on = {
        "sources": {str(p.relative_to(ROOT)): _digest(p) for p in sources(names()[case.name])},
        "inputs": {str(p): _digest(p) for p in case.inputs(context)},
        "libraries": {name: version(name) for name in LIBRARIES},
        "python": platform.python_version(),
        "machine": platform.machine(),
        "quick": context.quick,
        "seed": context.seed,
        "part": [label, repr(argument)],
        "broken": broken,
    }
    return hashlib.sha256(json.dumps(rests_on, sort_keys=True).encode()).hexdigest()[:16]


def of_saved(path: Path) -> str:
    """A file of saved numbers by name, with the commit that brought it as it is, or what it says of its own origin."""
    found = _git("log", "-1", "--format=%h of %cs", "--", str(path))
    if found:
        return f"{path.name} (commit {found})"
    if path.suffix == ".nc" and path.is_file():
        with netCDF4.Dataset(path) as file:
            return f"{path.name} ({getattr(file, 'software', 'origin not stored')})"
    return path.name


def _git(*words: str) -> str:
    """What git says of this repository; empty where there is none."""
    try:
        asked = ["git", "-C", str(ROOT), *words]
        return subprocess.run(asked, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def of_this_version() -> str:
    """Version of the toolkit, with the commit where it is known."""
    commit = _git("describe", "--always", "--dirty", "--abbrev=9", "--exclude=*")
    return f"pbekit {version('pbekit')}" + (f", commit {commit}" if commit else "")


def on_this_machine() -> str:
    """Versions that can change a number."""
    return ", ".join(
        [
            *(f"{name} {version(name)}" for name in LIBRARIES),
            f"python {platform.python_version()}",
            platform.platform(),
        ]
    )
