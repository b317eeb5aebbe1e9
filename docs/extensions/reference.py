"""The reference, made from the programs themselves, so that it cannot differ from them.

public      every public name of a package, from its docstrings
commands    every subcommand of a program with its arguments and options
scene-keys  every key of a scene, from the models that read it
layout      every variable of a kind of dataset: group, dimensions, type, unit, meaning
"""

from __future__ import annotations

import ast
import importlib
import inspect
import itertools
import re
import typing
from collections.abc import Callable, Iterator
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective

from docs.extensions.docstrings import readable
from docs.extensions.sources import modules
from mcdem.quantities.units import Quantity

ROOT = Path(__file__).parents[2]


# -- Python ------------------------------------------------------------------------------------------------------------


def packages() -> list[str]:
    """Packages with a stub that lists their public names."""
    found = []
    for top in ("mcdem", "pbekit"):
        for stub in sorted((ROOT / top).rglob("__init__.pyi")):
            found.append(".".join(stub.parent.relative_to(ROOT).parts))
    return found


def public(package: str) -> list[str]:
    """The public names of a package, in the order of its stub."""
    stub = (ROOT / package.replace(".", "/") / "__init__.pyi").read_text(encoding="utf-8")
    return re.findall(r"^from \S+ import \w+ as (\w+)$", stub, re.MULTILINE)


def face_of(package: str, name: str) -> str:
    """The package under whose name an object is documented: the top one where that has it too."""
    top = package.partition(".")[0]
    if package != top and name in public(top):
        here, there = (getattr(importlib.import_module(p), name) for p in (package, top))
        if here is there:
            return top
    return package


def automatic(package: str, name: str) -> list[str]:
    """What Sphinx documents a name with."""
    found = getattr(importlib.import_module(package), name)
    if isinstance(found, type):
        kind = "exception" if issubclass(found, BaseException) else "class"
        lines = [f".. auto{kind}:: {package}.{name}"]
        if kind == "class":
            lines += ["    :members:", "    :exclude-members: model_config, model_post_init"]
        return [*lines, ""]
    if callable(found):
        return [f".. autofunction:: {package}.{name}", ""]
    said = [f"    {line}" for line in said_below(package, name)]
    return [f".. py:data:: {name}", f"    :module: {package}", "", *said, ""]


def said_below(package: str, name: str) -> list[str]:
    """The docstring below a constant where it is assigned, and its value."""
    value = getattr(importlib.import_module(package), name)
    stub = (ROOT / package.replace(".", "/") / "__init__.pyi").read_text(encoding="utf-8")
    (origin,) = re.findall(rf"^from \.(\S+) import {name} as {name}$", stub, re.MULTILINE)
    path = modules()[f"{package}.{origin}"]
    body = ast.parse(path.read_text(encoding="utf-8")).body
    said = ""
    for node, after in itertools.pairwise(body):
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if any(isinstance(target, ast.Name) and target.id == name for target in targets):
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                said = inspect.cleandoc(str(after.value.value))
    shown = [f"- ``{k}``: {v}" for k, v in value.items()] if isinstance(value, dict) else [f"``{value!r}``"]
    if isinstance(value, Quantity):
        shown = [f"{value.kind}, such as {value.example}".capitalize() + f"; in SI {value.si or 'a number'}."]
    return [*readable(said.splitlines()), "", *shown]


