"""GaussianEditor: a scene refined towards edited views, with its own anchor loss.

Y. Chen et al., "GaussianEditor: Swift and Controllable 3D Editing with Gaussian Splatting", CVPR 2024. The model, its
rasteriser, its learning rates and its anchor loss are the original code; the edited views come from the graph instead of
from a diffusion model inside.
"""

from __future__ import annotations

import os
import tempfile
from argparse import ArgumentParser
from functools import lru_cache
from pathlib import Path

import numpy as np

from gear_sdk import Annotated, Context, NodeFailure, Plugin, Report, Scene, Views, flag, integer, number, weights

plugin = Plugin("gaussian-editor")


@plugin.states
def states() -> dict:
    return {"code": weights.checkout(os.environ.get("GAUSSIAN_EDITOR_REPO")), **weights.versions("torch", "diff-gaussian-rasterization", "simple-knn")}


@lru_cache(maxsize=1)
def original():
    """The parts of the original code that are used."""
    how = "clone it with its submodules, install requirements.txt and its two extensions"
    with weights.importing("GaussianEditor", "GAUSSIAN_EDITOR_REPO", how):
        from gaussiansplatting.arguments import OptimizationParams, PipelineParams
        from gaussiansplatting.gaussian_renderer import render
        from gaussiansplatting.scene.cameras import Simple_Camera
        from gaussiansplatting.scene.gaussian_model import GaussianModel
    return GaussianModel, Simple_Camera, render, PipelineParams, OptimizationParams


@plugin.node(
    outputs={
        "scene": (Scene, "The refined scene, with the camera of the one given."),
        "curve": (Report, "Loss by iteration, and the number of Gaussians before and after."),
    },
    deterministic=False,
)
def GaussianEditor(
    ctx: Context,
    scene: Annotated[Scene, "The scene to refine."],
    targets: Annotated[Views, "What its views should look like, with weights."],
    *,
    iterations: int = integer(1500, "Steps of the optimiser.", min=1, max=100000),
    anchor_geometry: float = number(50.0, "Weight of the anchor of centres and rotations.", min=0),
    anchor_scale: float = number(50.0, "Weight of the anchor of scales.", min=0),
    anchor_opacity: float = number(50.0, "Weight of the anchor of opacities.", min=0),
    anchor_color: float = number(5.0, "Weight of the anchor of colours.", min=0),
    densify: bool = flag(False, "Whether Gaussians may be split and removed on the way, as the original does."),
    seed: int = integer(0, "Seed of the order of the views.", min=0, max=2147483647),
):
    """GaussianEditor: a scene refined towards edited views, held by the anchor of the original code.

    Stands in the place of `Refine`. Needs a CUDA GPU and the code of GaussianEditor with its rasteriser."""
    import torch
    from convert import pinhole

    if len(scene) == 0 or not targets.views:
        raise NodeFailure(f"the scene has {len(scene)} Gaussians and there are {len(targets.views)} targets; expected some of both")
    GaussianModel, Simple_Camera, render, PipelineParams, OptimizationParams = original()
    middle = np.median(scene.centers, axis=0)
    extent = float(np.linalg.norm(scene.centers - middle, axis=1).max()) or 1.0
    torch.manual_seed(seed)
    with tempfile.TemporaryDirectory() as folder:
        source, result = Path(folder, "scene.ply"), Path(folder, "out.ply")
        source.write_bytes(scene.encode())
        parser = ArgumentParser()
        options, pipe = OptimizationParams(parser, iterations), PipelineParams(parser)
        model = GaussianModel(0, anchor_weight_init_g0=1.0, anchor_weight_init=0.1, anchor_weight_multiplier=2)
        model.load_ply(str(source))
        model.max_radii2D = torch.zeros(len(scene), device="cuda")
        model.spatial_lr_scale = extent
        model.training_setup(options)
        views = []
        for i, view in enumerate(targets.views):
            pin = pinhole(view.camera, middle, extent)
            camera = Simple_Camera(i, pin.R, pin.T, pin.fov_x, pin.fov_y, pin.height, pin.width, view.name, i)
            # The far plane only scales what the rasteriser throws away again.
            weight = np.ones(view.rgb.shape[:2]) if view.weight is None else view.weight
            as_cuda = lambda a: torch.tensor(np.ascontiguousarray(a), dtype=torch.float32, device="cuda")  # noqa: E731
            views.append((camera, as_cuda(np.moveaxis(view.rgb, -1, 0)), as_cuda(weight)))
        white = torch.ones(3, device="cuda")
        anchors = {"geo": anchor_geometry, "scale": anchor_scale, "opacity": anchor_opacity, "color": anchor_color}
        order = np.random.default_rng(seed)
        curve = []
        for i in range(iterations):
            camera, wanted, weight = views[int(order.integers(len(views)))]
            model.update_learning_rate(i + 1)
            package = render(camera, model, pipe, white)
            loss = ((package["render"] - wanted).abs() * weight).mean()
            anchored = model.anchor_loss()
            for name, factor in anchors.items():
                loss = loss + factor * anchored[f"loss_anchor_{name}"]
            loss.backward()
            if densify and i % 100 == 99 and i < iterations // 2:
                with torch.no_grad():
                    model.add_densification_stats(package["viewspace_points"].grad, package["visibility_filter"])
                    model.densify_and_prune(1e-7, 0.01, 0.005, extent, 5)
            model.optimizer.step()
            model.optimizer.zero_grad(set_to_none=True)
            if i % 10 == 0 or i + 1 == iterations:
                curve.append([i, float(loss)])
                ctx.progress((i + 1) / iterations, f"loss {float(loss):.4f}")
        model.save_ply(str(result))
        refined = Scene.decode(result.read_bytes())
    refined.camera = scene.camera
    report = {"loss": curve, "gaussians_before": len(scene), "gaussians_after": len(refined)}
    return {"scene": refined, "curve": Report(report)}


if __name__ == "__main__":
    plugin.serve()
