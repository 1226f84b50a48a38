"""The fault injector of a drill, as the study speaks with it, and the domains in which drills take place."""

from __future__ import annotations

import json
import os
import socket
import subprocess
from collections.abc import Sequence
from typing import Any

from lab.drills import nodes

DOMAINS = range(130, 230)  # beside those that people choose


class Failed(Exception):  # noqa: N818 - a drill that could not take place
    """The graph of a drill did not even start."""


class Companion:
    """The process of the fault injector, for one drill after the other.

    A prefix of words before its command line takes it to another host.
    """

    def __init__(self, prefix: Sequence[str] = ()) -> None:
        self._process = subprocess.Popen(
            [*prefix, *nodes.command("fault_injector")],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, start_new_session=True,
        )
        self.pid = self._process.pid

    def ask(self, action: str, **words: Any) -> dict[str, Any]:
        """Let it do something; returns its answer. Failed: nobody reads what it would send, or it has ended."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"do": action, **words}) + "\n")
        self._process.stdin.flush()
        for line in self._process.stdout:
            if line.startswith("{"):  # Fast DDS writes there, too
                answer: dict[str, Any] = json.loads(line)
                if "failed" in answer:
                    raise Failed(answer["failed"])
                return answer
        raise Failed("the onlooker has ended")

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()


def free_domains() -> list[int]:
    """Domains in which nobody is at the moment: the ports of their first participants can be taken.

    Another study at the same time begins with others.
    """
    found = [domain for domain in DOMAINS if _free(7410 + 250 * domain)]
    first = os.getpid() % max(len(found), 1)
    return found[first:] + found[:first]


def _free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as endpoint:
        try:
            endpoint.bind(("", port))
        except OSError:
            return False
    return True
