"""What is refused. The command line and the nodes answer it in one line; all else that is raised is a fault of ours."""

from __future__ import annotations


class Refused(ValueError):  # noqa: N818 - it is what happens to the input, and no error of the package
    """Input that is refused: names what, its value and what is allowed."""
