"""How the kernels are compiled, and where their machine code is kept.

`NUMBA_DISABLE_JIT=1` in the environment runs the same source uncompiled.
"""

import gc
from collections.abc import Callable
from functools import cache, partial, wraps
from types import FunctionType
from typing import Any, TypeVar

import numba
import numpy as np
from llvmlite import ir
from numba.extending import intrinsic

from grasp_ros.exact.compilation.numba_internals import Kernel, KernelCache

# Off by default in numba: it makes vector instructions of neighbouring sums, which speeds sampled runs up by some
# percent, and never reorders one.
numba.config.SLP_VECTORIZE = 1

K = TypeVar("K", bound=Callable[..., Any])  # a kernel has the types of its source

COMPILED = not numba.config.DISABLE_JIT
DEEP_STACK = 70_000  # slots; more than half a megabyte


def whole(number: int) -> int:
    """An int64 in place of a literal: numba would compile a kernel anew for each literal integer."""
    return np.int64(number)  # type: ignore[return-value]


def kernel(function: K) -> K:
    """A function that kernels call, compiled as a part of each door that needs it.

    It may not make arrays: without them nothing counts references, which makes a kernel a quarter faster.
    """
    return _compiled(function, door=False, inline=False)


def inlined(function: K) -> K:
    """A kernel that becomes part of its callers.

    Handing over many arrays can cost as much as a short function.
    """
    return _compiled(function, door=False, inline=True)


def door(function: K) -> K:
    """A kernel that Python calls, or C by its address; its machine code is kept on disk, with all that it calls.

    Of the kernels that it calls nothing else is kept: they would be most of the files, and save time only where a door
    is compiled in a process that has not compiled its kernels for another one.
    """
    return _compiled(function, door=True)


def allocating(function: K) -> K:
    """A door that may make arrays."""
    return _compiled(function, door=True, counts=True)


def instruction(typing: Callable[..., Any]) -> Callable[[K], K]:
    """A function that kernels call as a few instructions; without compilation its Python body runs.

    `typing` is for `numba.extending.intrinsic`: from the types of the arguments to a signature, and to what emits code.
    """
    return lambda plain: intrinsic(typing) if COMPILED else plain


def code_of_call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Emit a call of the C function at an address, the first argument, with the others."""
    kinds = [context.get_value_type(kind) for kind in (signature.return_type, *signature.args[1:])]
    function = ir.FunctionType(kinds[0], kinds[1:])
    return builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])


def compiling(function: Callable[[], None]) -> Callable[[], None]:
    """A function that compiles kernels, with room on CPython's stack for all the compiler's frames.

    CPython asks the system for 16 kB more whenever a call does not fit, and gives it back when that call returns.
    Compiling makes millions of calls; where they go back and forth over such an edge, this took seconds. So did looking
    for garbage, again and again, among millions of objects that are none.
    """
    code = function.__code__.replace(co_stacksize=DEEP_STACK)
    deep = FunctionType(code, function.__globals__, function.__name__)

    @wraps(function)
    def compile_all() -> None:
        collects = gc.isenabled()
        gc.disable()
        try:
            deep()
        finally:
            if collects:
                gc.enable()

    return compile_all


def address_of_code(result: Any) -> int:
    """Where the machine code of one compilation of a door begins, for calls from C."""
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_cfunc_wrapper_name))


def _compiled(function: K, *, door: bool, counts: bool = False, inline: bool = False) -> K:
    """Every option is said for every kernel: numba would take what is not said from whoever calls it first."""
    found = numba.njit(
        error_model="numpy", nogil=True, _nrt=counts, forceinline=inline, no_cpython_wrapper=not door,
        no_cfunc_wrapper=not door,
    )(function)
    if COMPILED and door:
        found._cache = KernelCache(function)
    elif COMPILED:
        found.__class__, found.door = Kernel, cache(partial(_compiled, function, door=True))
    return found
