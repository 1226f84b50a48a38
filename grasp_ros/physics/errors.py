"""Input that is refused, and what was meant. Command line and nodes print it in a line; another exception is a bug."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from traceback import FrameSummary, extract_tb

OTHERS = re.compile("/lib/python3[^/]*/(?!(site|dist)-packages/(?!(rclpy|numba)/))")  # of Python, rclpy, numba
LONGEST = 4000  # characters of a sentence
SHOWN = 12  # of many words that are allowed
ALIKE, TIE, MOST_MEANT = 0.65, 1e-9, 4  # of difflib; words that are as much alike are all named


def printable(text: str) -> str:
    """A text that does nothing to a terminal: control characters as their escapes, lines as they are."""
    return "".join(sign if sign.isprintable() or sign == "\n" else repr(sign)[1:-1] for sign in text)


def line_of(stack: Sequence[FrameSummary]) -> str:
    """The innermost line of a stack, "file, line n"; if possible not in Python's own library, rclpy or numba."""
    frame = next((frame for frame in reversed(stack) if not OTHERS.search(frame.filename)), stack[-1])
    return f"{frame.filename}, line {frame.lineno}"


def described(error: BaseException) -> str:
    """What went wrong in somebody else's code, and where: "ValueError: words, file, line n"."""
    try:
        words = " ".join(str(error).split())
    except Exception:  # its `__str__` is foreign code, too
        words = "without words"
    return ": ".join(filter(None, [type(error).__name__, words])) + f", {line_of(extract_tb(error.__traceback__))}"


class Refused(ValueError):  # noqa: N818 - it is what happens to the input, and no error of the package
    """Invalid input: the message names it, its value and what is allowed.

    The middle of a very long message is left out, and control characters are shown as escapes.
    """

    exit_status = 2

    def __init__(self, sentence: str) -> None:
        if len(sentence) > LONGEST:
            sentence = f"{sentence[: LONGEST // 2]} ... {sentence[-LONGEST // 2 :]}"
        super().__init__(printable(sentence))


class Failed(Refused):
    """What was accepted and has failed: nobody answers, a law of the user's gives no command."""

    exit_status = 1


def need(what: str, *packages: str) -> None:
    """Refuse, before any work, where packages are not installed."""
    from importlib.util import find_spec

    if missing := [name for name in packages if find_spec(name) is None]:
        pip = dict.fromkeys(_distribution(name) for name in missing)
        raise Refused(f"{what} needs {', '.join(missing)}; pip install {' '.join(pip)}")


def _distribution(name: str) -> str:
    """What brings a package."""
    if name.endswith(("_msgs", "_srvs")):
        return "ros-jazzy-common-interfaces"
    ros = name == "rclpy" or name.endswith("_interfaces")
    return "ros-jazzy-rclpy[fastrtps]" if ros else {"yaml": "PyYAML", "ruamel": "ruamel.yaml"}.get(name, name)


@contextmanager
def needing(what: str) -> Iterator[None]:
    """Refuse where a package turns out not to be installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        need(what, str(error.name).partition(".")[0])
        raise


def allowed(word: str, known: Collection[str], other: str = "") -> str:
    """The end of a refusal: the known word that is meant, or the first that are allowed, behind `other` words."""
    from difflib import SequenceMatcher, get_close_matches  # which what is right need not wait for

    close = get_close_matches(word, known, MOST_MEANT, ALIKE)
    alike = {name: SequenceMatcher(None, name, word).ratio() for name in close}
    best = [name for name in close if alike[name] >= alike[close[0]] - TIE]
    if best:
        return f"did you mean {' or '.join(sorted(best))}?"
    rest = f", ... {len(known)} in all" if len(known) > SHOWN else ""
    return f"allowed: {other}{', '.join(islice(known, SHOWN))}{rest}"
