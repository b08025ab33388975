"""FLUX.1 Kontext: pictures edited by words, with diffusers.

Black Forest Labs, "FLUX.1 Kontext: Flow Matching for In-Context Image Generation and Editing in Latent Space", 2025.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import lru_cache

import numpy as np

from gear_sdk import Annotated, Context, Image, NodeFailure, Plugin, Views, integer, number, text, weights

plugin = Plugin("flux-kontext")

WEIGHTS = os.environ.get("FLUX_KONTEXT_WEIGHTS", "black-forest-labs/FLUX.1-Kontext-dev")
DEVICE = os.environ.get("FLUX_KONTEXT_DEVICE", "cuda")

SCULPTURE = (
    "Turn this painting into a photograph of a white marble relief of the same scene, lit softly from the upper left, with "
    "natural shading. Keep every outline, pose and proportion exactly where it is."
)
RESTORE = (
    "Paint this in the style of the original painting: the same colours, brush strokes and materials, on every visible "
    "surface. Keep every outline, pose and proportion exactly where it is."
)

FEWEST_PIXELS = 64
"""Below this the latents of an edited side have no pixel left."""


@plugin.states
def states() -> dict:
    return {
        "weights": weights.model(WEIGHTS),
        "device": DEVICE.split(":")[0],
        **weights.versions("torch", "diffusers", "transformers"),
    }


@lru_cache(maxsize=1)
def pipeline():
    try:
        import torch
        from diffusers import FluxKontextPipeline
    except ImportError as error:
        raise NodeFailure(f"diffusers cannot be imported ({error}); install requirements.txt beside plugin.yaml") from error
    kind = torch.float32 if DEVICE == "cpu" else torch.bfloat16
    loaded = FluxKontextPipeline.from_pretrained(WEIGHTS, torch_dtype=kind)
    loaded.set_progress_bar_config(disable=True)
    return loaded.to(DEVICE)


def size_for(width: int, height: int, area: int) -> tuple:
    """The size that is edited: about this area, the picture's shape, sides that are multiples of 16."""
    zoom = (area / (width * height)) ** 0.5
    return tuple(max(FEWEST_PIXELS, int(round(side * zoom / 16)) * 16) for side in (width, height))


def edited(ctx: Context, rgb: np.ndarray, prompt: str, seed: int, steps: int, guidance: float, area: int, part: tuple) -> np.ndarray:
    """The picture, edited, at its own size again. `part` is what share of the node's work it is: from, to."""
    import torch
    from PIL import Image as Picture

    height, width = rgb.shape[:2]
    size = size_for(width, height, area)
    picture = Picture.fromarray(Image(rgb).to_uint8()).resize(size, Picture.Resampling.LANCZOS)

    def step(_pipeline, index, _time, values):
        ctx.progress(part[0] + (part[1] - part[0]) * (index + 1) / steps)
        return values

    result = pipeline()(
        image=picture,
        prompt=prompt,
        width=size[0],
        height=size[1],
        max_area=size[0] * size[1],
        _auto_resize=False,
        num_inference_steps=steps,
        guidance_scale=guidance,
        # On the CPU, so that a seed means the same on every GPU.
        generator=torch.Generator("cpu").manual_seed(seed),
        callback_on_step_end=step,
        output_type="pil",
    ).images[0]
    back = result.convert("RGB").resize((width, height), Picture.Resampling.LANCZOS)
    return Image.from_uint8(np.asarray(back)).rgb


PARAMS = dict(
    seed=integer(0, "Seed of the noise that it begins with.", min=0, max=2147483647),
    steps=integer(28, "Steps of the sampler.", min=1, max=200),
    guidance=number(2.5, "How closely it follows the words.", min=0, max=30),
    area=integer(1048576, "Area at which the picture is edited; what comes out has the size of what goes in.", min=4096, max=4194304, unit="px²"),
)


@plugin.node(outputs={"image": (Image, "The edited picture, the size of the one given.")}, deterministic=False)
def FluxKontext(
    ctx: Context,
    image: Annotated[Image, "The picture to edit."],
    *,
    prompt: str = text(SCULPTURE, "What to make of it: T_g of the paper."),
    seed: int = PARAMS["seed"],
    steps: int = PARAMS["steps"],
    guidance: float = PARAMS["guidance"],
    area: int = PARAMS["area"],
):
    """FLUX.1 Kontext: a picture edited by words.

    Needs a CUDA GPU with 32 GB and the weights, which are licensed for non-commercial use. Its default words ask for what
    geometry grounding wants: the same scene with coherent shape and light."""
    ctx.progress(0.0, "loading")
    pipeline()
    return Image(edited(ctx, image.rgb, prompt, seed, steps, guidance, area, (0.1, 1.0)), image.alpha)


@plugin.node(
    outputs={"targets": (Views, "The views with edited colours and a weight for every pixel: their coverage.")},
    deterministic=False,
)
def FluxKontextViews(
    ctx: Context,
    views: Annotated[Views, "The views to edit, with their coverage."],
    *,
    prompt: str = text(RESTORE, "What to make of them: T_a of the paper."),
    seed: int = PARAMS["seed"],
    steps: int = PARAMS["steps"],
    guidance: float = PARAMS["guidance"],
    area: int = PARAMS["area"],
):
    """FLUX.1 Kontext on every view of a scene, each with the same words and seed.

    Stands in the place of `Edit`: cameras, coverage, depth and normals stay as they came. Needs what `FluxKontext`
    needs."""
    ctx.progress(0.0, "loading")
    pipeline()
    done = []
    for i, view in enumerate(views.views):
        share = (0.1 + 0.9 * i / len(views.views), 0.1 + 0.9 * (i + 1) / len(views.views))
        rgb = edited(ctx, view.rgb, prompt, seed, steps, guidance, area, share)
        weight = np.ones(rgb.shape[:2], np.float32) if view.alpha is None else np.clip(view.alpha, 0, 1)
        done.append(replace(view, rgb=rgb, weight=weight))
    return Views(done)


if __name__ == "__main__":
    plugin.serve()
