"""What is one of a menu is one file: who of the packages names each effect, contact law, level and scheme."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from mcdem.effects import EFFECTS
from mcdem.hydrodynamics import LEVELS
from mcdem.integrators import MENU, SCHEMES

ROOT = Path(__file__).parents[2]
OLD_NAMES = "renamed_keys.py"
"""What earlier names are called now, which is not to name a member."""
FILES = sorted(
    path
    for package in ("mcdem", "pbekit")
    for path in (ROOT / package).rglob("*.py")
    if path.name != OLD_NAMES
)
MOST = 3
"""Files that may name a member: its own, the menu, and one more."""
ENGLISH = {"born", "steric", "sliding", "rolling", "twisting", "rods", "implicit"}
"""Names that are words too: an identifier of that name need not be the member, a string is none within a sentence."""
SENTENCE = re.compile(r"[a-z]+ [a-z]+")

MEMBERS = {
    **{name: {effect.table.__name__, effect.kernel.__name__} for name, effect in EFFECTS.items()},
    **{name: {level.parameters.__name__} for name, level in LEVELS.items()},
    **{name: {scheme.options.__name__} for name, scheme in SCHEMES.items()},
}
"""{name in a scene: its classes}"""
MODULES = {name: MENU.get(name, name) for name in MEMBERS}


def prose(tree: ast.AST) -> set[int]:
    """Constants that are docstrings: strings that stand alone."""
    return {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}


def words(tree: ast.AST):
    """(kind, text) of every string that is no docstring, every identifier and every part of an imported module."""
    docstrings = prose(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield "string", node.value
        elif isinstance(node, ast.Name):
            yield "identifier", node.id
        elif isinstance(node, ast.Attribute):
            of_effects = ast.unparse(node.value).endswith(("effects", "numerics"))
            yield "string" if of_effects else "identifier", node.attr
        elif isinstance(node, ast.ImportFrom | ast.Import):
            for part in [*(getattr(node, "module", None) or "").split("."), *(a.name for a in node.names)]:
                yield "module", part
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield "identifier", node.name


def names_it(name: str, kind: str, text: str) -> bool:
    """Whether a word of a file is the member of this name."""
    if kind == "module":
        return text in {name, MODULES[name]} | MEMBERS[name]
    if kind == "identifier":
        part = re.search(rf"(^|_){name}(_|$)", text.lower())
        return text in MEMBERS[name] or (name not in ENGLISH and part is not None)
    if name in ENGLISH and SENTENCE.search(text):
        return f'"{name}"' in text or f"effects.{name}" in text
    return re.search(rf"\b{name}\b", text) is not None


def places(name: str) -> list[str]:
    """The files that name a member, its own among them."""
    own = [
        path
        for path in FILES
        if path.stem == MODULES[name] and path.parts[-2] in ("effects", "hydrodynamics", "integrators")
    ]
    assert len(own) == 1
    found = own + [
        path
        for path in FILES
        if path not in own
        and any(
            names_it(name, kind, text) for kind, text in words(ast.parse(path.read_text(encoding="utf-8")))
        )
    ]
    return [str(path.relative_to(ROOT)) for path in found]


@pytest.mark.parametrize("name", MEMBERS)
def test_a_member_of_a_menu_is_named_in_few_files(name):
    found = places(name)
    print(f"{name}: {len(found)} ({', '.join(found)})")
    assert len(found) <= MOST


def test_the_count_sees_every_way_to_name_a_member():
    seen = {
        'x = scene.effects.get("jkr")': "jkr",
        "x = scene.effects.jkr": "jkr",
        "from mcdem.effects.jkr import force": "jkr",
        "from mcdem.effects import jkr": "jkr",
        "x = JKRKernel(1.0)": "jkr",
        "def jkr_gap(): pass": "jkr",
        'y = {"effects.rods": None}': "rods",
        "x = scene.effects.rods": "rods",
        'y = f"use {a} or \\"implicit\\" with it"': "implicit",
        "from mcdem.integrators.implicit_midpoint import scratch": "implicit",
        'level = "fts"': "fts",
    }
    for source, name in seen.items():
        assert any(names_it(name, kind, text) for kind, text in words(ast.parse(source))), source
    for source, name in {
        '"""Of jkr."""': "jkr",
        "motion.born[i]": "born",
        'x = "how rods are born"': "rods",
    }.items():
        assert not any(names_it(name, kind, text) for kind, text in words(ast.parse(source))), source
