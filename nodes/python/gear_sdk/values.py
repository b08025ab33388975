"""What travels on the edges of a graph: arrays with a meaning, read from and written to the formats that gear uses."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any, ClassVar, Dict, List, Optional, Union

import numpy as np

from . import exr, ply, png

SH_C0 = 0.28209479177387814
"""The spherical harmonic of degree 0: a Gaussian's colour is 0.5 + SH_C0 · f_dc."""


def _planes(array: np.ndarray, names: str) -> Dict[str, np.ndarray]:
    return {name: array[..., i] for i, name in enumerate(names)}


@dataclass
class Image:
    """A colour picture: sRGB-encoded, nominally 0 to 1, finite."""

    TYPE: ClassVar[str] = "Image"

    rgb: np.ndarray
    """Shape (height, width, 3), float32."""
    alpha: Optional[np.ndarray] = None
    """Shape (height, width), float32."""

    @classmethod
    def decode(cls, data: bytes) -> "Image":
        planes = exr.read(data)[0].planes
        return cls(np.stack([planes[name] for name in "RGB"], axis=-1), planes.get("A"))

    def encode(self) -> bytes:
        planes = _planes(np.asarray(self.rgb, np.float32), "RGB")
        if self.alpha is not None:
            planes["A"] = self.alpha
        return exr.write([exr.Part(planes, {"gear:colourSpace": "sRGB-encoded"})])

    def to_uint8(self) -> np.ndarray:
        """Shape (height, width, 3), uint8, rounded; what is out of range is clipped, what is not finite is black."""
        rgb = np.nan_to_num(np.asarray(self.rgb, np.float64), nan=0.0, posinf=1.0, neginf=0.0)
        return np.floor(np.clip(rgb, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)

    @classmethod
    def from_uint8(cls, pixels: np.ndarray) -> "Image":
        """From shape (height, width, 3 or 4), uint8."""
        values = np.asarray(pixels, np.float32) / np.float32(255.0)
        return cls(values[..., :3].copy(), values[..., 3].copy() if values.shape[-1] == 4 else None)


@dataclass
class Field:
    """One number a pixel; NaN where there is nothing to say."""

    TYPE: ClassVar[str] = "Field"

    data: np.ndarray
    """Shape (height, width), float32."""

    @classmethod
    def decode(cls, data: bytes) -> "Field":
        return cls(exr.read(data)[0].planes["Y"])

    def encode(self) -> bytes:
        return exr.write([exr.Part({"Y": self.data}, {"gear:colourSpace": "scalar"})])


@dataclass
class Mask:
    """Inside or outside."""

    TYPE: ClassVar[str] = "Mask"

    inside: np.ndarray
    """Shape (height, width), bool."""

    @classmethod
    def decode(cls, data: bytes) -> "Mask":
        return cls(png.read_grey(data) >= 128)

    def encode(self) -> bytes:
        return png.write_grey(np.where(self.inside, 255, 0).astype(np.uint8))


@dataclass
class Orthographic:
    """Parallel rays."""

    pixels_per_unit: float


@dataclass
class Pinhole:
    """Rays through the camera's centre."""

    focal_px: float


@dataclass
class Camera:
    """`p_camera = rotation @ p_world + translation`; camera space is x right, y down, z forward. The centre of the first
    pixel is (0, 0), so a centred principal point is ((width − 1) / 2, (height − 1) / 2)."""

    rotation: np.ndarray
    """Shape (3, 3)."""
    translation: np.ndarray
    """Shape (3,)."""
    projection: Union[Orthographic, Pinhole]
    principal: np.ndarray
    """Shape (2,), in pixels."""
    width: int
    height: int

    @classmethod
    def from_json(cls, value: Dict[str, Any]) -> "Camera":
        projection = value["projection"]
        seen: Union[Orthographic, Pinhole]
        if projection["kind"] == "orthographic":
            seen = Orthographic(float(projection["pixels_per_unit"]))
        elif projection["kind"] == "pinhole":
            seen = Pinhole(float(projection["focal_px"]))
        else:
            raise ValueError(f"unknown projection {projection['kind']}")
        # Matrices are written column by column.
        rotation = np.array(value["rotation"], np.float32).reshape(3, 3).T
        return cls(
            rotation,
            np.array(value["translation"], np.float32),
            seen,
            np.array(value["principal"], np.float32),
            int(value["width"]),
            int(value["height"]),
        )

    def to_json(self) -> Dict[str, Any]:
        if isinstance(self.projection, Orthographic):
            projection = {"kind": "orthographic", "pixels_per_unit": float(self.projection.pixels_per_unit)}
        else:
            projection = {"kind": "pinhole", "focal_px": float(self.projection.focal_px)}
        return {
            "rotation": [float(x) for x in np.asarray(self.rotation).T.reshape(9)],
            "translation": [float(x) for x in self.translation],
            "projection": projection,
            "principal": [float(x) for x in self.principal],
            "width": int(self.width),
            "height": int(self.height),
        }

    @classmethod
    def front(cls, width: int, height: int) -> "Camera":
        """The orthographic camera of a painting: its longer side is one world unit, seen along −z."""
        return cls(
            np.diag([1.0, -1.0, -1.0]).astype(np.float32),
            np.array([0.0, 0.0, 2.0], np.float32),
            Orthographic(float(max(width, height))),
            np.array([(width - 1) / 2, (height - 1) / 2], np.float32),
            width,
            height,
        )

    @property
    def centre(self) -> np.ndarray:
        """Where a pinhole camera stands."""
        return -np.asarray(self.rotation).T @ np.asarray(self.translation)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixel coordinates and depth, shape (n, 3), of points of shape (n, 3)."""
        seen = np.asarray(points) @ np.asarray(self.rotation).T + np.asarray(self.translation)
        if isinstance(self.projection, Orthographic):
            flat = seen[:, :2] * self.projection.pixels_per_unit
        else:
            flat = seen[:, :2] * self.projection.focal_px / seen[:, 2:3]
        return np.concatenate([flat + np.asarray(self.principal), seen[:, 2:3]], axis=1)


def logit(p: np.ndarray) -> np.ndarray:
    """ln(p / (1 − p)), held within ±16."""
    p = np.clip(np.asarray(p, np.float64), 1e-12, 1 - 1e-12)
    return np.clip(np.log(p / (1 - p)), -16, 16).astype(np.float32)


@dataclass
class Scene:
    """3D Gaussians in the parametrisation of 3DGS; world: x right, y up, z towards the viewer."""

    TYPE: ClassVar[str] = "Scene"

    centers: np.ndarray
    """Shape (n, 3)."""
    log_scales: np.ndarray
    """Shape (n, 3): natural logarithms of the standard deviations."""
    rotations: np.ndarray
    """Shape (n, 4): quaternions (w, x, y, z) that turn a Gaussian's own axes into the world's."""
    opacity_logits: np.ndarray
    """Shape (n,)."""
    sh_dc: np.ndarray
    """Shape (n, 3): sRGB-encoded colour is 0.5 + SH_C0 · sh_dc."""
    sh_rest: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    """Shape (n, 0, 9, 24 or 45), channel by channel."""
    camera: Optional[Camera] = None
    """The camera under which the scene shows its painting."""

    def __len__(self) -> int:
        return len(self.centers)

    @classmethod
    def decode(cls, data: bytes) -> "Scene":
        columns, comments = ply.read(data)

        def several(name: str, count: int) -> np.ndarray:
            try:
                return np.stack([columns[f"{name}_{i}"] for i in range(count)], axis=1)
            except KeyError as error:
                raise ply.PlyError(f"the vertices have no {error.args[0]}") from error

        rest = sum(name.startswith("f_rest_") for name in columns)
        camera = None
        for comment in comments:
            if comment.startswith(ply.CAMERA):
                camera = Camera.from_json(json.loads(comment[len(ply.CAMERA) :]))
        return cls(
            np.stack([columns[axis] for axis in "xyz"], axis=1),
            several("scale", 3),
            several("rot", 4),
            columns["opacity"],
            several("f_dc", 3),
            several("f_rest", rest) if rest else np.zeros((len(columns["x"]), 0), np.float32),
            camera,
        )

    def encode(self) -> bytes:
        count = len(self)
        rest = np.asarray(self.sh_rest, np.float32)
        rest = rest if rest.shape[0] == count else np.zeros((count, 0), np.float32)
        if rest.shape[1] not in (0, 9, 24, 45):
            raise ValueError(f"{rest.shape[1]} coefficients of higher degree; expected 0, 9, 24 or 45")
        parts = [self.centers, np.zeros((count, 3)), self.sh_dc, rest, np.asarray(self.opacity_logits)[:, None]]
        table = np.concatenate([*parts, self.log_scales, self.rotations], axis=1).astype(np.float32)
        columns = {name: table[:, i] for i, name in enumerate(ply.names(rest.shape[1]))}
        comments = []
        if self.camera is not None:
            comments.append(ply.CAMERA + json.dumps(self.camera.to_json(), separators=(",", ":")))
        return ply.write(columns, comments)

    @property
    def scales(self) -> np.ndarray:
        """Standard deviations, shape (n, 3)."""
        return np.exp(self.log_scales)

    @property
    def opacities(self) -> np.ndarray:
        """Opacities, shape (n,), 0 to 1."""
        return 1.0 / (1.0 + np.exp(-np.asarray(self.opacity_logits, np.float64)))

    @property
    def colors(self) -> np.ndarray:
        """sRGB-encoded colours, shape (n, 3), seen from anywhere."""
        return 0.5 + SH_C0 * np.asarray(self.sh_dc)


@dataclass
class View:
    """A named rendering with its camera."""

    camera: Camera
    name: str
    rgb: np.ndarray
    """Shape (height, width, 3)."""
    alpha: Optional[np.ndarray] = None
    depth: Optional[np.ndarray] = None
    """NaN where nothing is."""
    normal: Optional[np.ndarray] = None
    """Shape (height, width, 3), in the world."""
    weight: Optional[np.ndarray] = None


@dataclass
class Views:
    """Named renderings."""

    TYPE: ClassVar[str] = "Views"

    views: List[View]

    @classmethod
    def decode(cls, data: bytes) -> "Views":
        found = []
        for part in exr.read(data):
            if "gear:camera" not in part.texts:
                continue
            planes = part.planes
            normal = [planes[name] for name in ("NX", "NY", "NZ") if name in planes]
            view = View(
                Camera.from_json(json.loads(part.texts["gear:camera"])),
                json.loads(part.texts["gear:view"]),
                np.stack([planes[name] for name in "RGB"], axis=-1),
                planes.get("A"),
                planes.get("Z"),
                np.stack(normal, axis=-1) if len(normal) == 3 else None,
                planes.get("W"),
            )
            found.append((int(part.texts["gear:index"]), view))
        return cls([view for _, view in sorted(found, key=lambda pair: pair[0])])

    def encode(self) -> bytes:
        parts = []
        for index, view in enumerate(self.views):
            planes = _planes(np.asarray(view.rgb, np.float32), "RGB")
            if view.normal is not None:
                planes.update(zip(("NX", "NY", "NZ"), np.moveaxis(np.asarray(view.normal, np.float32), -1, 0)))
            for name, plane in (("A", view.alpha), ("Z", view.depth), ("W", view.weight)):
                if plane is not None:
                    planes[name] = plane
            texts = {
                "gear:camera": json.dumps(view.camera.to_json(), separators=(",", ":")),
                "gear:view": json.dumps(view.name),
                "gear:index": str(index),
                "gear:colourSpace": "sRGB-encoded",
            }
            plain = "".join(c for c in view.name if 32 < ord(c) < 127)
            parts.append(exr.Part(planes, texts, f"{index:03} {plain}"))
        # EXR needs a layer; one without a camera is no view.
        return exr.write(parts or [exr.Part({"Y": np.zeros((1, 1))}, {}, "no views")])


@dataclass
class Number:
    """A number; a result may be infinite, never NaN."""

    TYPE: ClassVar[str] = "Number"

    value: float

    @classmethod
    def decode(cls, data: bytes) -> "Number":
        value = json.loads(data)
        if isinstance(value, str):
            value = {"inf": math.inf, "-inf": -math.inf}.get(value, math.nan)
        return cls(float(value))

    def encode(self) -> bytes:
        if math.isfinite(self.value):
            return json.dumps(float(self.value)).encode()
        return json.dumps("inf" if self.value > 0 else "-inf").encode()


@dataclass
class Report:
    """What a node says about its result: any JSON, by habit a dict of named figures."""

    TYPE: ClassVar[str] = "Report"

    value: Any

    @classmethod
    def decode(cls, data: bytes) -> "Report":
        return cls(json.loads(data))

    def encode(self) -> bytes:
        return json.dumps(self.value, allow_nan=False, indent=2).encode()


Value = Union[Image, Field, Mask, Scene, Views, Number, Report]
"""Any of them."""

TYPES: Dict[str, Any] = {
    kind.TYPE: kind
    for kind in (Image, Field, Mask, Scene, Views, Number, Report)  # type: ignore[attr-defined]
}
"""By the name that gear knows."""