class Public(SphinxDirective):
    """`.. public:: PACKAGE`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        package = self.arguments[0]
        lines, elsewhere = [], []
        for name in public(package):
            face = face_of(package, name)
            if face != package:
                elsewhere.append(f":py:obj:`{face}.{name}`")
            else:
                lines += automatic(package, name)
        if elsewhere:
            lines = [f"Also here: {', '.join(elsewhere)}.", "", *lines]
        self.env.note_dependency(str(ROOT / package.replace(".", "/") / "__init__.pyi"))
        holder = nodes.container()
        self.state.nested_parse(StringList(lines, source=f"public names of {package}"), 0, holder)
        return holder.children


# -- commands ----------------------------------------------------------------------------------------------------------


class Parameter(NamedTuple):
    """An argument or option of a command."""

    name: str
    written: str
    meaning: str
    bounds: str
    default: str
    is_argument: bool


def commands(program: str) -> dict[str, Callable[..., Any]]:
    """{name: function} of the subcommands of a program, in the order of its help."""
    app = importlib.import_module(f"{program}.commands.main").app
    return {
        command.name or command.callback.__name__.replace("_", "-"): command.callback
        for command in app.registered_commands
        if not command.hidden
    }


def parameters_of(function: Callable[..., Any]) -> list[Parameter]:
    """What a command takes, from its annotations, as typer reads them."""
    hints = typing.get_type_hints(function, include_extras=True)
    found = []
    for name, given in inspect.signature(function).parameters.items():
        kind, *marks = typing.get_args(hints[name])
        (mark,) = (m for m in marks if hasattr(m, "help"))
        inner = [t for t in typing.get_args(kind) if t is not type(None)] or [kind]
        several = any(typing.get_origin(t) is list for t in (kind, *inner))
        plain = inner[0] if not several else (typing.get_args(inner[0]) or inner)[0]
        is_argument = type(mark).__name__ == "ArgumentInfo"
        metavar = mark.metavar or ""
        if not metavar and isinstance(plain, type) and issubclass(plain, Enum):
            metavar = "|".join(member.value for member in plain)
        metavar = metavar or {int: "INTEGER", float: "NUMBER", bool: ""}.get(plain, "TEXT")
        if is_argument:
            written = (mark.metavar or name.upper()) + ("..." if several else "")
        else:
            # Within Annotated the first name stands where a default would.
            names = [n for n in (mark.default, *(mark.param_decls or ())) if isinstance(n, str)]
            names = names or [f"--{name.replace('_', '-')}"]
            if plain is bool and len(names) == 1 and not mark.default:
                names = [f"--{name.replace('_', '-')} / --no-{name.replace('_', '-')}"]
            written = ", ".join(sorted(names, key=len, reverse=True)) + (
                f" {metavar}" if plain is not bool else ""
            )
        low, high = mark.min, mark.max if mark.max is None or mark.max < 1e15 else None
        bounds = (
            ""
            if low is None and high is None
            else f"from {low:g}"
            if high is None
            else f"{low:g} to {high:g}"
        )
        default = given.default
        if default is inspect.Parameter.empty:
            default = "required"
        elif default in (None, False, (), []):
            default = ""
        else:
            default = f"default {getattr(default, 'value', default)}"
        found.append(Parameter(name, written, mark.help or "", bounds, default, is_argument))
    return found


class Commands(SphinxDirective):
    """`.. commands:: PROGRAM`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        program = self.arguments[0]
        sections: list[nodes.Node] = []
        for name, function in commands(program).items():
            title = f"{program} {name}"
            section = nodes.section(ids=[nodes.make_id(title)], names=[nodes.fully_normalize_name(title)])
            section += nodes.title("", "", nodes.literal(title, title))
            parameters = parameters_of(function)
            usage = " ".join([program, name, *(p.written for p in parameters if p.is_argument), "[OPTIONS]"])
            section += nodes.literal_block(usage, usage, language="console")
            for paragraph in re.split(r"\n\s*\n", inspect.getdoc(function) or ""):
                section += worded(paragraph)
            entries = nodes.definition_list(classes=["options"])
            for parameter in parameters:
                term = nodes.term("", "", nodes.literal(parameter.written, parameter.written))
                if about := "; ".join(filter(None, (parameter.bounds, parameter.default))):
                    term += nodes.inline("", f"  {about}", classes=["default"])
                entries += nodes.definition_list_item(
                    "", term, nodes.definition("", worded(parameter.meaning))
                )
            section += entries
            sections.append(section)
        return sections


def worded(text: str) -> nodes.paragraph:
    """A paragraph in which what stands in backticks is code."""
    paragraph = nodes.paragraph()
    for k, part in enumerate(re.split(r"`([^`]+)`", " ".join(text.split()))):
        if part:
            paragraph += nodes.literal(part, part) if k % 2 else nodes.Text(part)
    return paragraph


# -- scene -------------------------------------------------------------------------------------------------------------


class SceneKeys(SphinxDirective):
    """`.. scene-keys::`."""

    def run(self) -> list[nodes.Node]:
        from mcdem.scene import describe

        sections: list[nodes.Node] = []
        entries = nodes.definition_list()
        for key in describe():
            if not key.key:
                name = f"[{key.table}]"
                section = nodes.section(
                    ids=[f"table-{nodes.make_id(key.table.replace('_', '-'))}"], names=[name]
                )
                section += nodes.title("", "", nodes.literal(name, name))
                section += worded(key.meaning + ("" if key.default == "" else "  May be left out."))
                entries = nodes.definition_list(classes=["options"])
                section += entries
                sections.append(section)
                continue
            dotted = f"{key.table}.{key.key}"
            term = nodes.term("", "", nodes.literal(key.key, key.key), ids=[f"key-{nodes.make_id(dotted)}"])
            default = key.default if key.default == "required" else f"default {key.default}"
            term += nodes.inline("", f"  {default}", classes=["default"])
            meaning = nodes.definition("", worded(key.meaning), worded(f"Expects {key.expected}."))
            entries += nodes.definition_list_item("", term, meaning)
        return [section for section in sections if section.children[-1].children or len(section.children) > 1]


