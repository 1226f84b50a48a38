"""`grasp scenes` and `new`: the scenes that there are, and one to start from."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.cli.arguments import add_command, add_force, add_json, add_settings, complete_scenes
from grasp_ros.cli.common import check_output, load_scene, show, write_text
from grasp_ros.scene.commented import commented
from grasp_ros.scene.files import YAML
from grasp_ros.scene.scene import text_of

DEFAULT = "case_01"


def add_to(commands: Any) -> None:
    """Add the subcommands."""
    sub = add_command(commands, "scenes", _scenes)
    complete_scenes(sub.add_argument("scene", nargs="?", help="print this one, as a file, with its comments"))
    add_json(sub)
    sub = add_command(commands, "new", _new)
    complete_scenes(sub.add_argument("--like", metavar="SCENE", default=DEFAULT,
                                     help=f"scene to copy (default {DEFAULT})"))
    add_settings(sub)
    sub.add_argument("file", metavar="FILE.yaml", type=Path,
                     help="new file, whose name is that of the scene; - is the standard output")
    add_force(sub)


def _scenes(options: argparse.Namespace) -> int:
    if options.scene is not None:
        scene = scenes.load(options.scene)
        packaged = options.scene in scenes.names()
        text = text_of(options.scene) if packaged else scene.to_yaml()
        show(options, text.rstrip("\n"), {"name": scene.name, "title": scene.title, "readings": scene.readings,
                                          "watch": scene.watch, **scene.values})
        return 0
    found = [scenes.load(name) for name in scenes.names()]
    width = max(len(scene.name) for scene in found)
    show(options, "\n".join(f"{scene.name:<{width}}  {scene.title}" for scene in found),
         [{"name": scene.name, "title": scene.title, "sections": list(scene.values)} for scene in found])
    return 0


def _new(options: argparse.Namespace) -> int:
    check_output(options.file, YAML, options.force)
    write_text(commented(load_scene(options.like, options.settings)), options.file)
    return 0
