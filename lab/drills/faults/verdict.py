"""From what a drill has left behind to a verdict on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

NOTICE_SECONDS = 2.0  # the promise
SLACK_SECONDS = 1.0  # for a machine on which two drills run at a time
LOST_SECONDS = 0.2  # of recording


class Verdict(Enum):
    """How a drill ended; the first that holds."""

    SKIPPED = "skipped"
    TRACEBACK = "traceback"
    LEFT = "left processes"
    HUNG = "hung"
    LOST = "lost data"
    WRONG = "wrong result"
    SILENT = "no message"
    NAME = "names another process"
    LATE = "noticed late"
    SURVIVED = "survived"
    SENTENCE = "ended with a message"

    @property
    def passes(self) -> bool:
        """Whether this is as it should be."""
        return self in (Verdict.SURVIVED, Verdict.SENTENCE, Verdict.SKIPPED)


@dataclass
class Evidence:
    """What is known of a drill once it is over.

    Attributes
    ----------
    said : str
        The last sentence that a user sees; empty: none.
    noticed : float, s
        From the accident to the first sentence or report; NaN: never.
    exits : dict of str to int
        Exit statuses by process.
    lost : float, s
        Wall time before the accident from which nothing is in the bag.
    went_on, hung : bool
    left, shared : int
        Processes, and files in /dev/shm, that are still there.
    blames_another : bool
        Whether the last sentence does not name the process that was hit.
    traceback : str
        Its last line.
    wrong : str
        Why what the bag holds is not the run.
    mute : bool
        Whether nobody could read a sentence: the terminal is gone.
    asked : bool
        Whether a user has ended the run: that takes as long as it takes to close it.
    nothing_to_keep : bool
        Whether the bag itself was taken away, or there was none.
    """

    said: str = ""
    noticed: float = float("nan")
    exits: dict[str, int] = field(default_factory=dict)
    lost: float = 0.0
    went_on: bool = False
    hung: bool = False
    left: int = 0
    shared: int = 0
    blames_another: bool = False
    traceback: str = ""
    wrong: str = ""
    mute: bool = False
    asked: bool = False
    nothing_to_keep: bool = False
    skipped: str = ""

    @property
    def verdict(self) -> Verdict:
        """The first that holds."""
        silent = not self.said and not self.mute
        found = {
            Verdict.SKIPPED: bool(self.skipped), Verdict.TRACEBACK: bool(self.traceback),
            Verdict.LEFT: self.left > 0, Verdict.HUNG: self.hung,
            Verdict.LOST: not self.nothing_to_keep and self.lost > LOST_SECONDS,
            Verdict.WRONG: bool(self.wrong), Verdict.SURVIVED: self.went_on, Verdict.SILENT: silent,
            Verdict.NAME: self.blames_another,
            Verdict.LATE: not (self.mute or self.asked) and not self.noticed <= NOTICE_SECONDS + SLACK_SECONDS,
        }
        return next((verdict for verdict, holds in found.items() if holds), Verdict.SENTENCE)
