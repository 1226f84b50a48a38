"""Tables as a notebook shows them."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # it imports this file
    from grasp_ros.scene.scene import Scene

LEFT_ALIGNED = "style='text-align:left'"


def table(rows: Iterable[tuple[str, str]]) -> str:
    """Names and texts, escaped; rows without a text are left out."""
    cells = "".join(f"<tr><th {LEFT_ALIGNED}>{escape(name)}</th><td {LEFT_ALIGNED}>{escape(text)}</td></tr>"
                    for name, text in rows if text)
    return f"<table>{cells}</table>"


def html_of_scene(scene: Scene) -> str:
    """What is said of it, every number of it with its unit, and every section without numbers."""
    rows = [("scene", f"{scene.name}: {scene.title}"), ("watch", scene.watch),
            *(("reading", text) for text in scene.readings), *(("warning", text) for text in scene.warnings)]
    for effect in scene.effects:
        own = scene.values[effect.section]
        rows += [(f"{effect.section}.{parameter.key}", f"{_shown(own[parameter.key])} {parameter.unit}")
                 for parameter in effect.parameters if parameter.key in own] or [(effect.section, effect.text)]
    return table(rows)


def _shown(value: Any) -> str:
    """A number, or how many of them a list has."""
    return f"{len(value)} numbers in" if isinstance(value, tuple) else f"{value:.10g}"
