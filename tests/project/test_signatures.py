"""Bundles are passed, not exploded: how many positional parameters a function may have."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
MOST = 8
EXCEPTIONS = {
    # A parallel loop of numba takes no tuple that holds another, so that the level comes to it in pieces.
    ("mcdem/hydrodynamics/matrix_free.py", "pair_of"),
}


def functions():
    for package in ("mcdem", "pbekit"):
        for path in sorted((ROOT / package).rglob("*.py")):
            place = str(path.relative_to(ROOT))
            if "/commands/" in place:  # a command's options are its parameters
                continue
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                    given = [a.arg for a in [*node.args.posonlyargs, *node.args.args]]
                    yield place, node.name, [name for name in given if name not in ("self", "cls")]


def test_no_function_has_more_than_eight_positional_parameters():
    many = {(place, name) for place, name, given in functions() if len(given) > MOST}
    assert many == EXCEPTIONS, many ^ EXCEPTIONS
