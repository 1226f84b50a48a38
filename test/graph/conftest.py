"""A node of the tests beside those of the graph."""

from __future__ import annotations

import signal
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
from processes import DEADLINE, GRASP, end_nodes
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from grasp_ros.exact.integrator import compile_kernels


@pytest.fixture(scope="session", autouse=True)
def _kernels() -> None:
    """On disk before several processes, each with a deadline, would compile them at the same time."""
    compile_kernels()


@pytest.fixture
def launch() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts processes, and ends those that a failed test leaves behind: they would answer the next graph."""
    started: list[subprocess.Popen[str]] = []
    late: list[threading.Timer] = []

    def call(*command: str, **options: Any) -> subprocess.Popen[str]:
        started.append(subprocess.Popen(command, text=True, **options))
        late.append(threading.Timer(2 * DEADLINE, started[-1].kill))  # whoever reads its output waits for no end
        late[-1].start()
        return started[-1]

    yield call
    for timer in late:
        timer.cancel()
    for process in started:
        process.terminate()  # a clean end at first: what follows must not meet the processes of `grasp run`
        process.send_signal(signal.SIGCONT)
        try:
            process.wait(DEADLINE / 2)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(DEADLINE)


@pytest.fixture
def grasp_run(launch: Any, tmp_path: Path) -> Callable[..., subprocess.Popen[str]]:
    """Starts `grasp run ... -o run` in the directory of the test; what it says is to be read."""
    def call(*words: str) -> subprocess.Popen[str]:
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        return launch(*GRASP, "run", *words, "-o", "run", cwd=tmp_path, **streams)  # type: ignore[no-any-return]

    return call


@pytest.fixture
def context() -> Iterator[rclpy.Context]:
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    context.shutdown()


@pytest.fixture
def make(context: rclpy.Context) -> Iterator[Callable[..., Any]]:
    """Makes nodes of the package within this process, with some parameters, and ends them."""
    made: list[Any] = []

    def call(kind: Callable[..., Any], *names: str, **numbers: Any) -> Any:
        given = [Parameter(name, value=value) for name, value in numbers.items()]
        made.append(kind(*names, context=context, parameter_overrides=given))
        return made[-1]

    yield call
    end_nodes(*made)


@pytest.fixture
def executor(context: rclpy.Context) -> Iterator[SingleThreadedExecutor]:
    """For nodes of `make`."""
    executor = SingleThreadedExecutor(context=context)
    yield executor
    executor.shutdown()


@pytest.fixture
def node(context: rclpy.Context) -> Iterator[tuple[Any, SingleThreadedExecutor]]:
    peer = rclpy.create_node("peer", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(peer)
    yield peer, executor
    executor.shutdown()
    peer.destroy_node()
