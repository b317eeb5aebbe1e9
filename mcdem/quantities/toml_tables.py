"""A table of a scene file, and how it explains itself.

Each table is a frozen pydantic model: its fields are the keys, the docstring below a field says what the key means
(`mcdem describe` prints it), quantities are declared with the types of `mcdem.quantities.units`.  An absent table is `None`.
"""

from __future__ import annotations

import ast
import difflib
import inspect
import math
import sys
import types
import typing
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticUndefined

from mcdem.errors import SceneError
from mcdem.quantities.units import Quantity, shown

MOST_PROBLEMS = 20
"""Problems of one file that are listed."""
LONGEST_NAME = 60
"""Characters of a key, above which its neighbours are not sought."""

FROM_THE_OTHERS = math.nan
"""Marks the key of a table that follows from the other keys, until they are read."""


class _OneLine(type(BaseModel)):  # type: ignore[misc]  # pydantic's metaclass has no public name
    """Makes tables in Python answer a mistake as a file does: `SceneError`, a line a problem.

    Here and not in `__init__`, which pydantic would then call for every table within a table.
    """

    def __call__(cls, *arguments: Any, **values: Any) -> Any:
        try:
            return super().__call__(*arguments, **values)
        except ValidationError as problem:
            raise SceneError(explain(problem, cls, cls.__name__)) from None


if typing.TYPE_CHECKING:
    _Base = BaseModel
else:

    class _Base(BaseModel, metaclass=_OneLine):
        pass


class Table(_Base):
    """Base of every table: unknown keys are refused, nothing is coerced, nothing changes after loading."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Key(NamedTuple):
    """One documented key of a scene file."""

    table: str
    key: str
    expected: str
    default: str
    meaning: str


def keys(model: type[BaseModel], table: str = "") -> list[Key]:
    """Every key of a table and of the tables in it, in the order of declaration."""
    found: list[Key] = []
    meanings = _meanings(model)
    for name, field in model.model_fields.items():
        inner, optional = _table_type(field.annotation)
        if inner is not None:
            path = f"{table}.{name}".lstrip(".")
            meaning = (inner.__doc__ or "").strip().splitlines()[0]
            found.append(Key(path, "", "table", "absent" if optional else "", meaning))
            found += keys(inner, path)
            continue
        meaning = " ".join((field.description or meanings.get(name, "")).split())
        found.append(Key(table, name, _expected(field.annotation, field.metadata), _default(field), meaning))
    return found


def _meanings(model: type[BaseModel]) -> dict[str, str]:
    """The docstrings below the fields of a table.

    pydantic would read them whenever a table is defined, which takes longer than to define it.
    """
    found: dict[str, str] = {}
    for table in reversed(model.__mro__):
        if issubclass(table, Table):
            found |= _docstrings(table.__module__).get(table.__name__, {})
    return found


@cache
def _docstrings(module: str) -> dict[str, dict[str, str]]:
    """{class: {field: docstring below it}} of a module; empty where it has no source."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError, KeyError):
        return {}
    found: dict[str, dict[str, str]] = {}
    for made in (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)):
        fields = found.setdefault(made.name, {})
        for field, below in zip(made.body, made.body[1:]):
            if not isinstance(field, ast.AnnAssign) or not isinstance(field.target, ast.Name):
                continue
            if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                fields[field.target.id] = str(below.value.value)
    return found


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined:
        return "required"
    if field.default is None:
        return "none"
    if field.default != field.default:
        return "from the others"
    unit = next((mark.si for mark in _quantities(field.annotation, field.metadata)), "")
    return _toml(f"{field.default:g} {unit}" if unit else field.default)


def written(model: BaseModel) -> dict[str, Any]:
    """The tables that would be read as `model`: SI values with their units, without what is absent, default or follows."""
    tables: dict[str, Any] = {}
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if value is None or (name not in model.model_fields_set and not isinstance(value, BaseModel)):
            continue
        unit = next((mark.si for mark in _quantities(field.annotation, field.metadata)), "")
        if isinstance(value, BaseModel):
            tables[name] = written(value)
        else:
            tables[name] = _with_unit(value, unit)
    return tables


def _with_unit(value: Any, unit: str) -> Any:
    if isinstance(value, tuple):
        return [_with_unit(one, unit) for one in value]
    return f"{value!r} {unit}" if unit else value


def quantity_at(model: type[BaseModel], path: tuple[str, ...]) -> Quantity | None:
    """What the key at a path expects, None where it is no quantity, or unknown."""
    owner = _model_at(model, path[:-1])
    field = owner.model_fields.get(path[-1]) if owner else None
    if field is None or _table_type(field.annotation)[0] is not None:
        return None
    return next(iter(_quantities(field.annotation, field.metadata)), None)


def explain(
    error: ValidationError,
    model: type[BaseModel],
    source: str,
    offers: Mapping[tuple[str, str], str] = types.MappingProxyType({}),
) -> str:
    """One line a problem: file, table, key, value, what was expected and what to do.

    offers : (table, key) -> what may stand for it, where it is missing
    """
    every = error.errors(include_url=False, include_context=True)
    details = every[:MOST_PROBLEMS]
    unknown = [d for d in details if d["type"] == "extra_forbidden"]
    nearest = {_path(d): _nearest(model, d["loc"]) for d in unknown}
    lines = []
    for detail in details:
        # A misspelt key is reported once, not again as the missing key that it was meant to be.
        if detail["type"] == "missing" and any(
            _path(detail) == (*place[:-1], key) for place, key in nearest.items()
        ):
            continue
        offer = (
            offers.get((".".join(_path(detail)[:-1]), _path(detail)[-1]), "")
            if detail["type"] == "missing"
            else ""
        )
        lines.append(f"{source}: {_sentence(detail, model, nearest)}" + (f"; {offer}" if offer else ""))
    if len(every) > len(details):
        lines.append(f"{source}: and {len(every) - len(details)} more such problems")
    return "\n".join(lines)


