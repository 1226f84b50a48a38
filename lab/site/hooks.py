"""What `mkdocs build` calls: pages of the root, figures of the examples."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

from lab.site import examples

ROOT_PAGES = {"index.md": "README.md", "changelog.md": "CHANGELOG.md", "contributing.md": "CONTRIBUTING.md"}
ASSETS = ("LICENSE", "CITATION.cff")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what is not in `docs`."""
    for uri, name in ROOT_PAGES.items():
        files.append(File.generated(config, uri, content=_of_root(examples.ROOT / name)))
    for name in ASSETS:
        files.append(File.generated(config, f"{name}.txt", content=(examples.ROOT / name).read_bytes()))
    for page in [file for file in files if file.src_uri.endswith(".md") and file.abs_src_path]:
        for uri, content in _figures(Path(str(page.abs_src_path)), page.src_uri):
            files.append(File.generated(config, uri, content=content))
    return files


def _of_root(page: Path) -> str:
    """A page of the root, with links as they are within `docs`."""
    text = page.read_text(encoding="utf-8")
    for uri, name in ROOT_PAGES.items():
        text = text.replace(f"]({name}", f"]({uri}")
    for name in ASSETS:
        text = text.replace(f"]({name})", f"]({name}.txt)")
    return re.sub(r'(\]\(|src=")docs/', r"\1", text)


def _figures(page: Path, uri: str) -> Iterator[tuple[str, bytes]]:
    """Pictures that a page shows and its examples draw."""
    text = page.read_text(encoding="utf-8")
    drawn = [name for name in examples.PICTURE.findall(text) if not (page.parent / name).exists()]
    if not drawn:
        return
    with tempfile.TemporaryDirectory() as directory:
        for output in examples.run(page, Path(directory)):
            if not output.holds:
                raise PluginError(f"{uri} prints\n{output.said}\nand it is\n{output.printed}")
        for name in drawn:
            if (made := Path(directory) / name).is_file():
                yield str(Path(uri).parent / name), made.read_bytes()
