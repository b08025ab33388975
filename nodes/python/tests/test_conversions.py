"""Scenes from files and arrays in the original formats' layout: activations, biases, axes."""

import importlib.util
import struct
import sys
import unittest
from pathlib import Path

import numpy as np

from gear_sdk import Camera, NodeFailure, Pinhole
from gear_sdk.cutout import centred
from gear_sdk.geometry import multiply, normalized, to_matrix
from gear_sdk.values import SH_C0

ROOT = Path(__file__).parent.parent


def conversions(folder):
    spec = importlib.util.spec_from_file_location(f"{folder}_convert", ROOT / folder / "convert.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


trellis, lgm, splatter, editor = map(conversions, ("trellis", "lgm", "splatter_image", "gaussian_editor"))


def vertices(names, table):
    """A PLY file as `plyfile` writes it, byte by byte."""
    head = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(table)
    head += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    return head.encode() + b"".join(struct.pack(f"<{len(names)}f", *row) for row in table)


def rotation_matrices(scene):
    return to_matrix(scene.rotations)


def close(test, a, b, tolerance=2e-5):
    """The same Gaussians: also with quaternions of the other sign."""
    for name in ("centers", "log_scales", "opacity_logits", "sh_dc"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=tolerance, rtol=1e-4, err_msg=name)
    np.testing.assert_allclose(rotation_matrices(a), rotation_matrices(b), atol=tolerance)


class Trellis(unittest.TestCase):
    def raw(self, activation="softplus"):
        random = np.random.default_rng(8)
        n = 50
        return trellis.Raw(
            random.random((n, 3)), random.normal(size=(n, 1, 3)), random.normal(size=(n, 3)), 0.3 * random.normal(size=(n, 4)),
            random.normal(size=(n, 1)), np.array([-0.5, -0.5, -0.5, 1, 1, 1]), 4e-3, 0.1, 9e-4, activation,
        )  # fmt: skip

    def file(self, raw):
        """What its `save_ply` writes: positions and rotations turned, logits of opacities, logarithms of scales, one by
        one as the formulas in its class say."""
        turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        rows = []
        for i in range(len(raw.xyz)):
            xyz = turn @ (raw.xyz[i] * raw.aabb[3:] + raw.aabb[:3])
            b = raw.scaling_bias
            if raw.activation == "softplus":
                inverse = b + np.log(-np.expm1(-b))
                scale = np.log1p(np.exp(raw.scaling[i] + inverse))
            else:
                scale = np.exp(raw.scaling[i] + np.log(b))
            scale = np.log(np.sqrt(scale**2 + raw.kernel**2))
            opacity = 1 / (1 + np.exp(-(raw.opacity[i, 0] + np.log(raw.opacity_bias / (1 - raw.opacity_bias)))))
            # A quarter turn about x is (√½, √½, 0, 0).
            q = normalized(multiply([0.5**0.5, 0.5**0.5, 0, 0], raw.rotation[i] + [1, 0, 0, 0]))
            rows.append([*xyz, 0, 0, 0, *raw.features_dc[i, 0], np.log(opacity / (1 - opacity)), *scale, *q])
        names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
        return vertices(names + [f"scale_{i}" for i in range(3)] + [f"rot_{i}" for i in range(4)], rows)

    def test_memory_and_file_give_one_scene(self):
        for activation in ("softplus", "exp"):
            raw = self.raw(activation)
            close(self, trellis.from_memory(raw), trellis.from_file(self.file(raw)))

    def test_zero_is_what_the_biases_say(self):
        raw = self.raw()
        for name in ("scaling", "rotation", "opacity"):
            getattr(raw, name)[:] = 0
        raw.kernel = 0.0
        scene = trellis.from_memory(raw)
        np.testing.assert_allclose(scene.scales, 4e-3, rtol=1e-5)
        np.testing.assert_allclose(scene.opacities, 0.1, rtol=1e-5)

    def test_the_kernel_is_the_smallest_scale(self):
        raw = self.raw()
        raw.scaling[:] = -50
        np.testing.assert_allclose(trellis.from_memory(raw).scales, 9e-4, rtol=1e-5)

    def test_up_stays_up_and_the_front_faces_the_viewer(self):
        raw = self.raw()
        raw.xyz[:3] = [[0.5, 0.5, 1.0], [0.5, 0.0, 0.5], [1.0, 0.5, 0.5]]
        top, front, right = trellis.from_memory(raw).centers[:3]
        np.testing.assert_allclose(top, [0, 0.5, 0], atol=1e-6)
        np.testing.assert_allclose(front, [0, 0, 0.5], atol=1e-6)
        np.testing.assert_allclose(right, [0.5, 0, 0], atol=1e-6)

    def test_a_gaussian_turns_with_its_place(self):
        """A needle along z in TRELLIS's world stands upright in ours."""
        raw = self.raw()
        raw.scaling[:] = [-3, -3, 5]
        raw.rotation[:] = 0
        scene = trellis.from_memory(raw)
        along = rotation_matrices(scene)[0] @ np.array([0, 0, 1.0])
        np.testing.assert_allclose(np.abs(along), [0, 1, 0], atol=1e-6)


class Lgm(unittest.TestCase):
    def test_memory_and_file_give_one_scene_without_the_faint(self):
        random = np.random.default_rng(9)
        n = 60
        q = normalized(random.normal(size=(n, 4)))
        g = np.concatenate(
            [random.uniform(-1, 1, (n, 3)), random.random((n, 1)), random.uniform(0.001, 0.1, (n, 3)), q, random.random((n, 3))],
            axis=1,
        )
        g[:7, 3] = 0.004
        kept = g[7:]
        table = np.concatenate(
            [
                kept[:, :3],
                (kept[:, 11:] - 0.5) / 0.28209479177387814,
                np.log(kept[:, 3:4] / (1 - kept[:, 3:4])),
                np.log(kept[:, 4:7] + 1e-8),
                kept[:, 7:11],
            ],
            axis=1,
        )
        names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
        data = vertices(names + [f"scale_{i}" for i in range(3)] + [f"rot_{i}" for i in range(4)], table)
        scene = lgm.from_memory(g)
        self.assertEqual(len(scene), n - 7)
        close(self, scene, lgm.from_file(data))
        np.testing.assert_allclose(scene.colors, kept[:, 11:], atol=1e-6)


class SplatterImage(unittest.TestCase):
    def test_every_gaussian_is_seen_where_the_network_saw_it(self):
        """The network's rays go through the pixels of its picture; the scene's camera must show each Gaussian at the pixel
        of the painting that this was."""
        random = np.random.default_rng(10)
        side, fov, width, height = 128, 49.13, 300, 200
        mask = np.zeros((height, width), bool)
        mask[40:160, 170:240] = True
        cut = centred(np.zeros((height, width, 3)), mask, side, 0.65)
        # x right, y down, pixel centres at half integers from the middle: its `init_ray_dirs`, inverted in y.
        at = np.arange(side) - side / 2 + 0.5
        focal = side / 2 / np.tan(np.radians(fov) / 2)
        x, y = np.meshgrid(at, at)
        depth = random.uniform(1.5, 2.5, (side, side))
        xyz = np.stack([x / focal * depth, y / focal * depth, depth], axis=-1).reshape(-1, 3)
        n = len(xyz)
        scene = splatter.from_memory(
            xyz, np.full((n, 1), 0.9), np.full((n, 3), 0.01), np.tile([1.0, 0, 0, 0], (n, 1)), np.zeros((n, 1, 3)),
            random.normal(size=(n, 3, 3)), fov_degrees=fov, cut=cut, width=width, height=height,
        )  # fmt: skip
        seen = scene.camera.project(scene.centers)
        wanted_x = cut.left + (np.arange(side) + 0.5) * cut.size / side - 0.5
        wanted_y = cut.top + (np.arange(side) + 0.5) * cut.size / side - 0.5
        gx, gy = np.meshgrid(wanted_x, wanted_y)
        np.testing.assert_allclose(seen[:, 0], gx.ravel(), atol=2e-3)
        np.testing.assert_allclose(seen[:, 1], gy.ravel(), atol=2e-3)
        self.assertIsInstance(scene.camera.projection, Pinhole)
        # Nearer to the camera is nearer to the viewer.
        near, far = np.argmin(xyz[:, 2]), np.argmax(xyz[:, 2])
        self.assertGreater(scene.centers[near, 2], scene.centers[far, 2])
        # At the median depth the longer side of the painting is one unit.
        unit = np.median(seen[:, 2]) / scene.camera.projection.focal_px * max(width, height)
        self.assertAlmostEqual(unit, 1.0, places=3)

    def test_harmonics_are_put_channel_by_channel_and_turned(self):
        rest = np.arange(9, dtype=np.float32).reshape(1, 3, 3)
        cut = centred(np.zeros((4, 4, 3)), np.ones((4, 4), bool), 4, 1.0)
        scene = splatter.from_memory(
            np.array([[0, 0, 2.0]]), np.array([[0.9]]), np.ones((1, 3)), np.array([[1.0, 0, 0, 0]]), np.zeros((1, 1, 3)), rest,
            fov_degrees=50.0, cut=cut, width=4, height=4,
        )  # fmt: skip
        # Half a turn about x turns round y and z, the first two coefficients of a channel.
        np.testing.assert_allclose(scene.sh_rest[0], [-0, -3, 6, -1, -4, 7, -2, -5, 8], atol=1e-6)

    def test_what_is_faint_is_left_out(self):
        cut = centred(np.zeros((4, 4, 3)), np.ones((4, 4), bool), 4, 1.0)
        scene = splatter.from_memory(
            np.ones((2, 3)), np.array([[0.9], [0.001]]), np.ones((2, 3)), np.ones((2, 4)), np.zeros((2, 1, 3)),
            np.zeros((2, 3, 3)), fov_degrees=50.0, cut=cut, width=4, height=4,
        )  # fmt: skip
        self.assertEqual(len(scene), 1)


class GaussianEditor(unittest.TestCase):
    def seen(self, pin, points):
        """3DGS: p = Rᵀ x + T, ndc = p / (z tan(fov / 2)), pixel = ((ndc + 1) · side − 1) / 2."""
        p = points @ pin.R + pin.T
        ndc = p[:, :2] / p[:, 2:] / np.tan([pin.fov_x / 2, pin.fov_y / 2])
        return ((ndc + 1) * [pin.width, pin.height] - 1) / 2

    def test_a_far_pinhole_sees_what_an_orthographic_camera_sees(self):
        points = np.random.default_rng(11).uniform(-0.5, 0.5, (200, 3))
        camera = Camera.front(640, 480)
        pin = editor.pinhole(camera, np.zeros(3), 0.9)
        difference = np.abs(self.seen(pin, points) - camera.project(points)[:, :2]).max()
        self.assertLess(difference, 640 * 0.5 * 0.5 / 900 * 1.01)

    def test_a_pinhole_stays_as_it_is(self):
        points = np.random.default_rng(12).uniform(-0.5, 0.5, (200, 3))
        camera = Camera.front(640, 480)
        camera.projection, camera.translation = Pinhole(700.0), np.array([0.1, 0.2, 3.0])
        pin = editor.pinhole(camera, np.zeros(3), 0.9)
        np.testing.assert_allclose(self.seen(pin, points), camera.project(points)[:, :2], atol=1e-9)

    def test_a_camera_that_is_not_centred_is_refused(self):
        camera = Camera.front(64, 48)
        camera.principal = camera.principal + 3
        with self.assertRaisesRegex(NodeFailure, "not centred"):
            editor.pinhole(camera, np.zeros(3), 1.0)


class Cutouts(unittest.TestCase):
    def test_the_figure_fills_its_share_and_nothing_else_is_shown(self):
        rgb = np.full((60, 80, 3), 0.25, np.float32)
        mask = np.zeros((60, 80), bool)
        mask[10:50, 30:50] = True
        cut = centred(rgb, mask, 100, 0.8, background=1.0)
        ys, xs = np.nonzero(cut.alpha > 0.5)
        self.assertEqual((ys.max() - ys.min() + 1, xs.max() - xs.min() + 1), (80, 40))
        np.testing.assert_allclose(cut.rgb[50, 50], 0.25, atol=1e-6)
        np.testing.assert_allclose(cut.rgb[50, 5], 1.0)

    def test_a_figure_at_the_edge_is_centred_too(self):
        mask = np.zeros((30, 30), bool)
        mask[:10, :10] = True
        cut = centred(np.ones((30, 30, 3)), mask, 20, 0.5, background=0.0)
        self.assertEqual((cut.left, cut.top, cut.size), (-5.0, -5.0, 20.0))
        np.testing.assert_allclose(cut.alpha[5:15, 5:15], 1.0)

    def test_an_empty_mask_is_told(self):
        with self.assertRaisesRegex(NodeFailure, "no figure"):
            centred(np.zeros((4, 4, 3)), np.zeros((4, 4), bool), 8, 0.8)


class Colours(unittest.TestCase):
    def test_the_constant_is_that_of_3dgs(self):
        self.assertAlmostEqual(SH_C0, 1 / (2 * np.sqrt(np.pi)), places=15)


if __name__ == "__main__":
    unittest.main()