def _sentence(
    detail: ErrorDetails, model: type[BaseModel], nearest: dict[tuple[str, ...], str | None]
) -> str:
    path = _path(detail)
    table, key = shown(".".join(path[:-1]))[1:-1], shown(path[-1])[1:-1] if path else ""
    where = f"[{table}] " if table else ""
    kind, given = detail["type"], detail["input"]
    owner = _model_at(model, path[:-1])
    if kind == "extra_forbidden":
        what = "table" if isinstance(given, dict) else "key"
        cure = f'did you mean "{nearest[path]}"?' if nearest[path] else ""
        known = ", ".join(owner.model_fields) if owner else ""
        return f'{where}unknown {what} "{key}"; {cure or f"known here: {known}"}'
    if kind == "missing":
        field = owner.model_fields.get(key) if owner else None
        if field is not None and _table_type(field.annotation)[0] is not None:
            return f"table [{'.'.join(path)}] is missing; `mcdem describe` lists its keys"
        expected = _expected(field.annotation, field.metadata) if field else "a value"
        return f'{where}key "{key}" is missing; expected {expected}'
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f'{where}"{key}" is a table; write [{".".join(path)}] and its keys below'
    if kind == "quantity":
        return f"{where}{key} = {_toml(given)} {detail['msg']}"
    if kind == "value_error":  # raised by a table's own validator, which names its keys
        whole = not path or not isinstance(given, str | int | float | bool | list | tuple)
        place = f"[{'.'.join(path)}] " if path else ""
        if not whole:
            place = f"{where}{key} = {_toml(given)}: "
        return f"{place}{str(detail['msg']).removeprefix('Value error, ')}"
    field = owner.model_fields.get(key) if owner else None
    expected = _expected(field.annotation, field.metadata) if field else str(detail["msg"])
    return f"{where}{key} = {_toml(given)}; expected {expected}"


def _path(detail: ErrorDetails) -> tuple[str, ...]:
    """The tables and the key of a problem; of an item of a list, `key[number]`."""
    found: list[str] = []
    for part in detail["loc"]:
        if isinstance(part, int) and found:
            found[-1] += f"[{part}]"
        else:
            found.append(str(part))
    return tuple(found)


def _nearest(model: type[BaseModel], loc: tuple[int | str, ...]) -> str | None:
    owner = _model_at(model, tuple(str(part) for part in loc[:-1]))
    if len(str(loc[-1])) > LONGEST_NAME:
        return None
    found = difflib.get_close_matches(str(loc[-1]), list(owner.model_fields) if owner else [], n=1)
    return found[0] if found else None


def _model_at(model: type[BaseModel], path: tuple[str, ...]) -> type[BaseModel] | None:
    for name in path:
        field = model.model_fields.get(name)
        inner = _table_type(field.annotation)[0] if field else None
        if inner is None:
            return None
        model = inner
    return model


def _table_type(annotation: Any) -> tuple[type[BaseModel] | None, bool]:
    """The table that an annotation `T` or `T | None` stands for, and whether it may be absent."""
    options = typing.get_args(annotation) if isinstance(annotation, types.UnionType) else (annotation,)
    options = typing.get_args(annotation) if typing.get_origin(annotation) is typing.Union else options
    tables = [o for o in options if isinstance(o, type) and issubclass(o, BaseModel)]
    return (tables[0] if tables else None), type(None) in options


def _quantities(annotation: Any, metadata: Iterable[Any] = ()) -> list[Quantity]:
    """The marks of `mcdem.quantities.units` on an annotation, inside `| None` too."""
    found = [mark for mark in metadata if isinstance(mark, Quantity)]
    for inner in typing.get_args(annotation):
        found += _quantities(inner, getattr(inner, "__metadata__", ()))
    return found


def _expected(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    marks = [part for mark in metadata for part in (mark.metadata if isinstance(mark, FieldInfo) else [mark])]
    signs = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
    ends = {n: getattr(m, n) for m in marks for n in signs if hasattr(m, n)}
    bounds = " and ".join(f"{signs[n]} {end}" for n, end in ends.items())
    if ends.keys() == {"ge", "le"}:
        bounds = f"from {ends['ge']} to {ends['le']}"
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return _expected(arguments[0], arguments[1:])
    if origin is tuple:
        return f"a list, each {_expected(arguments[0])}"
    if origin in (typing.Union, types.UnionType) and len(arguments) == 2 and type(None) in arguments:
        return _expected(next(option for option in arguments if option is not type(None)), marks)
    quantities = _quantities(annotation, marks)
    if quantities:
        return f"{quantities[0].kind} and {bounds}" if bounds else quantities[0].expected
    if origin is typing.Literal:
        return " or ".join(_toml(choice) for choice in arguments)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_expected(option) for option in arguments if option is not type(None))
    words = {int: "an integer", float: "a number", bool: "true or false", str: "text"}
    return f"{words.get(annotation, str(annotation))} {bounds}".rstrip()


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return shown(value)


def choices(menu: Mapping[str, Any], having: str) -> str:
    """The names of a menu whose members have a property, as they are written in a scene: '"a" or "b"'."""
    return " or ".join(f'"{name}"' for name, member in menu.items() if getattr(member, having))
