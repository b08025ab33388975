"""Rotations, and scenes moved by them. Quaternions are (w, x, y, z), as 3DGS has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .values import Scene


def normalized(q: np.ndarray) -> np.ndarray:
    """Unit quaternions; what has no direction is the identity."""
    q = np.asarray(q, np.float64)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(length > 1e-12, q / np.maximum(length, 1e-12), [1.0, 0.0, 0.0, 0.0])


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """First b, then a."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a, np.float64), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b, np.float64), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def to_matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrices, shape (…, 3, 3)."""
    w, x, y, z = np.moveaxis(normalized(q), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(matrix: np.ndarray) -> np.ndarray:
    """The quaternion of one rotation matrix, w not negative: the eigenvector of the largest eigenvalue (I. Bar-Itzhack,
    "New method for extracting the quaternion from a rotation matrix", 2000)."""
    m = np.asarray(matrix, np.float64)
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    x, y, z, w = np.linalg.eigh(k / 3.0)[1][:, -1]
    q = np.array([w, x, y, z])
    return q if w >= 0 else -q


def about_y(degrees: float) -> np.ndarray:
    """The rotation about the upward axis that turns the viewer's side to the right by so much."""
    angle = np.radians(degrees)
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _turn_sh(rest: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Of degree 1 (9 coefficients, channel by channel, in the order y z x of 3DGS: −C₁y, C₁z, −C₁x) the linear part
    is a vector, and turns like one."""
    if rest.shape[1] == 0:
        return rest
    if rest.shape[1] != 9:
        raise ValueError("spherical harmonics above degree 1 are not turned; leave them out")
    per_channel = rest.reshape(-1, 3, 3)
    vector = np.stack([-per_channel[..., 2], -per_channel[..., 0], per_channel[..., 1]], axis=-1)
    turned = vector @ rotation.T
    out = np.stack([-turned[..., 1], turned[..., 2], -turned[..., 0]], axis=-1)
    return out.reshape(-1, 9).astype(np.float32)


def moved(scene: Scene, rotation: np.ndarray, scale: float = 1.0, translation: np.ndarray = np.zeros(3)) -> Scene:
    """The scene with every point p at scale · rotation @ p + translation; without its camera."""
    rotation = np.asarray(rotation, np.float64)
    return replace(
        scene,
        centers=(scale * np.asarray(scene.centers, np.float64) @ rotation.T + translation).astype(np.float32),
        log_scales=(np.asarray(scene.log_scales, np.float64) + np.log(scale)).astype(np.float32),
        rotations=normalized(multiply(from_matrix(rotation), normalized(scene.rotations))).astype(np.float32),
        sh_rest=_turn_sh(np.asarray(scene.sh_rest), rotation) if len(scene) else scene.sh_rest,
        camera=None,
    )
