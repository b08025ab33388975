"""Gaussians as TRELLIS holds them, as gear's.

TRELLIS keeps what its network gives, before activations and biases (`Gaussian` of trellis/representations):

    centre    aabb[:3] + xyz · aabb[3:]
    scale     √(activation(scaling + b)² + kernel²), activation(b) = scaling_bias
    opacity   sigmoid(opacity + logit(opacity_bias))
    rotation  (w, x, y, z) of rotation + (1, 0, 0, 0), normalised
    colour    0.5 + 0.2821 · features_dc

and its world has z upwards and the front towards −y, as its export to glTF shows, which turns (x, y, z) into (x, z, −y).
That is gear's world. Its `save_ply` turns otherwise, into (x, −z, y): from a file the y and z axes are turned round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gear_sdk import Scene
from gear_sdk.geometry import moved, normalized
from gear_sdk.values import logit

FROM_MEMORY = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
FROM_FILE = np.diag([1.0, -1.0, -1.0])


@dataclass
class Raw:
    """The tensors of a TRELLIS `Gaussian` as arrays, and the constants that go with them."""

    xyz: np.ndarray
    """Shape (n, 3), 0 to 1 in the box."""
    features_dc: np.ndarray
    """Shape (n, 1, 3)."""
    scaling: np.ndarray
    """Shape (n, 3)."""
    rotation: np.ndarray
    """Shape (n, 4)."""
    opacity: np.ndarray
    """Shape (n, 1)."""
    aabb: np.ndarray
    scaling_bias: float
    opacity_bias: float
    kernel: float
    activation: str
    """`exp` or `softplus`."""

    @classmethod
    def of(cls, gaussian) -> "Raw":
        """From the object that the pipeline gives."""
        constants = gaussian.init_params
        array = lambda tensor: tensor.detach().float().cpu().numpy().astype(np.float64)  # noqa: E731
        return cls(
            array(gaussian._xyz),
            array(gaussian._features_dc),
            array(gaussian._scaling),
            array(gaussian._rotation),
            array(gaussian._opacity),
            np.asarray(constants["aabb"], np.float64),
            constants["scaling_bias"],
            constants["opacity_bias"],
            constants["mininum_kernel_size"],  # so spelt there
            constants["scaling_activation"],
        )


def _softplus(x: np.ndarray) -> np.ndarray:
    return np.logaddexp(0.0, x)


def from_memory(raw: Raw) -> Scene:
    """The scene, about the middle of its box."""
    if raw.activation == "softplus":
        scales = _softplus(raw.scaling + np.log(np.expm1(raw.scaling_bias)))
    elif raw.activation == "exp":
        scales = np.exp(raw.scaling + np.log(raw.scaling_bias))
    else:
        raise ValueError(f"unknown activation of scales `{raw.activation}`")
    scales = np.sqrt(scales**2 + raw.kernel**2)
    bias = np.log(raw.opacity_bias / (1 - raw.opacity_bias))
    opacity = 1 / (1 + np.exp(-(raw.opacity[:, 0] + bias)))
    scene = Scene(
        (raw.xyz * raw.aabb[3:] + raw.aabb[:3]).astype(np.float32),
        np.log(scales).astype(np.float32),
        normalized(raw.rotation + [1.0, 0, 0, 0]).astype(np.float32),
        logit(opacity),
        raw.features_dc[:, 0, :].astype(np.float32),
        np.zeros((len(raw.xyz), 0), np.float32),
    )
    return moved(scene, FROM_MEMORY)


def from_file(data: bytes) -> Scene:
    """A scene that TRELLIS wrote with `save_ply`."""
    return moved(Scene.decode(data), FROM_FILE)
