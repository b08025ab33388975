"""Gaussians as LGM gives them, as gear's.

`forward_gaussians` gives (1, n, 14) after all activations: centre, opacity, scale, rotation (w, x, y, z), colour 0 to 1. Its
world is that of its cameras (kiui's `orbit_camera`): y upwards, and the camera of azimuth 0, which sees the picture, on +z:
gear's world. Its `save_ply` leaves out what is less opaque than 0.005, and so does this.
"""

from __future__ import annotations

import numpy as np

from gear_sdk import Scene
from gear_sdk.geometry import normalized
from gear_sdk.values import SH_C0, logit

FAINT = 0.005


def from_memory(gaussians: np.ndarray) -> Scene:
    """The scene, about the origin; `gaussians` of shape (n, 14)."""
    kept = np.asarray(gaussians, np.float64)
    kept = kept[kept[:, 3] >= FAINT]
    return Scene(
        kept[:, 0:3].astype(np.float32),
        np.log(kept[:, 4:7] + 1e-8).astype(np.float32),
        normalized(kept[:, 7:11]).astype(np.float32),
        logit(kept[:, 3]),
        ((kept[:, 11:14] - 0.5) / SH_C0).astype(np.float32),
        np.zeros((len(kept), 0), np.float32),
    )


def from_file(data: bytes) -> Scene:
    """A scene that LGM wrote with `save_ply(…, compatible=True)`, its default."""
    return Scene.decode(data)
