"""Our cameras for the rasteriser of 3DGS, which knows only pinhole cameras that are centred.

An orthographic camera is one that stands far away: at a distance D with the focal length ppu · D a point at depth d of the
orthographic camera is seen at ppu · x · D / (D + d − d₀), so that over a scene of extent e the error in pixels is at most
ppu · |x| · e / D. At D = 1000 e that is a thousandth of the scene's size in the picture, and half of that about its middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gear_sdk import Camera, NodeFailure, Orthographic

FAR = 1000.0
"""Extents of the scene at which an orthographic camera stands."""


@dataclass
class Pin:
    """A camera as 3DGS has it: `R` transposed is the rotation from world to camera, `T` the translation."""

    R: np.ndarray
    T: np.ndarray
    fov_x: float
    fov_y: float
    width: int
    height: int


def pinhole(camera: Camera, middle: np.ndarray, extent: float) -> Pin:
    """The camera for a scene about `middle` of this extent."""
    centre = np.array([(camera.width - 1) / 2, (camera.height - 1) / 2])
    if np.abs(np.asarray(camera.principal) - centre).max() > 0.01:
        raise NodeFailure("a view's camera is not centred, and the rasteriser of GaussianEditor knows only centred ones")
    rotation = np.asarray(camera.rotation, np.float64)
    translation = np.asarray(camera.translation, np.float64)
    if isinstance(camera.projection, Orthographic):
        distance = FAR * extent
        seen = rotation @ middle + translation
        translation = translation + [0.0, 0.0, distance - seen[2]]
        focal = camera.projection.pixels_per_unit * distance
    else:
        focal = camera.projection.focal_px
    return Pin(
        rotation.T,
        translation,
        float(2 * np.arctan(camera.width / (2 * focal))),
        float(2 * np.arctan(camera.height / (2 * focal))),
        camera.width,
        camera.height,
    )
