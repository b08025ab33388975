"""Finds how a scene without a pose stands to its painting.

TRELLIS and LGM make an object about its own centre, at a size of their own, and TRELLIS turns it as it likes. Everything
after them wants a scene that shows the painting under a camera. The object is turned about the upward axis in steps, and
for each direction scaled and shifted until the box of its silhouette is that of the mask; the direction whose silhouette
overlaps the mask best (intersection over union, IoU) is taken, where the colours decide between a direction and its
mirror image, which have nearly one silhouette. Pictures are small, since this asks for degrees and not for pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Dict, Optional, Tuple

import numpy as np

from .context import Context, NodeFailure
from .geometry import about_y, moved
from .params import number, or_auto
from .values import Camera, Image, Mask, Report, Scene

SIDE = 96
"""Longer side of the pictures that are compared."""

COLOUR = 0.3
"""How much the mean difference of colours (0 to 1) counts against the overlap."""

VISIBLE = 0.3
"""A Gaussian less opaque than this makes no silhouette."""

COVERED = 0.5
"""With less overlap than this the user is told that the front may be another side."""

YAW = or_auto(number(None, "By how much the object is turned to face the viewer; auto finds it.", min=-180, max=180, unit="degrees"))
"""The parameter of a node that places its scene."""

OUTPUTS = {
    "scene": (Scene, "The object, placed so that it shows the painting under its camera."),
    "report": (Report, "How it was placed: direction, scale, overlap of silhouette and mask; number of Gaussians."),
}
"""The outputs of a node that places its scene, as :func:`placed` gives them."""


@dataclass
class Fit:
    """How a scene was placed."""

    scene: Scene
    """The scene in gear's world, with the painting's camera."""
    yaw: float
    """Degrees by which it was turned."""
    scale: float
    """Factor by which it was scaled."""
    iou: float
    """Overlap of silhouette and mask, 0 to 1."""


def _shrunk(mask: np.ndarray, rgb: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    height, width = mask.shape
    step = max(height, width) / min(SIDE, max(height, width))
    ys = np.minimum((np.arange(max(1, round(height / step))) + 0.5) * step, height - 1).astype(int)
    xs = np.minimum((np.arange(max(1, round(width / step))) + 0.5) * step, width - 1).astype(int)
    return mask[np.ix_(ys, xs)], rgb[np.ix_(ys, xs)]


def _box(mask: np.ndarray) -> np.ndarray:
    ys, xs = np.nonzero(mask)
    return np.array([xs.min(), ys.min(), xs.max() + 1, ys.max() + 1], np.float64)


def _picture(points: np.ndarray, radii: np.ndarray, colors: np.ndarray, shape: Tuple[int, int]) -> Tuple[np.ndarray, np.ndarray]:
    """Silhouette and colours of points (x, y in pixels, depth rising away from the viewer)."""
    height, width = shape
    near_last = np.argsort(-points[:, 2], kind="stable")
    x, y = points[near_last, 0], points[near_last, 1]
    radii, colors = radii[near_last], colors[near_last]
    seen = np.zeros(shape, bool)
    rgb = np.zeros((*shape, 3))
    reach = int(min(4, np.ceil(radii.max(initial=0.5))))
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            keep = (dx * dx + dy * dy) <= np.maximum(radii, 0.5) ** 2
            ix, iy = np.floor(x[keep]).astype(int) + dx, np.floor(y[keep]).astype(int) + dy
            inside = (ix >= 0) & (ix < width) & (iy >= 0) & (iy < height)
            ix, iy = ix[inside], iy[inside]
            if (dx, dy) == (0, 0):
                rgb[iy, ix] = colors[keep][inside]
            else:
                fresh = ~seen[iy, ix]
                rgb[iy[fresh], ix[fresh]] = colors[keep][inside][fresh]
            seen[iy, ix] = True
    return seen, rgb


def place(scene: Scene, mask: np.ndarray, rgb: np.ndarray, yaw: Optional[float] = None) -> Fit:
    """Places a scene (y up, about any centre) so that it shows the painting under its camera. `mask` and `rgb` are the
    painting's, shape (height, width[, 3]); `yaw` fixes the direction."""
    height, width = mask.shape
    visible = scene.opacities > VISIBLE
    if not mask.any():
        raise NodeFailure("the mask has no pixel inside, so there is nothing to place the scene by")
    if not visible.any():
        raise NodeFailure("no Gaussian of the scene is more opaque than 0.3, so it has no silhouette")
    centers = np.asarray(scene.centers, np.float64)[visible]
    radii = np.exp(np.median(np.asarray(scene.log_scales, np.float64)[visible], axis=1))
    colors = np.clip(scene.colors[visible], 0, 1)
    small, small_rgb = _shrunk(mask, np.nan_to_num(rgb))
    box = _box(small)

    def attempt(degrees: float) -> Tuple[float, float, float, np.ndarray]:
        turned = centers @ about_y(degrees).T
        flat = turned * [1, -1, -1]
        low, high = np.percentile(flat[:, :2], 0.5, axis=0), np.percentile(flat[:, :2], 99.5, axis=0)
        extent = np.maximum(high - low, 1e-9)
        # One factor for both axes: the one that makes the boxes equally large.
        scale = float(np.sqrt(np.prod(box[2:] - box[:2]) / np.prod(extent)))
        shift = (box[:2] + box[2:]) / 2 - scale * (low + high) / 2
        points = np.concatenate([flat[:, :2] * scale + shift, flat[:, 2:]], axis=1)
        seen, picture = _picture(points, radii * scale, colors, small.shape)
        both = seen & small
        iou = both.sum() / max(1, (seen | small).sum())
        difference = np.abs(picture - small_rgb)[both].mean() if both.any() else 1.0
        return float(iou - COLOUR * difference), float(iou), scale, shift

    if yaw is None:
        coarse = np.arange(0.0, 360.0, 15.0)
        best = max(coarse, key=lambda degrees: attempt(degrees)[0])
        for step in (5.0, 1.0):
            best = max(best + step * np.arange(-2, 3), key=lambda degrees: attempt(degrees)[0])
        yaw = float((best + 180.0) % 360.0 - 180.0)
    _, iou, scale, shift = attempt(yaw)
    # From pixels of the small picture to those of the painting, to world units of the front camera.
    zoom = np.array([width / small.shape[1], height / small.shape[0]])
    longer = max(width, height)
    factor = scale * float(np.sqrt(np.prod(zoom))) / longer
    offset = (shift * zoom - np.array([width, height]) / 2) / longer
    depth = -factor * float(np.median((centers @ about_y(yaw).T)[:, 2]))
    placed = moved(scene, about_y(yaw), factor, np.array([offset[0], -offset[1], depth]))
    return Fit(replace(placed, camera=Camera.front(width, height)), yaw, factor, iou)


def placed(ctx: Context, scene: Scene, image: Image, mask: Mask, yaw: Any) -> Dict[str, Any]:
    """The :data:`OUTPUTS` of a node whose network made `scene` of the figure in a picture; `yaw` is the parameter
    :data:`YAW`. A silhouette that covers the mask badly is told."""
    fit = place(scene, mask.inside, image.rgb, None if yaw == "auto" else float(yaw))
    if fit.iou < COVERED:
        ctx.note(f"the silhouette covers the mask badly (overlap {fit.iou:.2f}); the front may be another side")
    report = {"gaussians": len(scene), "yaw_degrees": fit.yaw, "scale": fit.scale, "silhouette_iou": fit.iou}
    return {"scene": fit.scene, "report": Report(report)}
