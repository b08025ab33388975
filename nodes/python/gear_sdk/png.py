"""8-bit grey PNG, as gear stores masks (W3C PNG, third edition). Nothing else is read or written."""

from __future__ import annotations

import struct
import zlib

import numpy as np

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
MOST_PIXELS = 1 << 31


class PngError(ValueError):
    """The bytes are no PNG file that can be read."""


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_grey(pixels: np.ndarray) -> bytes:
    """The bytes of a picture of shape (height, width), uint8."""
    height, width = pixels.shape
    rows = np.zeros((height, width + 1), np.uint8)
    rows[:, 1:] = pixels
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    body = zlib.compress(rows.tobytes(), 6)
    return _SIGNATURE + _chunk(b"IHDR", head) + _chunk(b"IDAT", body) + _chunk(b"IEND", b"")


def read_grey(data: bytes) -> np.ndarray:
    """The picture, of shape (height, width), uint8."""
    if not data.startswith(_SIGNATURE):
        raise PngError("not a PNG file")
    at, head, body = len(_SIGNATURE), b"", []
    while at + 8 <= len(data):
        size, kind = struct.unpack(">I4s", data[at : at + 8])
        content = data[at + 8 : at + 8 + size]
        if kind == b"IHDR":
            head = content
        elif kind == b"IDAT":
            body.append(content)
        elif kind == b"IEND":
            break
        at += 12 + size
    if len(head) != 13:
        raise PngError("the header is incomplete")
    width, height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", head)
    if (depth, colour, interlace) != (8, 0, 0) or not 0 < width * height <= MOST_PIXELS:
        raise PngError(f"expected 8-bit grey without interlacing; found {width}x{height}, depth {depth}, type {colour}")
    size = height * (width + 1)
    raw = zlib.decompressobj().decompress(b"".join(body), size)
    if len(raw) != size:
        raise PngError("the picture ends too early")
    rows = np.frombuffer(raw, np.uint8).reshape(height, width + 1)
    return _unfilter(rows, width, height)


def _unfilter(rows: np.ndarray, width: int, height: int) -> np.ndarray:
    out = np.zeros((height, width), np.uint8)
    above = np.zeros(width, np.uint8)
    for y in range(height):
        kind, line = rows[y, 0], rows[y, 1:]
        if kind == 0:
            out[y] = line
        elif kind == 1:
            out[y] = np.cumsum(line, dtype=np.uint64).astype(np.uint8)
        elif kind == 2:
            out[y] = line + above
        elif kind in (3, 4):
            out[y] = _slow(kind, line.tolist(), above.tolist())
        else:
            raise PngError(f"unknown filter {kind}")
        above = out[y]
    return out


def _slow(kind: int, line: list, above: list) -> list:
    out, left, corner = [], 0, 0
    for x, up in zip(line, above):
        if kind == 3:
            guess = (left + up) // 2
        else:
            estimate = left + up - corner
            distances = abs(estimate - left), abs(estimate - up), abs(estimate - corner)
            guess = (left, up, corner)[distances.index(min(distances))]
        left, corner = (x + guess) & 0xFF, up
        out.append(left)
    return out
