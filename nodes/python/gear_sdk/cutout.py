"""A figure cut out of its picture, in the middle of a square, as image-to-3D networks want it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .context import NodeFailure


@dataclass
class Cutout:
    """A square picture of the figure, and where in the painting it lies."""

    rgb: np.ndarray
    """Shape (side, side, 3), 0 to 1, over the background."""
    alpha: np.ndarray
    """Shape (side, side), 0 to 1."""
    left: float
    """Left edge of the square in the painting, in pixels; the left edge of the painting is 0."""
    top: float
    size: float
    """Side of the square in pixels of the painting."""


def _sampled(planes: np.ndarray, left: float, top: float, size: float, side: int) -> np.ndarray:
    """Means over the pixels of the new picture, bilinear between those of the old; nothing is 0."""
    height, width = planes.shape[:2]
    fine = max(1, int(np.ceil(size / side)))
    step = size / (side * fine)
    places = (np.arange(side * fine) + 0.5) * step
    x, y = left + places - 0.5, top + places - 0.5

    def weights(at: np.ndarray, length: int):
        low = np.floor(at).astype(int)
        part = at - low
        out = []
        for index, weight in ((low, 1 - part), (low + 1, part)):
            out.append((np.clip(index, 0, length - 1), np.where((index >= 0) & (index < length), weight, 0.0)))
        return out

    rows = sum(planes[index] * weight[:, None, None] for index, weight in weights(y, height))
    whole = sum(rows[:, index] * weight[None, :, None] for index, weight in weights(x, width))
    return whole.reshape(side, fine, side, fine, -1).mean(axis=(1, 3))


def centred(rgb: np.ndarray, mask: np.ndarray, side: int, share: float, background: float = 1.0) -> Cutout:
    """The figure (mask, shape (height, width)) of a picture (shape (height, width, 3), 0 to 1) in the middle of a square
    of `side` pixels, its longer side `share` of that, over a grey."""
    if mask.shape != rgb.shape[:2]:
        raise NodeFailure(f"the mask has the shape {mask.shape}, the picture {rgb.shape[:2]}; expected the mask of this picture")
    ys, xs = np.nonzero(mask)
    if len(xs) == 0:
        raise NodeFailure("the mask has no pixel inside: there is no figure to cut out")
    box = np.array([xs.min(), ys.min(), xs.max() + 1, ys.max() + 1], np.float64)
    size = float(max(box[2] - box[0], box[3] - box[1]) / share)
    left, top = (box[0] + box[2] - size) / 2, (box[1] + box[3] - size) / 2
    alpha = mask.astype(np.float64)[..., None]
    clean = np.clip(np.nan_to_num(np.asarray(rgb, np.float64)), 0, 1)
    planes = _sampled(np.concatenate([clean * alpha, alpha], axis=-1), left, top, size, side)
    cover = planes[..., 3:]
    over = planes[..., :3] + background * (1 - cover)
    return Cutout(over.astype(np.float32), cover[..., 0].astype(np.float32), left, top, size)
