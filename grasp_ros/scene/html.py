"""Tables as a notebook shows them."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

from grasp_ros.scene.effects.base import Effect, Sections

LEFT_ALIGNED = "style='text-align:left'"


def table(rows: Iterable[tuple[str, str]]) -> str:
    """Names and texts, escaped; rows without a text are left out."""
    cells = "".join(f"<tr><th {LEFT_ALIGNED}>{escape(name)}</th><td {LEFT_ALIGNED}>{escape(text)}</td></tr>"
                    for name, text in rows if text)
    return f"<table>{cells}</table>"


def numbers_of(effects: Iterable[Effect], values: Sections) -> Iterable[tuple[str, str]]:
    """Every number of a scene with its unit, and every section without numbers."""
    for effect in effects:
        own = values[effect.section]
        for parameter in effect.parameters:
            if parameter.key in own:
                yield f"{effect.section}.{parameter.key}", f"{_shown(own[parameter.key])} {parameter.unit}"
        if not own:
            yield effect.section, effect.text


def _shown(value: Any) -> str:
    """A number, or how many of them a list has."""
    return f"{len(value)} numbers in" if isinstance(value, tuple) else f"{value:.10g}"
