"""Damage to valid files: bytes anywhere, and changes that know the structure and keep its checksums right."""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

Random = np.random.Generator
TOKENS = (  # what a scalar of YAML or JSON may be replaced by
    "0", "-0", "-1", "1e309", "-1e309", "1e-400", ".inf", "-.inf", ".nan", "NaN", "1:30", "1_0", "017", "0o17",
    "0x1F", "1e", "+1", "1.", ".5", "1e4", "1E+4", "true", "yes", "off", "null", "~", "''", '"1.0"', "'1'", "[]",
    "[1.0]", "{}", "{a: 1}", "!!int 1:30", "!!float 1", "!!str 1", "!!binary eA==", "!!set {}", "!!python/none x",
    "!x 1", "&a 1", "*a", "<<", "=", "2001-01-01", "2001-13-45", "9" * 400, "9" * 5000, "1" + "0" * 308, "5e-324",
    "| x", ">", "?", "- 1", "# x", "@", "`", "%", "\u00091", "\u0000", "\u001b[0m", "\ud83d", "\u2028", "\ufeff",
    '"\\ud800"', '"\\0"', "0.1 0.2", "1,5", "1;", "[" * 50, "{" * 50, "a" * 3000, "1.0e+1.0", "\u0661", "1\u00a0",
    "0b1", "1e+", "--1", "1-1", "Infinity", "None", "0.30000000000000004",
)
HEADERS = (  # what a header of an array may say in place of what it says
    ("'<f8'", "'|O'"), ("'<f8'", "'<c16'"), ("'<f8'", "'>f8'"), ("'<f8'", "'<f4'"), ("'<f8'", "'<U8'"),
    ("'<f8'", "'<M8[s]'"), ("'<f8'", "'|V8'"), ("'<f8'", "'<f9'"), ("'<f8'", "[('a', '<f8')]"), ("'<f8'", "'<f8' "),
    ("False", "True"), ("False", "0"), ("(", "(-"), ("(", "(1, "), (")", ", 0)"), (",)", ", 99999999999)"),
    ("{", "{{"), ("'descr'", "'descs'"), ("}", ""), ("(5", "(6"), ("(5", "(4"), ("(5", "(0"),
)
VALUES = (0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 1e308, 5e-324, 1e9, 2.0**53)
SIZES = (0, 1, 21, 22, 2**16, 2**31, 2**32 - 1, 2**63, 2**64 - 1)


