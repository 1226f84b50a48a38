"""Several numbers at once: vectors that kernels load, combine and store, each operation one or two instructions.

The compiler turns written-out sums into vector instructions where it finds them; a `Vector` always. Each of
its numbers has the bits that it would have alone. A vector has eight numbers, or four: where a loop keeps ten sums,
eight of each are more than a processor with AVX2 has registers for.

Compilers may not fuse a product and a sum by themselves: bits would depend on what is compiled with what. `fma` and
`add_product` say so in the source: it is the same everywhere, half as long on a processor that can do it, and no less
exact.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import get_or_insert_function
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import lower_builtin, models, register_model

from grasp_ros.exact.compilation.jit import instruction
from grasp_ros.exact.records import Array, Lanes

WIDTH, HALF = 8, 4
INDEX, QUAD = ir.IntType(32), ir.VectorType(ir.DoubleType(), HALF)
ALIGNMENT = np.dtype(float).alignment  # of arrays: vectors lie anywhere in them


class Vector(types.Type):
    """The type of a vector in kernels."""

    def __init__(self, width: int) -> None:
        super().__init__(f"vector of {width}")
        self.width = width


KINDS, REAL = {width: Vector(width) for width in (WIDTH, HALF)}, types.float64


@register_model(Vector)
class VectorModel(models.PrimitiveModel):
    """What a vector is for the machine: registers of four numbers.

    One of eight must wait until numbers that were just written by fours have left for memory.
    """

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.ArrayType(QUAD, kind.width // HALF))


def _quads(builder: Any, kind: Any, value: Any, count: int) -> list[Any]:
    """The registers of a vector, or a number in each lane of as many."""
    if isinstance(kind, Vector):
        return [builder.extract_value(value, i) for i in range(count)]
    nothing = ir.Constant(QUAD, ir.Undefined)
    each = ir.Constant(ir.VectorType(INDEX, HALF), [0] * HALF)
    return [builder.shuffle_vector(builder.insert_element(nothing, value, INDEX(0)), nothing, each)] * count


def _vector(builder: Any, quads: Sequence[Any]) -> Any:
    found = ir.Constant(ir.ArrayType(QUAD, len(quads)), ir.Undefined)
    for i, quad in enumerate(quads):
        found = builder.insert_value(found, quad, i)
    return found


def _emit(instruction: Callable[..., Any]) -> Any:
    """Code of an operation on vectors, and on numbers in their place."""
    def code(_: Any, builder: Any, kinds: Any, values: Any) -> Any:
        count = kinds.return_type.width // HALF
        filled = (_quads(builder, kind, value, count) for kind, value in zip(kinds.args, values, strict=True))
        return _vector(builder, [instruction(builder, *quads) for quads in zip(*filled, strict=True)])

    return code


def _of_llvm(name: str) -> Callable[..., Any]:
    def instruction(builder: Any, *quads: Any) -> Any:
        kind = ir.FunctionType(QUAD, [QUAD] * len(quads))
        return builder.call(get_or_insert_function(builder.module, kind, f"llvm.{name}.v{HALF}f64"), quads)

    return instruction


def _addresses(context: Any, builder: Any, kinds: Any, values: Any, vector: Any) -> list[Any]:
    """Where in an array the registers of a vector begin."""
    data = builder.gep(context.make_array(kinds.args[0])(context, builder, values[0]).data, [values[1]])
    return [builder.bitcast(builder.gep(data, [INDEX(i)]), QUAD.as_pointer()) for i in range(0, vector.width, HALF)]


def _code_of_load(context: Any, builder: Any, kinds: Any, values: Any) -> Any:
    addresses = _addresses(context, builder, kinds, values, kinds.return_type)
    return _vector(builder, [builder.load(address, align=ALIGNMENT) for address in addresses])


def _code_of_store(context: Any, builder: Any, kinds: Any, values: Any) -> Any:
    for i, address in enumerate(_addresses(context, builder, kinds, values, kinds.args[2])):
        builder.store(builder.extract_value(values[2], i), address, align=ALIGNMENT)
    return context.get_dummy_value()


def _numbers(builder: Any, kind: Any, vector: Any) -> list[Any]:
    return [builder.extract_element(quad, INDEX(i))
            for quad in _quads(builder, kind, vector, kind.width // HALF) for i in range(HALF)]


def _code_of_highest(_: Any, builder: Any, kinds: Any, values: Any) -> Any:
    found = _numbers(builder, kinds.args[0], values[0])
    while len(found) > 1:  # in pairs: none waits for all before it
        found = [builder.select(builder.fcmp_ordered(">", a, b), a, b)
                 for a, b in zip(found[::2], found[1::2], strict=True)]
    return found[0]


def _code_of_numbers(context: Any, builder: Any, kinds: Any, values: Any) -> Any:
    return context.make_tuple(builder, kinds.return_type, _numbers(builder, kinds.args[0], values[0]))


def _code_of_sum(builder: Any, total: Any, vector: Any, factor: Any) -> Any:
    return _of_llvm("fma")(builder, vector, factor, total)


def _code_of_larger(builder: Any, first: Any, second: Any) -> Any:
    size = _of_llvm("fabs")
    return _of_llvm("maxnum")(builder, size(builder, first), size(builder, second))


def _vector_among(*kinds: Any) -> Any:
    return next(kind for kind in kinds if isinstance(kind, Vector))


@instruction(lambda _, a, b, c: (REAL(REAL, REAL, REAL), lambda _, builder, __, numbers: builder.fma(*numbers)))
def fma(a: float, b: float, c: float) -> float:
    """The sum of a product, a b, and c."""
    if not math.isfinite(a * b + c):
        return a * b + c
    exact = Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))
    return float(exact) if exact else a * b + c


@instruction(lambda _, array, index: (KINDS[WIDTH](array, types.intp), _code_of_load))
def load(array: Array, index: int) -> Array:
    """The eight numbers of an array (n,) from an index on."""
    return array[index : index + WIDTH].copy()


@instruction(lambda _, array, index: (KINDS[HALF](array, types.intp), _code_of_load))
def load_half(array: Array, index: int) -> Array:
    """The four numbers of an array (n,) from an index on."""
    return array[index : index + HALF].copy()


@instruction(lambda _, array, index, vector: (types.void(array, types.intp, vector), _code_of_store))
def store(array: Array, index: int, vector: Array) -> None:
    """Write a vector to an array (n,) from an index on."""
    array[index : index + len(vector)] = vector


@instruction(lambda _, number: (KINDS[WIDTH](REAL), _emit(lambda _, vector: vector)))
def spread(number: float) -> Array:
    """A vector of eight times one number."""
    return np.full(WIDTH, number)


@instruction(lambda _, number: (KINDS[HALF](REAL), _emit(lambda _, vector: vector)))
def spread_half(number: float) -> Array:
    """A vector of four times one number."""
    return np.full(HALF, number)


@instruction(lambda _, vector: (types.UniTuple(REAL, WIDTH)(vector), _code_of_numbers))
def numbers_of(vector: Array) -> Lanes:
    """The eight numbers of a vector."""
    return tuple(vector)


@instruction(lambda _, total, vector, factor: (
    _vector_among(total, vector, factor)(total, vector, factor), _emit(_code_of_sum)))
def add_product(total: Array, vector: Array, factor: float | Array) -> Array:
    """A total and the product of a vector with another one or a number, with one rounding."""
    return np.array([*map(fma, *np.broadcast_arrays(vector, factor, total))])


@instruction(lambda _, vector: (vector(vector), _emit(_of_llvm("fabs"))))
def sizes(vector: Array) -> Array:
    """The absolute numbers of a vector."""
    return abs(vector)


@instruction(lambda _, first, second: (first(first, second), _emit(_code_of_larger)))
def larger(first: Array, second: Array) -> Array:
    """The larger of two sizes, number by number."""
    return np.fmax(abs(first), abs(second))


@instruction(lambda _, vector: (REAL(vector), _code_of_highest))
def highest(vector: Array) -> float:
    """The highest number of a vector."""
    return float(np.fmax.reduce(vector))


for operation, name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):

    @infer_global(operation)
    class Kinds(ConcreteTemplate):
        """What the operator takes beside numbers."""

        cases = tuple(signature(kind, *pair) for kind in KINDS.values()
                      for pair in ((kind, kind), (kind, REAL), (REAL, kind)))

    for case in Kinds.cases:
        lower_builtin(operation, *case.args)(_emit(getattr(ir.IRBuilder, name)))
