"""Splatter Image: one picture to one Gaussian a pixel.

S. Szymanowicz, C. Rupprecht, A. Vedaldi, "Splatter Image: Ultra-Fast Single-View 3D Reconstruction", CVPR 2024.
"""

from __future__ import annotations

import inspect
import os
from functools import lru_cache

from gear_sdk import Annotated, Context, Image, Mask, NodeFailure, Plugin, Scene, number, weights
from gear_sdk.cutout import centred

plugin = Plugin("splatter-image")

WEIGHTS = os.environ.get("SPLATTER_IMAGE_WEIGHTS", "szymanowiczs/splatter-image-multi-category-v1")


@plugin.states
def states() -> dict:
    return {"code": weights.checkout(os.environ.get("SPLATTER_IMAGE_REPO")), "weights": weights.model(WEIGHTS), **weights.versions("torch")}


@lru_cache(maxsize=1)
def predictor():
    """The network of all categories, and its configuration."""
    repo = os.environ.get("SPLATTER_IMAGE_REPO")
    if not repo:
        raise NodeFailure("set SPLATTER_IMAGE_REPO to the folder where Splatter Image was cloned")
    with weights.importing("Splatter Image", "SPLATTER_IMAGE_REPO", "clone it, install requirements.txt and its rasteriser"):
        import torch
        from omegaconf import OmegaConf
        from scene.gaussian_predictor import GaussianSplatPredictor
    config = OmegaConf.load(os.path.join(repo, "gradio_config.yaml"))
    if config.model.inverted_x or not config.model.inverted_y:
        raise NodeFailure("the configuration turns the axes otherwise than that of all categories; use gradio_config.yaml")
    checkpoint = WEIGHTS
    if not os.path.isfile(checkpoint):
        from huggingface_hub import hf_hub_download

        checkpoint = hf_hub_download(WEIGHTS, "model_latest.pth")
    model = GaussianSplatPredictor(config)
    # Only tensors are wanted of the file: it is not to run code.
    model.load_state_dict(torch.load(checkpoint, map_location="cpu", weights_only=True)["model_state_dict"])
    return model.to("cuda").eval(), config


def predict(model, picture) -> dict:
    """The activated prediction of a picture of shape (side, side, 3), in the camera's space, as arrays."""
    import torch

    identity = torch.eye(4, device="cuda")[None, None]
    no_turn = torch.tensor([1.0, 0, 0, 0], device="cuda")[None, None]
    inputs = torch.from_numpy(picture).permute(2, 0, 1).float().to("cuda")[None, None]
    # Later versions can leave out the activations; earlier ones always apply them.
    late = "activate_output" in inspect.signature(model.forward).parameters
    with torch.no_grad():
        out = model(inputs, identity, no_turn, None, **({"activate_output": False} if late else {}))
        if late:
            out["scaling"] = model.scaling_activation(out["scaling"])
            out["opacity"] = model.opacity_activation(out["opacity"])
    return {name: tensor[0].float().cpu().numpy() for name, tensor in out.items()}


@plugin.node(
    outputs={"scene": (Scene, "What the picture shows, under the network's own camera.")},
    deterministic=False,
)
def SplatterImage(
    ctx: Context,
    image: Annotated[Image, "The picture of the object."],
    mask: Annotated[Mask, "Where in the picture the object is."],
    *,
    foreground: float = number(0.65, "How much of the network's picture the object fills; it was trained with about this.", above=0.2, max=1.0, unit="share"),
):
    """Splatter Image: an object in 3D from one picture, one Gaussian a pixel of 128 by 128.

    Needs a CUDA GPU, the code of Splatter Image and its weights."""
    from convert import from_memory

    ctx.progress(0.0, "loading")
    model, config = predictor()
    cut = centred(image.rgb, mask.inside, int(config.data.training_resolution), foreground, background=1.0)
    ctx.progress(0.5, "predicting")
    out = predict(model, cut.rgb)
    height, width = mask.inside.shape
    return from_memory(
        out["xyz"],
        out["opacity"],
        out["scaling"],
        out["rotation"],
        out["features_dc"],
        out["features_rest"],
        fov_degrees=float(config.data.fov),
        cut=cut,
        width=width,
        height=height,
    )


if __name__ == "__main__":
    plugin.serve()
