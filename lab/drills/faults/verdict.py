"""From what a drill has left behind to a verdict on it."""

from __future__ import annotations

import math
import re
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
    """What is known of a drill once it is over."""

    said: str = ""  # what a user sees: the last sentence of a run that ended, the first of one that goes on; or none
    culprit: str = ""  # pattern of what that has to name, see `Drill`
    noticed: float = math.nan  # s, from the accident to the first sentence or report; NaN: never
    exits: dict[str, int] = field(default_factory=dict)  # exit statuses by process
    lost: float = 0.0  # s of wall time before the accident from which nothing is in the bag
    went_on: bool = False
    hung: bool = False
    left: int = 0  # processes that are still there
    shared: int = 0  # files in /dev/shm that are still there
    traceback: str = ""  # its last line
    wrong: str = ""  # why what the bag holds is not the run
    mute: bool = False  # nobody could read a sentence: the terminal is gone
    asked: bool = False  # a user has ended the run: that takes as long as it takes to close it
    nothing_to_keep: bool = False  # the bag itself was taken away, or there was none
    skipped: str = ""  # why the drill cannot be played here

    @property
    def verdict(self) -> Verdict:
        """The first that holds."""
        nothing_to_say = self.mute or (self.went_on and re.match(self.culprit, "") is not None)
        silent = not self.said and not nothing_to_say
        found = {
            Verdict.SKIPPED: bool(self.skipped), Verdict.TRACEBACK: bool(self.traceback),
            Verdict.LEFT: self.left > 0, Verdict.HUNG: self.hung,
            Verdict.LOST: not self.nothing_to_keep and self.lost > LOST_SECONDS,
            Verdict.WRONG: bool(self.wrong), Verdict.SILENT: silent,
            Verdict.NAME: not self.mute and not re.search(self.culprit, self.said), Verdict.SURVIVED: self.went_on,
            Verdict.LATE: not (self.mute or self.asked) and not self.noticed <= NOTICE_SECONDS + SLACK_SECONDS,
        }
        return next((verdict for verdict, holds in found.items() if holds), Verdict.SENTENCE)
