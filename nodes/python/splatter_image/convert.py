"""Gaussians as Splatter Image predicts them, as gear's.

Asked with the identity as the source camera, `GaussianSplatPredictor` gives them in the space of the camera that took the
picture: x right, y down, z forward, the camera at the origin. So the pose is known exactly, and nothing is fitted: that
camera, for the part of the painting that was shown to the network, is the camera of the scene. The harmonics of degree 1
come coefficient by coefficient, gear's channel by channel.
"""

from __future__ import annotations

import numpy as np

from gear_sdk import Camera, Pinhole, Scene
from gear_sdk.cutout import Cutout
from gear_sdk.geometry import moved, normalized
from gear_sdk.values import logit

FAINT = 0.005

TURN = np.diag([1.0, -1.0, -1.0])
"""From the camera's axes to gear's."""


def from_memory(
    xyz: np.ndarray,
    opacity: np.ndarray,
    scaling: np.ndarray,
    rotation: np.ndarray,
    features_dc: np.ndarray,
    features_rest: np.ndarray,
    *,
    fov_degrees: float,
    cut: Cutout,
    width: int,
    height: int,
) -> Scene:
    """The scene of the activated prediction: (n, 3), (n, 1), (n, 3), (n, 4), (n, 1, 3), (n, k, 3)."""
    kept = np.asarray(opacity)[:, 0] >= FAINT
    centers = np.asarray(xyz, np.float64)[kept]
    rest = np.asarray(features_rest, np.float32)[kept]
    in_camera = Scene(
        centers.astype(np.float32),
        np.log(np.asarray(scaling, np.float64)[kept] + 1e-8).astype(np.float32),
        normalized(np.asarray(rotation)[kept]).astype(np.float32),
        logit(np.asarray(opacity, np.float64)[kept, 0]),
        np.asarray(features_dc, np.float32)[kept, 0],
        rest.transpose(0, 2, 1).reshape(len(centers), -1),
    )
    # The network saw the square `cut` under this angle.
    focal = cut.size / 2 / np.tan(np.radians(fov_degrees) / 2)
    depth = float(np.median(centers[:, 2])) if len(centers) else 1.0
    # So that at the object's depth the painting's longer side is one unit, as everywhere in gear.
    scale = float(focal / (max(width, height) * depth))
    scene = moved(in_camera, TURN, scale, np.array([0.0, 0.0, scale * depth]))
    principal = np.array([cut.left, cut.top]) + cut.size / 2 - 0.5
    scene.camera = Camera(
        TURN.astype(np.float32),
        np.array([0, 0, scale * depth], np.float32),
        Pinhole(float(focal)),
        principal.astype(np.float32),
        width,
        height,
    )
    return scene
