"""`grasp study`: all studies in their order, and the packages that they need beside those of the package itself."""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

from grasp_ros.cli import study_accuracy, study_costs, study_graph, study_maps, study_proofs
from grasp_ros.cli.arguments import Command
from grasp_ros.physics.errors import Refused

# names of modules of the extra `study`
PACKAGES = ("gmpy2", "heyoka", "mpmath", "ruamel", "scipy", "sksundae", "xarray", "zarr")
STUDIES = (
    study_accuracy.add_accuracy, study_accuracy.add_advise, study_costs.add_loop, study_accuracy.add_prediction,
    study_accuracy.add_page, study_accuracy.add_speed, study_costs.add_effects, study_proofs.add_certificate,
    study_proofs.add_paper, study_proofs.add_hard, study_proofs.add_fuzz, study_proofs.add_doors,
    study_proofs.add_faults,
    study_graph.add_graph, study_graph.add_steering, study_graph.add_free_running,
    study_costs.add_recorder, study_maps.add_maps, study_maps.add_many,
)


def add_to(commands: Any) -> None:
    """Add `study` with all its subcommands."""
    study = commands.add_parser("study", help="measure, and print what was measured")
    studies = study.add_subparsers(required=True, metavar="study")
    for add in STUDIES:
        sub = add(studies)
        sub.set_defaults(command=partial(_with_packages, sub.get_default("command")))


def _with_packages(command: Command, options: argparse.Namespace) -> int:
    try:
        return command(options)
    except ModuleNotFoundError as error:
        if str(error.name).split(".")[0] not in PACKAGES:
            raise
        raise Refused(f"this study needs {error.name}; pip install 'grasp_ros[study]'") from None
