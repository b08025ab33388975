"""3DGS PLY: scenes as the reference implementation writes them, and as TRELLIS and LGM do.

Properties are found by name, in any order and of any scalar type, in ASCII or binary of either byte order. The camera under
which a scene shows its painting is a comment line, which other readers skip.
"""

from __future__ import annotations

from typing import Dict, List, Optional, Tuple

import numpy as np

CAMERA = "gear canonical_camera "

_SCALARS = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


class PlyError(ValueError):
    """The bytes are no PLY file of Gaussians that can be read."""


def names(sh_rest: int) -> List[str]:
    """The property names in standard order, with this many coefficients of higher degree."""
    return (
        ["x", "y", "z", "nx", "ny", "nz"]
        + [f"f_dc_{i}" for i in range(3)]
        + [f"f_rest_{i}" for i in range(sh_rest)]
        + ["opacity"]
        + [f"scale_{i}" for i in range(3)]
        + [f"rot_{i}" for i in range(4)]
    )


def write(columns: Dict[str, np.ndarray], comments: Optional[List[str]] = None) -> bytes:
    """The bytes of a file whose vertices have these properties, in this order, as 32-bit floats, little end first."""
    table = np.stack([np.asarray(column, "<f4") for column in columns.values()], axis=1)
    head = ["ply", "format binary_little_endian 1.0"]
    head += [f"comment {comment}" for comment in comments or []]
    head += [f"element vertex {len(table)}"] + [f"property float {name}" for name in columns] + ["end_header", ""]
    return "\n".join(head).encode() + np.ascontiguousarray(table).tobytes()


def read(data: bytes) -> Tuple[Dict[str, np.ndarray], List[str]]:
    """The properties of the vertices as float32 arrays by name, and the comments."""
    end = data.find(b"end_header")
    stop = data.find(b"\n", end)
    if not data.startswith(b"ply") or end < 0 or stop < 0:
        raise PlyError("not a PLY file")
    encoding = ""
    comments: List[str] = []
    elements: List[Tuple[str, int, List[Tuple[str, str]]]] = []
    for line in data[:end].decode("utf-8", "replace").splitlines()[1:]:
        words = line.split()
        if not words:
            continue
        if words[0] == "format":
            encoding = words[1]
        elif words[0] == "comment":
            comments.append(line.strip()[len("comment") :].strip())
        elif words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property":
            if words[1] == "list" or words[1] not in _SCALARS or not elements:
                raise PlyError(f"a Gaussian has no property like `{line}`")
            elements[-1][2].append((words[2], _SCALARS[words[1]]))
    at = stop + 1
    order = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}.get(encoding)
    if order is None:
        raise PlyError(f"unknown format `{encoding}`")
    numbers = iter(data[at:].split()) if encoding == "ascii" else None
    for element, count, properties in elements:
        layout = np.dtype([(name, order + kind) for name, kind in properties])
        if numbers is not None:
            try:
                rows = [[float(next(numbers)) for _ in properties] for _ in range(count)]
            except (StopIteration, RuntimeError) as error:
                raise PlyError("the file ends too early") from error
            table = {name: np.array([row[i] for row in rows], np.float32) for i, (name, _) in enumerate(properties)}
        else:
            if count < 0 or at + count * layout.itemsize > len(data):
                raise PlyError("the file ends too early")
            packed = np.frombuffer(data, layout, count, at)
            at += count * layout.itemsize
            table = {name: packed[name].astype(np.float32) for name, _ in properties}
        if element == "vertex":
            return table, comments
    raise PlyError("the file has no vertices")
