"""All that rests on classes of numba that it may move: code of parts of a program, and the cache of machine code.

`test_numba_internals` names what is missing in another version of numba.
"""

import hashlib
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numba.core.types import BaseFunction

from grasp_ros.exact.compilation import kernel_cache


class Part(JITCodeLibrary):
    """The code of a function that others call, without machine code: theirs has a copy of it.

    Machine code of every function by itself would be a fifth of the time of compiling, and optimizing it as a whole, as
    the code of a door is, with all that is called, another fourth.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


class Kernel(CPUDispatcher):
    """A function that other kernels call; for Python it is compiled once more.

    A call from Python goes through a wrapper that unpacks the arguments, as large as many a kernel: without it
    compiling takes a sixth less. Nothing but a test calls such a function.
    """

    door: Callable[[], Any]

    def compile(self, signature: Any) -> Any:
        """Compile for arguments of some types."""
        with global_compiler_lock, _parts(self):
            return super().compile(signature)

    def __call__(self, *arguments: Any) -> Any:
        """What the function returns."""
        return self.door()(*arguments)


@contextmanager
def _parts(dispatcher: CPUDispatcher) -> Iterator[None]:
    """Compile as `Part`, and remember the types of calls, in this thread, which must have numba's lock."""
    own, before_typing = vars(dispatcher.targetctx.codegen()), _FUNCTION.get_call_type
    before = own.copy()
    own.update(_library_class=Part, set_env=lambda *_: None)  # nothing to hand over to: there is no machine code
    _FUNCTION.get_call_type = _call_type
    try:
        yield
    finally:
        _FUNCTION.get_call_type = before_typing
        own.clear()
        own.update(before)


_FUNCTION: Any = BaseFunction
_ask, _known = BaseFunction.get_call_type, dict[Any, Any]()


def _call_type(function: BaseFunction, context: Any, arguments: Any, named: Any) -> Any:
    """Signature of a call of one of numba's functions, for some types of arguments.

    numba tries a dozen definitions for each product, and remembers nothing: an eighth of the time of compiling.
    """
    key = function, arguments, tuple(named.items())
    if key not in _known:
        _known[key] = _ask(function, context, arguments, named)
    return _known[key]


class KernelCache(NullCache):
    """Machine code of a function on disk: a file for each signature and machine, with its checksum.

    What is damaged is compiled anew. numba itself keeps an index beside the files, loads whatever is there, and two
    processes that write at once can leave an index that names the code of another machine.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        code, self._directory = function.__code__, kernel_cache.cache_directory()
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._key = code.co_filename, code.co_firstlineno, code.co_code, numba.__version__, llvmlite.__version__

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Machine code for arguments of some types; None if there is none."""
        target.refresh()
        try:
            content = kernel_cache.read_checked(self._path(signature, target.codegen()))
            return CompileResult._rebuild(target, *pickle.loads(content))
        except OSError:  # not there, or no directory that can be read
            kernel_cache.say_compiling()
        except Exception:
            kernel_cache.say_damaged()
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep machine code. It is a help, no need: a disk that is full only means to compile again."""
        with suppress(OSError):
            kernel_cache.write_checked(self._path(signature, result.codegen), dumps(result._reduce()))

    def _path(self, signature: Any, codegen: Any) -> Path:
        key = repr((signature, codegen.magic_tuple(), self._key)).encode()
        return self._directory / f"{self._name}.{hashlib.sha256(key).hexdigest()[:16]}.nbc"
