"""What CONTRIBUTING says is so: its places and names are there, and imports go the way that its list of folders says."""

from __future__ import annotations

import ast
import importlib
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SPANS = re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL))
PATHS = [span for span in SPANS if re.fullmatch(r"\.?[\w./-]+", span) and ("/" in span)]
NAMES = [span for span in SPANS if re.fullmatch(r"(mcdem|pbekit)(\.\w+)+", span)]


def test_the_places_are_there():
    linked = re.findall(r"\]\(([^)#]+)\)", TEXT)
    console = re.findall(r"\b(tests/\w+|\.ci/run)\b", TEXT)
    assert len(PATHS) > 40
    missing = [place for place in [*PATHS, *linked, *console] if not (ROOT / place).exists()]
    assert not missing


def test_the_names_are_there():
    assert len(NAMES) > 8
    for name in NAMES:
        parts = name.split(".")
        for k in range(len(parts), 0, -1):
            try:
                found = importlib.import_module(".".join(parts[:k]))
            except ModuleNotFoundError:
                continue
            break
        for part in parts[k:]:
            assert hasattr(found, part), name
            found = getattr(found, part)


@pytest.mark.parametrize(
    "name", ["PairForce", "ContactLaw", "Resistance", "Level", "Scheme", "EventSelection"]
)
def test_the_contracts_have_the_parts_that_are_listed(name):
    """The parts named in the row of a door are fields or methods of its contract."""
    (row,) = re.findall(rf"^\| .*\| `(mcdem[\w.]+\.{name})`: (.*?) \|", TEXT, re.MULTILINE)
    module, _, contract = row[0].rpartition(".")
    found = getattr(importlib.import_module(module), contract)
    listed = set(re.findall(r"`(\w+)`", row[1]))
    there = set(getattr(found, "__dataclass_fields__", {})) | {part for part in vars(found) if part[0] != "_"}
    assert listed and listed <= there, listed - there


@cache
def modules() -> dict[str, Path]:
    found = {}
    for package in ("mcdem", "pbekit"):
        for path in (ROOT / package).rglob("*.py"):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = path
    return found


@cache
def imports() -> dict[str, set[str]]:
    """{module: modules of these packages that it imports, in functions and for types too}"""
    every = modules()
    found: dict[str, set[str]] = {}
    for module, path in every.items():
        found[module] = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named: set[str] = set()
            if isinstance(node, ast.Import):
                named = {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inside = {f"{node.module}.{alias.name}" for alias in node.names}
                named = (inside & every.keys()) | ({node.module} if inside - every.keys() else set())
            found[module] |= (named & every.keys()) - {module}
    return found


def floors() -> dict[str, int]:
    """{folder or file: which row of the list it stands in}"""
    listed = TEXT[TEXT.index("| place |") : TEXT.index("The story of the method")]
    rows = [line.split("|")[1] for line in listed.splitlines()[2:] if line.startswith("|")]
    return {
        place: floor
        for floor, row in enumerate(rows)
        for place in re.findall(r"`((?:mcdem|pbekit)/[\w/.]+)`", row)
    }


def place_of(module: str) -> str:
    return "/".join(modules()[module].relative_to(ROOT).parts[:2])


def test_every_place_of_the_packages_is_in_the_list():
    unlisted = {place_of(module) for module in modules()} - floors().keys()
    assert {place.split("/")[1] for place in unlisted} == {"__init__.py", "__main__.py"}


def test_imports_go_up_the_list_only():
    floor, place = floors(), {module: place_of(module) for module in modules()}
    upwards = {
        (module, other)
        for module, named in imports().items()
        for other in named
        if module.split(".")[0] == other.split(".")[0]
        and floor.get(place[module], 99) < floor.get(place[other], -1)
    }
    assert upwards == set()


def test_no_two_files_import_each_other():
    """Nor go round in a circle: modules whose imports are all done can be taken away until none is left."""
    left = {module: set(named) for module, named in imports().items()}
    while done := [module for module, named in left.items() if not named]:
        for module in done:
            del left[module]
        for named in left.values():
            named -= set(done)
    assert not left
