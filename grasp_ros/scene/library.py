"""The scenes that come with the package."""

from __future__ import annotations

from grasp_ros import CONFIG


def names() -> list[str]:
    """Names of the scenes that come with the package, the paper's cases first."""
    found = [entry.name.removesuffix(".yaml") for entry in CONFIG.iterdir() if entry.name.endswith(".yaml")]
    return sorted(found, key=lambda name: (not name.startswith("case_"), name))


def text_of(name: str) -> str:
    """The file of one of them, as it was written."""
    return (CONFIG / f"{name}.yaml").read_text(encoding="utf-8")