# -- datasets ----------------------------------------------------------------------------------------------------------


def layout_of_file(path: Path) -> Iterator[tuple[str, str, str, str, str, str]]:
    """(group, variable, dimensions, type, unit, meaning) of each variable in a NetCDF file."""
    import netCDF4

    def walk(group: Any, name: str) -> Iterator[tuple[str, str, str, str, str, str]]:
        for key, variable in group.variables.items():
            about = {a: variable.getncattr(a) for a in variable.ncattrs()}
            yield (
                name or "/", key, ", ".join(variable.dimensions), str(variable.dtype),
                str(about.get("units", "")), str(about.get("long_name", "")),
            )  # fmt: skip
        for key, inner in group.groups.items():
            yield from walk(inner, f"{name}/{key}")

    with netCDF4.Dataset(path) as data:
        yield from walk(data, "")


def layout_of_runs() -> Iterator[tuple[str, str, str, str, str, str]]:
    """The same of the dataset of a run, by what writes it."""
    from mcdem.monte_carlo import record

    groups = (
        ("/", "time", record.SERIES),
        ("/events", "event", record.EVENTS),
        ("/events", "product", record.PRODUCTS),
        ("/snapshots", "snapshot", record.SNAPSHOTS),
        ("/snapshots", "aggregate", record.AGGREGATES),
        ("/snapshots", "primary", record.PRIMARIES | record.RADII),
        ("/snapshots", "contact", record.BONDS | record.SPRINGS),
        ("/kept", "kept", record.KEPT),
        ("/kept", "aggregate", record.AGGREGATES),
        ("/kept", "primary", record.PRIMARIES | record.RADII),
        ("/kept", "contact", record.BONDS | record.SPRINGS),
    )
    for group, row, variables in groups:
        for name, variable in variables.items():
            characters = [f"{name}_length"] if variable.dtype.startswith("S") else []
            dims = ", ".join([row, *(d for d, _ in variable.shape), *characters])
            meaning = variable.long_name
            if flags := dict(variable.attributes).get("flag_meanings"):
                meaning += ": " + ", ".join(f"{k} {word}" for k, word in enumerate(str(flags).split()))
            yield group, name, dims, variable.dtype, variable.units, meaning


def layout_of_trajectories() -> Iterator[tuple[str, str, str, str, str, str]]:
    """The same of the trajectory of an encounter, from one that is written."""
    import tempfile

    import numpy as np

    from mcdem.encounter import trajectory

    bonded = np.array([[np.nan, 0.0], [0.0, np.nan]])
    one = trajectory.Trajectory(
        radius=5e-7,
        shear_rate=1e4,
        pull_off_force=1e-8,
        time=np.array([0.0, 1e-6]),
        positions=np.array([[[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0]]] * 2),
        tension=np.array([bonded, bonded]),
        parent=np.array([0, 1]),
    )
    with tempfile.TemporaryDirectory() as folder:
        trajectory.write(one, Path(folder) / "one.nc")
        yield from layout_of_file(Path(folder) / "one.nc")


def layout(what: str) -> list[tuple[str, str, str, str, str, str]]:
    """The variables of a kind of dataset."""
    if what == "runs":
        return list(layout_of_runs())
    if what == "trajectories":
        return list(layout_of_trajectories())
    return list(layout_of_file(ROOT / what))


class Layout(SphinxDirective):
    """`.. layout:: runs`, `.. layout:: trajectories` or `.. layout:: FILE`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        found: list[nodes.Node] = []
        rows = layout(self.arguments[0])
        for group in dict.fromkeys(row[0] for row in rows):
            found.append(nodes.paragraph("", "", nodes.strong("", "Group "), nodes.literal(group, group)))
            inside = [row[1:] for row in rows if row[0] == group]
            found.append(
                nodes.container(
                    "", table(("variable", "dimensions", "type", "unit", "meaning"), inside), classes=["wide"]
                )
            )
        return found


def table(heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> nodes.table:
    """A table whose first column is code."""
    group = nodes.tgroup(cols=len(heads))
    for _ in heads:
        group += nodes.colspec(colwidth=1)
    group += nodes.thead("", nodes.row("", *(nodes.entry("", nodes.paragraph("", head)) for head in heads)))
    body = nodes.tbody()
    for row in rows:
        first = nodes.entry("", nodes.paragraph("", "", nodes.literal(row[0], row[0])))
        body += nodes.row("", first, *(nodes.entry("", nodes.paragraph("", cell)) for cell in row[1:]))
    group += body
    return nodes.table("", group)


def setup(app: Any) -> dict[str, bool]:
    """Join it to Sphinx."""
    app.add_directive("public", Public)
    app.add_directive("commands", Commands)
    app.add_directive("scene-keys", SceneKeys)
    app.add_directive("layout", Layout)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
