"""Bundles are passed, not exploded: how many positional parameters a function may have; and who may go without types."""

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


COMPILED = {"njit", "overload", "intrinsic", "compiled", "separately_compiled"}


def untyped(source):
    """Functions without types of which numba compiles nothing; mypy lets them pass in files of compiled code."""
    tree = ast.parse(source)
    everything = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    calls = [mark for node in everything for mark in node.decorator_list if isinstance(mark, ast.Call)]
    # What `overload` is given is a name for compiled code alone.
    names = {a.id for mark in calls if ast.unparse(mark.func) == "overload" for a in mark.args}
    left = [tree]
    while left:
        for node in ast.iter_child_nodes(left.pop()):
            if isinstance(node, ast.FunctionDef):
                marks = {ast.unparse(mark).partition("(")[0] for mark in node.decorator_list}
                if marks & COMPILED or node.name in names:
                    continue
                given = [a for a in [*node.args.args, *node.args.kwonlyargs] if a.arg not in ("self", "cls")]
                if (node.returns is None and node.name != "__init__") or any(not a.annotation for a in given):
                    yield node.name
            left.append(node)


def test_only_compiled_functions_go_without_types():
    assert list(untyped("@njit\ndef f(x): pass\ndef g(x): pass\ndef h(x: int) -> None: pass")) == ["g"]
    found = {
        (str(path.relative_to(ROOT)), name)
        for package in ("mcdem", "pbekit")
        for path in (ROOT / package).rglob("*.py")
        for name in untyped(path.read_text(encoding="utf-8"))
    }
    assert not found, found
