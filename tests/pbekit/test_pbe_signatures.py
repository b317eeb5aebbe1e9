"""No function of the balance takes more than eight arguments by position; commands take options by name."""

import ast
from pathlib import Path

import pytest

FILES = sorted((Path(__file__).parents[2] / "pbekit").glob("**/*.py"))


@pytest.mark.parametrize("path", [p for p in FILES if p.name != "cli.py"], ids=lambda p: p.name)
def test_at_most_eight_positional_arguments(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            count = len(node.args.posonlyargs) + len(node.args.args)
            assert count <= 8, f"{path.name}: {node.name} takes {count}"
