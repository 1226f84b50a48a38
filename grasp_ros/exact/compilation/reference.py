"""A record of arrays behind its address: kernels pass on one number, and load the fields that they use.

As a value a record of twenty arrays is 150 numbers. Each function that gets it takes them apart and puts them together,
which was half of what was compiled for an observer.
"""

from typing import Any

from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model


class Reference(types.Type):
    """The type of a record behind its address: a pointer to the numbers of a named tuple."""

    def __init__(self, record: Any) -> None:
        self.record = record
        super().__init__(f"Reference({record})")


@register_model(Reference)
class _Pointer(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Reference) -> None:
        super().__init__(manager, kind, manager.lookup(kind.record).get_data_type().as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):
    key = Reference

    def generic_resolve(self, reference: Reference, name: str) -> Any:
        return reference.record.types[reference.record.fields.index(name)]


@lower_getattr_generic(Reference)  # type: ignore[untyped-decorator]
def _field(_: Any, builder: Any, reference: Reference, address: Any, name: str) -> Any:
    return builder.load(cgutils.gep_inbounds(builder, address, 0, reference.record.fields.index(name)))
