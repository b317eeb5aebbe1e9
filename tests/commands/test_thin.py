"""Commands are thin: what they find out, they find out by public functions of the packages."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from typer.main import get_command

import mcdem.commands.main
import pbekit.commands.main

ROOT = Path(__file__).parents[2]
FILES = sorted([*(ROOT / "mcdem/commands").glob("*.py"), *(ROOT / "pbekit/commands").glob("*.py")])
MOST = 40
"""Lines of the body of a function; its docstring, its imports and the declarations of its options do not count."""
NUMERICS = {"numpy", "scipy", "numba", "xarray", "matplotlib", "netCDF4", "csv"}


def bodies(source: str) -> dict[str, int]:
    """{function: lines of its body}"""
    found = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            lines = {
                number
                for statement in body
                if not isinstance(statement, ast.Import | ast.ImportFrom)
                for number in range(statement.lineno, (statement.end_lineno or 0) + 1)
                if source.splitlines()[number - 1].strip()
            }
            found[node.name] = len(lines)
    return found


def foreign(source: str) -> set[str]:
    """What a file imports of numerics, anywhere."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.split(".")[0])
    return names & NUMERICS


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_command_is_thin(path):
    source = path.read_text(encoding="utf-8")
    assert {name: lines for name, lines in bodies(source).items() if lines > MOST} == {}
    assert foreign(source) == set()


@pytest.mark.parametrize("program", [mcdem.commands.main, pbekit.commands.main], ids=["mcdem", "pbekit"])
def test_every_file_is_a_command_or_shared(program):
    """One subcommand a file, and named like it; what is no subcommand declares no option."""
    package = program.__name__.rpartition(".")[0]
    assert list(get_command(program.app).commands) == list(program.COMMANDS)
    for command in program.app.registered_commands:
        assert command.callback is not None
        assert command.callback.__module__ == f"{package}.{command.callback.__name__}"
    shared = {path.stem for path in FILES if path.parts[-3] == package.split(".")[0]} - set(program.COMMANDS)
    assert shared <= {"__init__", "main", "paired"}


def test_the_rule_sees_long_functions_and_numerics():
    long = 'def f(a: int):\n    """Says."""\n    import a\n' + "    x = 1\n\n" * 41
    assert bodies(long) == {"f": 41}
    assert foreign("def f():\n    from numpy.linalg import solve") == {"numpy"}
