"""All statements of the paper: observations P1 to P12, conclusions C1 to C3, running text T1 on."""

from __future__ import annotations

from lab.paper.observations import CONCLUSIONS, OBSERVATIONS
from lab.paper.running_text import RUNNING_TEXT

STATEMENTS = {each.key: each for each in (*OBSERVATIONS, *CONCLUSIONS, *RUNNING_TEXT)}
