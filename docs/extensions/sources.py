"""Every source file of both packages as a page, and links between equations and the functions that compute them.

    {source}`mcdem.effects.jkr.force`       a link to that function; a name that is not there ends the build

On a page of the method, such a link belongs to the numbered equation above it.  The page of the source links back from
its function to the equation, and so does the function's entry in the reference.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer
from sphinx.util import logging

ROOT = Path(__file__).parents[2]
PACKAGES = ("mcdem", "pbekit")
LINKS = re.compile(r"\{source\}`([\w.]+)`")
LABELS = re.compile(r"^:label:\s*(\S+)", re.MULTILINE)
logger = logging.getLogger(__name__)


@cache
def modules() -> dict[str, Path]:
    """{dotted name: file} of every module."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = path
    return found


@cache
def lines_of(module: str) -> dict[str, int]:
    """{name within the module: line} of functions, classes, methods and what is assigned."""
    found: dict[str, int] = {}

    def walk(body: list[ast.stmt], prefix: str) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found[prefix + node.name] = node.lineno
                if isinstance(node, ast.ClassDef):
                    walk(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                    if isinstance(target, ast.Name):
                        found[prefix + target.id] = node.lineno

    walk(ast.parse(modules()[module].read_text(encoding="utf-8")).body, "")
    return found


def place_of(name: str) -> tuple[str, int] | None:
    """(module, line) of a dotted name; None if there is no such thing."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        module, inside = ".".join(parts[:k]), ".".join(parts[k:])
        if module in modules():
            if not inside:
                return module, 1
            line = lines_of(module).get(inside)
            return None if line is None else (module, line)
    return None


def page_of(module: str, line: int = 1) -> str:
    """The page of a module from the root of the manual, at a line."""
    return f"source/{module}.html" + (f"#L-{line}" if line > 1 else "")


@cache
def equations() -> dict[str, list[tuple[str, str]]]:
    """{dotted name: (page, label) of the equations that it computes}, as the pages of the method say."""
    found: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for page in sorted((ROOT / "docs/method").glob("*.md")):
        for label, name in links(page.read_text(encoding="utf-8")):
            if label and (page.stem, label) not in found[name]:
                found[name].append((page.stem, label))
    return dict(found)


def links(text: str) -> Iterator[tuple[str, str]]:
    """(label of the equation above it, or "", dotted name) of each link to a source."""
    label, marks = "", []
    marks += [(m.start(), "label", m[1]) for m in LABELS.finditer(text)]
    marks += [(m.start(), "source", m[1]) for m in LINKS.finditer(text)]
    for _, kind, value in sorted(marks):
        if kind == "label":
            label = value
        else:
            yield label, value


def source_role(name: str, raw: str, text: str, line: int, inliner: Any, *rest: Any) -> Any:
    """A link to the source of a function."""
    environment = inliner.document.settings.env
    place = place_of(text)
    short = ".".join(text.split(".")[-2:])
    if place is None:
        where = (environment.docname, line)
        logger.warning("no function, class or value %s in the sources", text, location=where)
        return [nodes.literal(text, short)], []
    up = "../" * environment.docname.count("/")
    link = nodes.reference(
        "", "", internal=False, refuri=up + page_of(*place), reftitle=text, classes=["source"]
    )
    link += nodes.literal(short, short)
    return [link], []


def linkcode_resolve(domain: str, info: dict[str, str]) -> str | None:
    """Where an object of the reference is written, from a page of the reference."""
    import importlib
    import inspect

    if not info["module"]:
        return None
    found: Any = importlib.import_module(info["module"])
    for part in info["fullname"].split("."):
        found = getattr(found, part, None)
    found = inspect.unwrap(getattr(found, "py_func", found)) if found is not None else None
    found = getattr(found, "fget", None) or getattr(found, "func", None) or found
    module, name = getattr(found, "__module__", None), getattr(found, "__qualname__", None)
    place = place_of(f"{module}.{name}") if module and name else None
    return "../" + page_of(*place) if place else None


def say_equations(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Add to a docstring which equations of the method its object computes."""
    origin = f"{getattr(obj, '__module__', '')}.{getattr(obj, '__qualname__', '')}"
    found = equations().get(origin, [])
    if found:
        lines += ["", "Method: " + ", ".join(f":eq:`{label}`" for _, label in found) + ".", ""]


def pages(app: Any) -> Iterator[tuple[str, dict[str, Any], str]]:
    """A page for each module."""
    formatter = HtmlFormatter(linenos="inline", lineanchors="L", anchorlinenos=True, wrapcode=True)
    numbers = app.env.domaindata["math"]["objects"]
    for module, path in modules().items():
        back = []
        for name, found in equations().items():
            place = place_of(name)
            if place and place[0] == module:
                for page, label in found:
                    number = number_of(app, page, label, numbers)
                    back.append(
                        f'<li><a href="#L-{place[1]}"><code>{name.removeprefix(module + ".")}</code></a>: '
                        f'<a href="../method/{page}.html#equation-{label}">Eq. ({number})</a></li>'
                    )
        body = [f"<h1><code>{module}</code></h1>", f"<p><code>{path.relative_to(ROOT)}</code></p>"]
        if back:
            body += [
                "<p>Equations of the method that are computed here:</p><ul>",
                *sorted(set(back)),
                "</ul>",
            ]
        body.append(highlight(path.read_text(encoding="utf-8"), PythonLexer(), formatter))
        yield f"source/{module}", {"title": module, "body": "\n".join(body), "parents": []}, "page.html"


def number_of(app: Any, page: str, label: str, numbers: Any) -> str:
    """The number of an equation as its page shows it."""
    docname = f"method/{page}"
    tails = app.env.toc_fignumbers.get(docname, {}).get("displaymath", {})
    for key in (f"equation-{label}", label):
        if key in tails:
            return ".".join(map(str, tails[key]))
    return str(numbers[label].eqno) if label in numbers else "?"


def setup(app: Any) -> dict[str, bool]:
    """Join it to Sphinx."""
    app.add_role("source", source_role)
    app.connect("html-collect-pages", pages)
    app.connect("autodoc-process-docstring", say_equations, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
