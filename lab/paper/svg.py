"""SVG files as short as the eye allows: paths without the points that nobody sees, and images without base64."""

from __future__ import annotations

import re
from urllib.parse import quote

import numpy as np

from grasp_ros.physics.model import Array

TOLERANCE = 0.04  # pt, of a point that is left out: a tenth of a pixel where a page is 1150 px wide
UNIT = 100.0  # parts of a point, to which coordinates are rounded
PATH = re.compile(rb'\bd="([^"]*)"')
ROUNDED = re.compile(rb"(\d+\.\d\d)\d+")
PLACED = re.compile(rb' [xy]="[^"]*"|translate\([^)]*\)')
STRAIGHT = re.compile(rb"[MLz\d\s.-]+")  # a path of straight lines
PIECE = re.compile(rb"M([^Mz]*)(z?)")
# no group of matplotlib is referred to
UNSEEN = re.compile(rb'<!--.*?-->|<metadata>.*?</metadata>|(?<=<g) id="[^"]*"', re.DOTALL)
SHADE = re.compile(rb'<path d="[^"]*" (clip-path="[^"]*" style="fill: #\w+; fill-opacity: [\d.]+")/>\s*'
                   rb'(?:<path d="[^"]*" \1/>\s*)+')  # areas of one colour, one after the other
SAFE = " !$'()*+,-./:;=?@[]^_`{|}~"  # what an address in double quotes may hold as it is


def short_svg(svg: bytes) -> bytes:
    """An SVG file with the same picture: straight lines with the points that are seen, curves with two decimals."""
    text = PATH.sub(lambda found: b'd="%s"' % _short(found[1]), UNSEEN.sub(b"", svg))
    text = PLACED.sub(lambda found: ROUNDED.sub(rb"\1", found[0]), text)
    return SHADE.sub(lambda found: b'<path d="%s" %s/>' % (b"".join(PATH.findall(found[0])), found[1]), text)


def data_uri(svg: bytes) -> str:
    """An SVG file as the address of an image, for double quotes in HTML: three quarters as long as in base64."""
    return "data:image/svg+xml," + quote(" ".join(svg.decode().replace('"', "'").split()), safe=SAFE)


def _short(path: bytes) -> bytes:
    if not STRAIGHT.fullmatch(path):
        return ROUNDED.sub(rb"\1", path)
    return b"".join(_piece(points, end) for points, end in PIECE.findall(path))


def _piece(text: bytes, end: bytes) -> bytes:
    """One line of a path: its first point, then steps."""
    points = np.array(text.replace(b"L", b" ").split(), dtype=float).reshape(-1, 2)
    whole = np.round(points[seen(points, TOLERANCE)] * UNIT).astype(int)
    steps = np.diff(whole, axis=0)
    steps = steps[steps.any(axis=1)]
    numbers = " ".join(f"{x / UNIT:g} {y / UNIT:g}" for x, y in steps.tolist()).replace(" -", "-")
    x, y = whole[0].tolist()
    return f"M{x / UNIT:g} {y / UNIT:g}{'l' if numbers else ''}{numbers}".encode() + end


def seen(points: Array, tolerance: float) -> Array:
    """Which points (n, 2) of a line are needed, (n,): no other is farther from the line through them than a tolerance.

    Douglas and Peucker, The Canadian Cartographer 10 (1973) 112-122.
    """
    kept = np.zeros(len(points), dtype=bool)
    kept[[0, -1]] = True
    spans = [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        away = _distances(points[first + 1 : last], points[first], points[last])
        farthest = first + 1 + int(np.argmax(away))
        if away[farthest - first - 1] > tolerance:
            kept[farthest] = True
            spans += [(first, farthest), (farthest, last)]
    return kept


def _distances(points: Array, begin: Array, end: Array) -> Array:
    """Distances of points (n, 2) from a straight piece between two points."""
    along, beside = end - begin, points - begin
    square = float(along @ along)
    share = np.clip(beside @ along / square, 0.0, 1.0) if square else np.zeros(len(points))
    return np.asarray(np.hypot(*(beside - np.outer(share, along)).T))
