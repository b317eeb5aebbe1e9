"""Named tuples in compiled code by reference: what is passed is one pointer, not all the arrays within.

numba passes a tuple by its parts.  The bundles of an encounter hold some fifty arrays of nine words each, and to write and read
all these words in each call took more of the time to compile than what the functions do.  A `Bundle` is where they lie in memory.
It comes to be where `compilation` calls a function, and lives as long as that call: what a bundle holds is never changed
in its time, so that loads from it may be moved and made once.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_cast, lower_getattr_generic, models, register_model


class Bundle(types.Type):
    """A named tuple in memory.

    instance_class : class of the named tuple, as numba's own type of one has it
    """

    def __init__(self, tuple_type: types.NamedTuple) -> None:
        self.tuple_type = tuple_type
        super().__init__(f"bundle of {tuple_type}")

    @property
    def key(self) -> Any:
        return self.tuple_type

    @property
    def instance_class(self) -> type:
        found: type = self.tuple_type.instance_class
        return found

    def place_of(self, member: str) -> int:
        """Which of the members has this name; raises ValueError if none has."""
        place: int = self.tuple_type.fields.index(member)
        return place

    def member(self, place: int) -> types.Type:
        """Type of what compiled code gets for a member."""
        return bundled(self.tuple_type.types[place])


def bundled(kind: types.Type) -> types.Type:
    """How a value of this type is passed: named tuples by reference, all else as it is."""
    return Bundle(kind) if isinstance(kind, types.NamedTuple) else kind


register_model(Bundle)(models.OpaqueModel)


@infer_getattr
class _Members(AttributeTemplate):
    key = Bundle

    def generic_resolve(self, kind: Bundle, member: str) -> types.Type | None:
        return kind.member(kind.place_of(member)) if member in kind.tuple_type.fields else None


@lower_getattr_generic(Bundle)
def _member(context: Any, builder: Any, kind: Bundle, value: Any, member: str) -> Any:
    place = kind.place_of(member)
    stored = kind.tuple_type.types[place]
    layout = context.data_model_manager[kind.tuple_type].get_data_type()
    where = cgutils.gep_inbounds(builder, builder.bitcast(value, layout.as_pointer()), 0, place)
    if isinstance(stored, types.NamedTuple):
        return builder.bitcast(where, cgutils.voidptr_t)
    found = context.data_model_manager[stored].from_data(builder, _load(builder, where))
    return impl_ret_borrowed(context, builder, stored, found)


def _load(builder: Any, where: Any) -> Any:
    """What lies there, scalar by scalar, as memory that does not change."""
    kind = where.type.pointee
    if isinstance(kind, ir.LiteralStructType | ir.ArrayType):
        found = ir.Constant(kind, ir.Undefined)
        count = len(kind.elements) if isinstance(kind, ir.LiteralStructType) else kind.count
        for place in range(count):
            part = _load(builder, cgutils.gep_inbounds(builder, where, 0, place))
            found = builder.insert_value(found, part, place)
        return found
    loaded = builder.load(where)
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded


@lower_cast(types.NamedTuple, Bundle)
def _pack(context: Any, builder: Any, given: types.NamedTuple, wanted: Bundle, value: Any) -> Any:
    """Lay a named tuple down in the caller's frame."""
    data = context.data_model_manager[given].as_data(builder, value)
    return builder.bitcast(cgutils.alloca_once_value(builder, data), cgutils.voidptr_t)
