"""What several commands share."""

from __future__ import annotations

import argparse
from pathlib import Path

from grasp_ros.cli.arguments import add_output

STUDY_DIRECTORY = Path("runs") / "studies"


def add_study_directory(sub: argparse.ArgumentParser) -> None:
    """Where a study keeps what it has measured."""
    text = f"records, tables and figures; what is there is not measured again (default {STUDY_DIRECTORY})"
    add_output(sub, "DIRECTORY", text, STUDY_DIRECTORY)
