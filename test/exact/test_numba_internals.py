"""The kernel cache: what is damaged is compiled anew; and what is used of numba's inside is there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.datamodel import default_manager
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.types import BaseFunction

from grasp_ros.exact.compilation import jit, kernel_cache

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


OURS = "from grasp_ros.exact.compilation.jit import door\n@door\ndef twice(x):\n    return 2.0 * x\n"


def twice(x: float) -> float:
    """What is compiled here."""
    return 2.0 * x


@pytest.fixture
def cached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The file of `twice` in a cache of its own."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kernel_cache.cache_directory.cache_clear()
    jit.door(twice)(1.0)
    [path] = [path for path in tmp_path.rglob("*") if path.is_file()]
    yield path
    kernel_cache.cache_directory.cache_clear()


def answer(path: Path, content: bytes) -> tuple[float, bool]:
    """What the function answers, and whether it came from a file with this content."""
    path.write_bytes(content)
    kernel_cache.say_damaged.cache_clear()
    again: Any = jit.door(twice)
    return again(21.0), bool(again.stats.cache_hits)


def damaged(whole: bytes) -> list[bytes]:
    """Nothing, a part, more, other bytes, and the content with two bits flipped in many places."""
    found = [b"", whole[: len(whole) // 2], whole[:-1], whole + b"\0", os.urandom(len(whole)), b"\0" * len(whole)]
    for place in [*range(0, 64, 8), *range(64, len(whole), len(whole) // 40)]:
        flipped = bytearray(whole)
        flipped[place] ^= 0b101
        found.append(bytes(flipped))
    return found


def test_arrays_are_to_kernels_what_an_observer_takes_them_for() -> None:
    """`callback.block_of` writes them as numba has them in memory."""
    fields = default_manager[numba.typeof(np.zeros(3))]._fields
    assert fields == ("meminfo", "parent", "nitems", "itemsize", "data", "shape", "strides")


@pytest.mark.slow
def test_a_damaged_kernel_is_compiled_anew_and_says_so_once(cached: Path, caplog: pytest.LogCaptureFixture) -> None:
    whole = cached.read_bytes()
    caplog.clear()
    assert answer(cached, whole) == (42.0, True)
    assert not caplog.messages
    for content in damaged(whole):
        assert answer(cached, content) == (42.0, False)
        [said] = caplog.messages
        assert said.endswith("is damaged; kernels that cannot be loaded are compiled again")
        caplog.clear()
        assert answer(cached, cached.read_bytes()) == (42.0, True)  # it has been written again
        assert not caplog.messages


@pytest.mark.slow
def test_whoever_waits_for_the_compiler_is_told_once_and_a_quiet_command_says_nothing(tmp_path: Path) -> None:
    """Also in Python and where only a part has been compiled, as by the first fit."""
    script = tmp_path / "doors.py"
    script.write_text(
        "import sys\nfrom argparse import Namespace\nfrom grasp_ros.cli.output import set_level\n"
        "from grasp_ros.exact.compilation import jit\n\n@jit.door\ndef once(x: float) -> float:\n    return x\n\n"
        "@jit.door\ndef twice(x: float) -> float:\n    return 2.0 * x\n\n"
        "set_level(Namespace(quiet=len(sys.argv) > 1))\nprint(twice(once(1.0)))\n"
    )
    for words, said in (((), 1), (("-q",), 0)):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / f"cache{said}")}
        found = subprocess.run([sys.executable, script, *words], env=environment, capture_output=True, text=True,
                               check=True)
        assert (found.stdout, found.stderr.count("compiling kernels")) == ("2.0\n", said)
        again = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=True)
        assert again.stderr == ""


def test_a_file_that_cannot_be_rebuilt_is_compiled_anew(cached: Path) -> None:
    kernel_cache.write_checked(cached, b"no code at all")
    assert answer(cached, cached.read_bytes()) == (42.0, False)


def test_kernels_of_another_python_are_not_taken_for_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A graph would compile while its nodes wait for each other."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kernel_cache.cache_directory.cache_clear()
    (kernel_cache.cache_directory() / "a.advance.advance.0.nbc").touch()
    assert kernel_cache.kernels_on_disk()
    monkeypatch.setattr(sys.implementation, "cache_tag", "cpython-310")
    kernel_cache.cache_directory.cache_clear()
    assert not kernel_cache.kernels_on_disk()
    kernel_cache.cache_directory.cache_clear()


def test_kernels_that_cannot_be_kept_where_they_belong_are_kept_among_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    own = tmp_path / f"grasp_ros_{os.getuid()}"
    for mode, kept in ((0o700, 1), (0o777, 0)):  # where others can write is code of theirs
        own.mkdir(exist_ok=True)
        own.chmod(mode)
        for hits in (0, kept):
            kernel_cache.cache_directory.cache_clear()
            kernel_cache.say_compiling.cache_clear()
            again: Any = jit.door(twice)
            assert again(21.0) == 42.0
            assert bool(again.stats.cache_hits) == hits
            assert "file/grasp_ros cannot be written; NUMBA_CACHE_DIR names a dir" in "".join(caplog.messages) or hits
            caplog.clear()
        shutil.rmtree(own)
    kernel_cache.cache_directory.cache_clear()


def test_a_user_without_a_home_has_kernels_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a container, with a number for a user: it was a traceback."""
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    assert kernel_cache._base() == Path("/~/.cache/grasp_ros")  # which cannot be made: see the test above


@pytest.mark.slow
@pytest.mark.thorough
def test_processes_that_write_at_once_leave_whole_files(tmp_path: Path) -> None:
    (tmp_path / "ours.py").write_text(OURS)
    environment = {
        **os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path]), "NUMBA_CACHE_DIR": str(tmp_path / "c"),
    }
    command = [sys.executable, "-c", "import ours; print(ours.twice(21.0), len(ours.twice.stats.cache_hits))"]
    for hits in (0, 1):
        runs = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(4)]
        found = [run.communicate(timeout=60.0)[0].split() for run in runs]
        assert all(line[0] == "42.0" for line in found)
        assert not hits or [line[1] for line in found] == ["1"] * 4
        [path] = [path for path in (tmp_path / "c").rglob("*") if path.is_file()]
        kernel_cache.read_checked(path)


@pytest.mark.parametrize(("owner", "name"), [
    (JITCodeLibrary, "_finalize_final_module"), (JITCodeLibrary, "_optimize_final_module"),
    (CPUDispatcher, "compile"), (BaseFunction, "get_call_type"), (NullCache, "load_overload"),
    (NullCache, "save_overload"), (CompileResult, "_rebuild"), (CompileResult, "_reduce"),
    (cpu_target.target_context.codegen(), "_library_class"), (cpu_target.target_context.codegen(), "magic_tuple"),
    (cpu_target.target_context.codegen(), "set_env"),
    (numba.njit(twice), "_cache"), (numba.njit(twice), "targetctx"), (numba.njit(twice), "targetoptions"),
])
def test_numba_has_what_is_used_of_its_inside(owner: Any, name: str) -> None:
    assert hasattr(owner, name), (
        f"numba {numba.__version__} has moved it; used by grasp_ros/exact/compilation/numba_internals.py"
    )
