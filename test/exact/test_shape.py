"""The automaton stays readable: few parameters, short functions, short files, names for indices."""

from __future__ import annotations

import ast
from pathlib import Path

import numba
import pytest
from numba.core.codegen import JITCodeLibrary

from grasp_ros import exact
from grasp_ros.exact.compilation import jit
from grasp_ros.exact.compilation.numba_internals import Part

PARAMETERS, BODY = 8, 40
DOORS = {"advance": 16}  # blocks of numbers, see its docstring
# The recurrences of `series` are written out for the compiler's vectors; a test by Picard iteration watches them.
ROOM = sorted(Path(exact.__file__).parent.rglob("*.py"))
FILES = [path for path in ROOM if path.name != "series.py"]
NAMED = {"work", "filled", "mode", "rows", "bodies", "given", "pairs", "y"}  # arrays whose indices have names


def functions(path: Path) -> list[ast.FunctionDef]:
    """All functions and methods of a file."""
    return [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)]


def body_lines(function: ast.FunctionDef) -> int:
    """Lines of a function behind its signature and docstring."""
    first = function.body[1] if ast.get_docstring(function) and len(function.body) > 1 else function.body[0]
    assert function.end_lineno is not None
    return function.end_lineno - first.lineno + 1


def literal_indices(path: Path) -> list[str]:
    """Subscripts like work[3] or out.filled[0]."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Subscript):
            name = node.value.attr if isinstance(node.value, ast.Attribute) else getattr(node.value, "id", "")
            index = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            if name in NAMED and any(isinstance(part, ast.Constant) for part in index):
                found.append(ast.unparse(node))
    return found


def test_the_search_sees_what_it_looks_for(tmp_path: Path) -> None:
    source = tmp_path / "long.py"
    source.write_text("def f(a):\n    '''Text.'''\n    out.work[3] += 1\n    y[0] = mode[a]\n    return a\n")
    assert body_lines(functions(source)[0]) == 3
    assert literal_indices(source) == ["out.work[3]", "y[0]"]


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_only_a_door_has_machine_code() -> None:
    """What doors call is compiled as a part of them; by itself it would cost a fifth of the time of compiling."""
    @jit.kernel
    def half(x: float) -> float:
        return 0.5 * x

    @jit.inlined
    def double(x: float) -> float:
        return 2.0 * x

    @jit.door
    def sum_of(x: float) -> float:
        return float(half(x) + double(x))

    for function, kind in ((half, Part), (double, Part), (sum_of, JITCodeLibrary)):
        function.compile("float64(float64)")
        [compiled] = function.overloads.values()
        assert type(compiled.library) is kind
        address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
        assert (address != 0) is (function is sum_of)
    assert sum_of(2.0) == 5.0


@pytest.mark.parametrize("path", ROOM, ids=lambda path: f"{path.parent.stem}.{path.stem}")
def test_functions_have_few_parameters(path: Path) -> None:
    for function in functions(path):
        arguments = function.args
        count = len(arguments.posonlyargs) + len(arguments.args) + len(arguments.kwonlyargs)
        assert count <= DOORS.get(function.name, PARAMETERS), function.name


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.stem}.{path.stem}")
def test_functions_are_small(path: Path) -> None:
    for function in functions(path):
        assert body_lines(function) <= BODY, function.name


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.stem}.{path.stem}")
def test_no_number_stands_for_an_index(path: Path) -> None:
    assert literal_indices(path) == []
