"""TRELLIS: one picture to 3D Gaussians.

J. Xiang et al., "Structured 3D Latents for Scalable and Versatile 3D Generation", CVPR 2025.
"""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np

from gear_sdk import Annotated, Context, Image, Mask, Plugin, integer, number, weights
from gear_sdk.cutout import centred
from gear_sdk.pose import OUTPUTS, YAW, placed

plugin = Plugin("trellis")

WEIGHTS = os.environ.get("TRELLIS_WEIGHTS", "microsoft/TRELLIS-image-large")


@plugin.states
def states() -> dict:
    return {"code": weights.checkout(os.environ.get("TRELLIS_REPO")), "weights": weights.model(WEIGHTS), **weights.versions("torch", "spconv-cu118", "spconv-cu120", "xformers")}


@lru_cache(maxsize=1)
def pipeline():
    with weights.importing("TRELLIS", "TRELLIS_REPO", "clone it with its submodules, install what its setup.sh installs"):
        from trellis.pipelines import TrellisImageTo3DPipeline
    loaded = TrellisImageTo3DPipeline.from_pretrained(WEIGHTS)
    loaded.cuda()
    return loaded


@plugin.node(outputs=OUTPUTS, deterministic=False)
def Trellis(
    ctx: Context,
    image: Annotated[Image, "The picture of the object."],
    mask: Annotated[Mask, "Where in the picture the object is."],
    *,
    seed: int = integer(1, "Seed of the two samplers.", min=0, max=2147483647),
    structure_steps: int = integer(12, "Steps of the sampler of the structure.", min=1, max=200),
    structure_guidance: float = number(7.5, "How closely the structure follows the picture.", min=0, max=30),
    latent_steps: int = integer(12, "Steps of the sampler of the latents.", min=1, max=200),
    latent_guidance: float = number(3.0, "How closely the latents follow the picture.", min=0, max=30),
    yaw: object = YAW,
):
    """TRELLIS: an object in 3D from one picture.

    Needs a CUDA GPU with 16 GB, the code of TRELLIS and its weights. The object has no pose; it is turned, scaled and
    shifted until its silhouette is that of the mask."""
    from PIL import Image as Picture

    # Its own preparation crops by alpha and multiplies it in; a square of 1024 is what it would shrink to anyway.
    cut = centred(image.rgb, mask.inside, 1024, 1 / 1.2, background=0.0)
    rgba = np.dstack([cut.rgb / np.maximum(cut.alpha, 1e-3)[..., None], cut.alpha])
    picture = Picture.fromarray((np.clip(rgba, 0, 1) * 255 + 0.5).astype(np.uint8), "RGBA")
    ctx.progress(0.0, "loading")
    loaded = pipeline()
    ctx.progress(0.1, "sampling")
    outputs = loaded.run(
        picture,
        seed=seed,
        formats=["gaussian"],
        sparse_structure_sampler_params={"steps": structure_steps, "cfg_strength": structure_guidance},
        slat_sampler_params={"steps": latent_steps, "cfg_strength": latent_guidance},
    )
    ctx.progress(0.9, "placing")
    from convert import Raw, from_memory

    return placed(ctx, from_memory(Raw.of(outputs["gaussian"][0])), image, mask, yaw)


if __name__ == "__main__":
    plugin.serve()
