"""LGM: one picture to 3D Gaussians by way of four.

J. Tang et al., "LGM: Large Multi-View Gaussian Model for High-Resolution 3D Content Creation", ECCV 2024; the four pictures
are made by ImageDream (P. Wang, Y. Shi, 2023).
"""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np

from gear_sdk import Annotated, Context, Image, Mask, NodeFailure, Plugin, integer, number, weights
from gear_sdk.cutout import centred
from gear_sdk.pose import OUTPUTS, YAW, placed

plugin = Plugin("lgm")

WEIGHTS = os.environ.get("LGM_WEIGHTS", "ashawkey/LGM")
IMAGEDREAM = os.environ.get("IMAGEDREAM_WEIGHTS", "ashawkey/imagedream-ipmv-diffusers")

# What DINO was trained with, and LGM after it.
MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


@plugin.states
def states() -> dict:
    return {
        "code": weights.checkout(os.environ.get("LGM_REPO")),
        "weights": weights.model(WEIGHTS),
        "imagedream": weights.model(IMAGEDREAM),
        **weights.versions("torch", "diffusers", "xformers", "kiui"),
    }


@lru_cache(maxsize=1)
def models():
    """LGM, the rays that go with its four cameras, and ImageDream."""
    with weights.importing("LGM", "LGM_REPO", "clone it, install requirements.txt and its rasteriser"):
        import torch
        from core.models import LGM
        from core.options import config_defaults
        from mvdream.pipeline_mvdream import MVDreamPipeline
        from safetensors.torch import load_file
    checkpoint = WEIGHTS
    if not os.path.isfile(checkpoint):
        from huggingface_hub import hf_hub_download

        checkpoint = hf_hub_download(WEIGHTS, "model_fp16_fixrot.safetensors")
    options = config_defaults["big"]
    options.lambda_lpips = 0.0  # the loss of its training; it would download a network for it
    model = LGM(options)
    missing, _ = model.load_state_dict(load_file(checkpoint, device="cpu"), strict=False)
    missing = [name for name in missing if not name.startswith("lpips_loss")]
    if missing:
        raise NodeFailure(f"the weights {checkpoint} lack {len(missing)} tensors, such as {missing[0]}")
    model = model.half().to("cuda").eval()
    dream = MVDreamPipeline.from_pretrained(IMAGEDREAM, torch_dtype=torch.float16, trust_remote_code=True).to("cuda")
    return model, model.prepare_default_rays("cuda"), dream


def four_views(dream, picture: np.ndarray, steps: int, guidance: float, seed: int) -> np.ndarray:
    """The object from azimuth 0, 90, 180 and 270, shape (4, 256, 256, 3), 0 to 1."""
    import torch

    torch.manual_seed(seed)
    views = dream("", picture, guidance_scale=guidance, num_inference_steps=steps, elevation=0)
    # ImageDream begins a quarter before the front.
    return np.stack([views[1], views[2], views[3], views[0]])


def gaussians(model, rays, views: np.ndarray) -> np.ndarray:
    """What LGM makes of four views, shape (n, 14)."""
    import torch
    from torch.nn.functional import interpolate

    size = model.opt.input_size
    pictures = torch.from_numpy(views).permute(0, 3, 1, 2).float().to("cuda")
    pictures = interpolate(pictures, size=(size, size), mode="bilinear", align_corners=False)
    mean, deviation = (torch.tensor(x, device="cuda").view(1, 3, 1, 1) for x in (MEAN, DEVIATION))
    inputs = torch.cat([(pictures - mean) / deviation, rays], dim=1).unsqueeze(0)
    with torch.no_grad(), torch.autocast(device_type="cuda", dtype=torch.float16):
        return model.forward_gaussians(inputs)[0].float().cpu().numpy()


@plugin.node(outputs=OUTPUTS, deterministic=False)
def Lgm(
    ctx: Context,
    image: Annotated[Image, "The picture of the object."],
    mask: Annotated[Mask, "Where in the picture the object is."],
    *,
    seed: int = integer(42, "Seed of the four views.", min=0, max=2147483647),
    steps: int = integer(30, "Steps of the sampler of the four views.", min=1, max=200),
    guidance: float = number(5.0, "How closely the four views follow the picture.", min=0, max=30),
    yaw: object = YAW,
):
    """LGM: an object in 3D from one picture.

    Needs a CUDA GPU with 10 GB, the code of LGM and the weights of LGM and ImageDream. The object has no pose; it is
    turned, scaled and shifted until its silhouette is that of the mask."""
    cut = centred(image.rgb, mask.inside, 512, 0.8, background=1.0)
    ctx.progress(0.0, "loading")
    model, rays, dream = models()
    ctx.progress(0.2, "four views")
    views = four_views(dream, cut.rgb, steps, guidance, seed)
    ctx.progress(0.8, "Gaussians")
    from convert import from_memory

    return placed(ctx, from_memory(gaussians(model, rays, views)), image, mask, yaw)


if __name__ == "__main__":
    plugin.serve()
