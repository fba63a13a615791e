"""Named tuples that parts of kernels take by reference: one address in place of the numbers of every array.

Numba passes a named tuple as all of its numbers, some 150 for twenty arrays, and copies them all to read one. What
references save is in docs/decisions/house.md (2026-11-29).
"""

from __future__ import annotations

from typing import Any, TypeVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import lower_cast, lower_getattr_generic, models, register_model

_Class = TypeVar("_Class", bound=type)
_REFERRED: set[type] = set()


def by_reference(kind: _Class) -> _Class:
    """Have parts of kernels take named tuples of this class by reference.

    A part reads their fields by name; it can neither unpack nor return them.
    """
    _REFERRED.add(kind)
    return kind


class Reference(types.Type):
    """Numba's type of a named tuple in memory, which nothing changes while a part runs."""

    def __init__(self, kind: types.NamedTuple) -> None:
        self.kind = kind
        super().__init__(name=f"Reference({kind})")


def taken(kind: Any) -> Any:
    """Return the type as which a part takes an argument: a number written in the call is like any other."""
    plain = types.unliteral(kind)
    referred = isinstance(plain, types.NamedTuple) and plain.instance_class in _REFERRED
    return Reference(plain) if referred else plain


@register_model(Reference)
class _ReferenceModel(models.PrimitiveModel):
    def __init__(self, manager: Any, reference: Any) -> None:
        super().__init__(manager, reference, manager.lookup(reference.kind).get_data_type().as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):
    key = Reference

    def generic_resolve(self, reference: Any, name: str) -> Any:
        fields = reference.kind.fields
        return taken(reference.kind.types[fields.index(name)]) if name in fields else None


@lower_getattr_generic(Reference)
def _read_field(context: Any, builder: Any, reference: Any, place: Any, name: str) -> Any:
    index = reference.kind.fields.index(name)
    field, there = reference.kind.types[index], cgutils.gep_inbounds(builder, place, 0, index)
    if isinstance(taken(field), Reference):
        return there
    value = builder.load(there)
    value.set_metadata("tbaa", _constant(builder.module))
    return context.data_model_manager[field].from_data(builder, value)


def _constant(module: Any) -> Any:
    """LLVM's note that what is loaded is never written: kernels that write to arrays need not load it again."""
    zero, one = ir.Constant(ir.IntType(64), 0), ir.Constant(ir.IntType(64), 1)
    field = module.add_metadata(["field", module.add_metadata(["references"]), zero])
    return module.add_metadata([field, field, zero, one])


@lower_cast(types.NamedTuple, Reference)
def _refer(context: Any, builder: Any, given: Any, _: Any, value: Any) -> Any:
    """Store a named tuple on the stack, and return its address.

    An empty instruction of assembly passes the address on, so that LLVM does not see what it leads to: the place is
    written before, and constant after.
    """
    data = context.data_model_manager[given].as_data(builder, value)
    place = cgutils.alloca_once(builder, data.type)  # not within a loop
    builder.store(data, place)
    same = ir.FunctionType(place.type, [place.type])
    return builder.asm(same, "", "=r,0,~{memory}", [place], side_effect=True)
