"""OpenEXR as gear and its plugins pass it: flat scanline parts of float channels.

Written is what gear itself writes: 32-bit float, uncompressed, one part a layer. Read are also half and unsigned integer
channels and the compressions ZIP and ZIPS, in files of one or several parts. Tiles, deep data and subsampled channels are
refused. The layout is that of "OpenEXR File Layout" (openexr.com).
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import Dict, List, Tuple

import numpy as np

MAGIC = 20000630
_LONG_NAMES = 0x400
_MULTI_PART = 0x1000
_REFUSED = {0x200: "tiles", 0x800: "deep data"}
_TYPES: Dict[int, np.dtype] = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
_LINES = {0: 1, 2: 1, 3: 16}
"""Lines of a block, by compression: none, ZIPS, ZIP."""

MOST_SAMPLES = 1 << 31
"""No raster has more samples; a header that claims more is damaged."""


class ExrError(ValueError):
    """The bytes are no EXR file that can be read."""


@dataclass
class Part:
    """One layer: planes of one size by channel name, and the attributes that are texts."""

    planes: Dict[str, np.ndarray]
    """Arrays of shape (height, width), float32."""
    texts: Dict[str, str] = field(default_factory=dict)
    name: str = ""

    @property
    def size(self) -> Tuple[int, int]:
        """Width and height."""
        height, width = next(iter(self.planes.values())).shape
        return width, height


def _attribute(name: str, kind: str, data: bytes) -> bytes:
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data


def _header(part: Part, multi: bool) -> bytes:
    width, height = part.size
    channels = b"".join(
        name.encode() + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1) for name in sorted(part.planes)
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    out = [
        _attribute("channels", "chlist", channels + b"\0"),
        _attribute("compression", "compression", b"\0"),
        _attribute("dataWindow", "box2i", window),
        _attribute("displayWindow", "box2i", window),
        _attribute("lineOrder", "lineOrder", b"\0"),
        _attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        _attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        _attribute("screenWindowWidth", "float", struct.pack("<f", 1.0)),
    ]
    if part.name or multi:
        out.append(_attribute("name", "string", part.name.encode()))
    if multi:
        out.append(_attribute("type", "string", b"scanlineimage"))
        out.append(_attribute("chunkCount", "int", struct.pack("<i", height)))
    for key in sorted(part.texts):
        out.append(_attribute(key, "string", part.texts[key].encode()))
    return b"".join(out) + b"\0"


def write(parts: List[Part]) -> bytes:
    """The bytes of a file with these layers."""
    if not parts:
        raise ExrError("an EXR file has at least one layer")
    multi = len(parts) > 1
    if multi and len({part.name for part in parts}) != len(parts):
        raise ExrError("the layers of an EXR file need names of their own")
    flags = 2 | (_MULTI_PART if multi else 0)
    if any(len(name) > 31 for part in parts for name in [*part.texts, *part.planes]):
        flags |= _LONG_NAMES
    head = [struct.pack("<ii", MAGIC, flags)] + [_header(part, multi) for part in parts] + ([b"\0"] if multi else [])
    header = b"".join(head)
    offset = len(header) + 8 * sum(part.size[1] for part in parts)
    offsets: List[bytes] = []
    chunks: List[bytes] = []
    for number, part in enumerate(parts):
        width, height = part.size
        names = sorted(part.planes)
        if not names or any(part.planes[name].shape != (height, width) for name in names):
            raise ExrError("the planes of a layer have one size")
        # Lines, then channels in order of their names, then pixels.
        block = np.stack([np.asarray(part.planes[name], dtype="<f4") for name in names], axis=1)
        start = []
        for y in range(height):
            prefix = struct.pack("<i", number) if multi else b""
            data = block[y].tobytes()
            chunk = prefix + struct.pack("<ii", y, len(data)) + data
            start.append(offset)
            offset += len(chunk)
            chunks.append(chunk)
        offsets.append(struct.pack(f"<{height}Q", *start))
    return header + b"".join(offsets) + b"".join(chunks)


class _Reader:
    def __init__(self, data: bytes):
        self.data = data
        self.at = 0

    def take(self, count: int) -> bytes:
        if count < 0 or self.at + count > len(self.data):
            raise ExrError("the file ends too early")
        self.at += count
        return self.data[self.at - count : self.at]

    def unpack(self, layout: str) -> tuple:
        return struct.unpack(layout, self.take(struct.calcsize(layout)))

    def name(self) -> str:
        end = self.data.find(b"\0", self.at, self.at + 256)
        if end < 0:
            raise ExrError("a name has no end")
        text = self.data[self.at : end]
        self.at = end + 1
        return text.decode("utf-8", "replace")


@dataclass
class _Layout:
    channels: List[Tuple[str, np.dtype]]
    compression: int
    window: Tuple[int, int, int, int]
    texts: Dict[str, str]

    @property
    def size(self) -> Tuple[int, int]:
        left, top, right, bottom = self.window
        return right - left + 1, bottom - top + 1


def _channels(data: bytes) -> List[Tuple[str, np.dtype]]:
    reader = _Reader(data)
    out: List[Tuple[str, np.dtype]] = []
    while True:
        name = reader.name()
        if not name:
            return out
        kind, x_sampling, y_sampling = reader.unpack("<i4xii")
        if kind not in _TYPES or (x_sampling, y_sampling) != (1, 1):
            raise ExrError(f"channel {name} is subsampled or of an unknown type")
        out.append((name, _TYPES[kind]))


def _layout(reader: _Reader) -> _Layout:
    attributes: Dict[str, Tuple[str, bytes]] = {}
    while True:
        name = reader.name()
        if not name:
            break
        kind = reader.name()
        (size,) = reader.unpack("<i")
        attributes[name] = (kind, reader.take(size))
    try:
        channels = _channels(attributes["channels"][1])
        compression = attributes["compression"][1][0]
        window = struct.unpack("<4i", attributes["dataWindow"][1])
    except (KeyError, IndexError, struct.error) as error:
        raise ExrError(f"the header is incomplete: {error}") from error
    form = attributes.get("type", ("string", b"scanlineimage"))[1]
    if form != b"scanlineimage" or compression not in _LINES:
        raise ExrError(f"expected scanlines, uncompressed or ZIP; found {form!r} with compression {compression}")
    texts = {
        key: data.decode("utf-8", "replace")
        for key, (attribute, data) in attributes.items()
        if attribute == "string"
    }
    layout = _Layout(channels, compression, window, texts)
    width, height = layout.size
    if width < 1 or height < 1 or width * height * max(1, len(channels)) > MOST_SAMPLES:
        raise ExrError(f"a layer of {width}x{height} cannot be read")
    return layout


def _unzip(data: bytes, size: int) -> bytes:
    if len(data) == size:
        return data
    unpacker = zlib.decompressobj()
    raw = np.frombuffer(unpacker.decompress(data, size), np.uint8)
    if raw.size != size:
        raise ExrError("a block does not unpack to its size")
    # Differences from 128, then the two halves of the bytes are woven together.
    whole = (np.cumsum(raw.astype(np.int64)) - 128 * np.arange(size)).astype(np.uint8)
    half = (size + 1) // 2
    out = np.empty(size, np.uint8)
    out[0::2] = whole[:half]
    out[1::2] = whole[half:]
    return out.tobytes()


def read(data: bytes) -> List[Part]:
    """The layers of a file."""
    reader = _Reader(data)
    magic, version = reader.unpack("<ii")
    if magic != MAGIC or version & 0xFF != 2:
        raise ExrError("not an OpenEXR 2 file")
    for bit, what in _REFUSED.items():
        if version & bit:
            raise ExrError(f"EXR files with {what} are not read")
    multi = bool(version & _MULTI_PART)
    layouts = [_layout(reader)]
    if multi:
        while reader.data[reader.at : reader.at + 1] != b"\0":
            layouts.append(_layout(reader))
        reader.take(1)
    tables = []
    for layout in layouts:
        lines = _LINES[layout.compression]
        blocks = (layout.size[1] + lines - 1) // lines
        tables.append(reader.unpack(f"<{blocks}Q"))
    return [_read_part(data, number, layout, tables[number], multi) for number, layout in enumerate(layouts)]


def _read_part(data: bytes, number: int, layout: _Layout, offsets: tuple, multi: bool) -> Part:
    width, height = layout.size
    line = width * sum(kind.itemsize for _, kind in layout.channels)
    planes = {name: np.empty((height, width), np.float32) for name, _ in layout.channels}
    seen = np.zeros(height, bool)
    for offset in offsets:
        reader = _Reader(data)
        reader.at = offset
        if multi and reader.unpack("<i") != (number,):
            raise ExrError("a block belongs to another layer")
        y, size = reader.unpack("<ii")
        y -= layout.window[1]
        if not 0 <= y < height:
            raise ExrError("a block lies outside the layer")
        count = min(_LINES[layout.compression], height - y)
        block = reader.take(size)
        if layout.compression:
            block = _unzip(block, line * count)
        if len(block) != line * count:
            raise ExrError("a block has the wrong length")
        for k in range(count):
            at = k * line
            for name, kind in layout.channels:
                end = at + width * kind.itemsize
                planes[name][y + k] = np.frombuffer(block[at:end], kind)
                at = end
        seen[y : y + count] = True
    if not seen.all():
        raise ExrError("lines are missing")
    return Part(planes, layout.texts, layout.texts.get("name", ""))