def damage(content: bytes, rng: Random) -> bytes:
    """Some bits or bytes flipped, cut off, cut out, put in, copied or written over."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        index, length = int(rng.integers(len(data) + 1)), int(rng.integers(1, 60))
        other = rng.integers(256, size=length).astype(np.uint8).tobytes()
        match rng.integers(7):
            case 0 | 1 if data:
                data[index % len(data)] ^= 1 << int(rng.integers(8))
            case 2:
                del data[index:]
            case 3:
                del data[index : index + length]
            case 4:
                data[index:index] = other
            case 5:
                data[index:index] = data[index // 2 : index // 2 + length]
            case _:
                data[index : index + length] = other
    return bytes(data)


def text(content: str, rng: Random) -> str:
    """A scene in which some scalars, keys or lines are others."""
    lines = content.splitlines(keepends=True)
    for _ in range(int(rng.integers(1, 4))):
        number, other = (int(k) for k in rng.integers(len(lines), size=2))
        token = TOKENS[int(rng.integers(len(TOKENS)))]
        match rng.integers(8):
            case 0 | 1 | 2:
                lines[number] = re.sub(r": .*", lambda _, word=token: f": {word}", lines[number])  # type: ignore[misc]
            case 3:
                lines[number] = re.sub(r"[\w]+:", lambda _, word=token: f"{word}:", lines[number])  # type: ignore[misc]
            case 4:
                lines[number] = lines[other]
            case 5:
                lines.insert(number, lines[other])
            case 6:
                lines[number] = lines[number].lstrip() if rng.integers(2) else f"  {lines[number]}"
            case _:
                lines[number] = ""
    return "".join(lines)


def number(content: str, rng: Random) -> str:
    """A scene in which some numbers are others that look like ones."""
    def another(found: re.Match[str]) -> str:
        if rng.random() > 0.1:
            return found[0]
        exponent = int(rng.integers(-320, 320)) if rng.integers(3) == 0 else int(rng.integers(-12, 12))
        sign, whole = "-" * int(rng.integers(5) == 0), rng.integers(1, 10 ** int(rng.integers(1, 18)))
        return f": {sign}{whole}.{rng.integers(99)}e{exponent}"

    return re.sub(r": -?\d+\.\d+(e[-+]\d+)?$", another, content, flags=re.M)


def arrays(content: Mapping[str, np.ndarray], rng: Random) -> bytes:
    """A file of arrays of which some have another header, shape, type or number; its checksums are right."""
    members = {f"{name}.npy": _stored(values) for name, values in content.items()}
    names = list(content)
    for _ in range(int(rng.integers(1, 3))):
        name = names[int(rng.integers(len(names)))]
        key, values = f"{name}.npy", content[name]
        if key not in members:
            continue
        match rng.integers(6):
            case 0:
                old, new = HEADERS[int(rng.integers(len(HEADERS)))]
                members[key] = members[key].replace(old.encode(), new.encode(), 1)
            case 1:
                members[key] = damage(members[key], rng)
            case 2 if values.dtype.kind == "f" and values.size:
                changed = values.copy().reshape(-1)
                changed[int(rng.integers(changed.size))] = VALUES[int(rng.integers(len(VALUES)))]
                members[key] = _stored(changed.reshape(values.shape))
            case 3:
                some = np.atleast_1d(values)
                kinds = (some[..., :1], some[:-1], values.astype("U9"), values[None], np.append(values, values),
                         values.astype(np.float32) if values.dtype.kind == "f" else values)
                members[key] = _stored(kinds[int(rng.integers(len(kinds)))])
            case 4:
                members[names[int(rng.integers(len(names)))] + ".npy"] = members[key]
            case _:
                members.pop(key, None) if rng.integers(2) else members.setdefault(f"{name}x.npy", b"x")
    file = io.BytesIO()
    way = int(rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2]))
    with zipfile.ZipFile(file, "w", way) as archive:
        for key, data in members.items():
            archive.writestr(key, data)
    return file.getvalue()


def _stored(values: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


def records(content: bytes, rng: Random, unpack: Callable[[bytes], bytes]) -> bytes:
    """An MCAP file without its end, in which records of a chunk or chunks are others; its checksums are right."""
    head, found = content[:8], _split(content[8:])
    found = [one for one in found if one[0] in (1, 6, 12)]
    valid = list(found)
    for _ in range(int(rng.integers(1, 3))):
        index, other = (int(k) for k in rng.integers(len(found), size=2))
        match rng.integers(5):
            case 0:
                found.insert(index, found[other])
            case 1 if len(found) > 1:
                del found[index]
            case _:
                opcode, body = found[index]
                if opcode == 6 and found[index] in valid:
                    found[index] = (opcode, _chunk(body, rng, unpack))
    return head + b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in found)


def _chunk(body: bytes, rng: Random, unpack: Callable[[bytes], bytes]) -> bytes:
    """A chunk with another content, not compressed."""
    inner = _split(unpack(body))
    for _ in range(int(rng.integers(1, 3))):
        index, other = (int(k) for k in rng.integers(len(inner), size=2))
        opcode, data = inner[index]
        match rng.integers(6):
            case 0:
                inner[index] = inner[other]
            case 1:
                inner[index] = opcode, damage(data, rng)
            case 2:
                inner[index] = int(rng.integers(20)), data
            case 3 if len(data) >= 22:  # another time
                inner[index] = opcode, data[:6] + struct.pack("<Q", _size(rng, 2**63)) + data[14:]
            case 4:
                at = int(rng.integers(len(data) - 3)) if len(data) > 4 else 0
                inner[index] = opcode, data[:at] + struct.pack("<I", _size(rng, 2**32)) + data[at + 4 :]
            case _:
                del inner[index]
                inner = inner or [(5, b"")]
    raw = b"".join(struct.pack("<BQ", opcode, len(data)) + data for opcode, data in inner)
    claimed = len(raw) if rng.integers(10) else _size(rng, 2**64)
    return body[:16] + struct.pack("<QIIQ", claimed, zlib.crc32(raw), 0, len(raw)) + raw


def _size(rng: Random, most: int) -> int:
    sizes = [size for size in SIZES if size < most]
    return sizes[int(rng.integers(len(sizes)))]


def _split(content: bytes) -> list[tuple[int, bytes]]:
    """Opcode and body of the records of a valid file or chunk."""
    found, at = [], 0
    while at + 9 <= len(content):
        opcode, length = struct.unpack_from("<BQ", content, at)
        found.append((opcode, content[at + 9 : at + 9 + length]))
        at += 9 + length
    return found


def line(entry: Mapping[str, Any], rng: Random, seal: Callable[[Mapping[str, Any]], str]) -> str:
    """A line of a journal with another value, and the checksum that belongs to it."""
    value = dict(entry["value"])
    name = list(value)[int(rng.integers(len(value)))]
    match rng.integers(3):
        case 0:
            del value[name]
        case 1:
            value[str(rng.integers(9))] = 1
        case _:
            others: tuple[Any, ...] = (None, True, "x", [], [1], [1, 2], {}, 1e400, -1, [[1, 2]], "1", 10**400)
            value[name] = others[int(rng.integers(len(others)))]
    changed = {**entry, "value": value}
    return json.dumps({**changed, "sum": seal(changed)}) + "\n"
