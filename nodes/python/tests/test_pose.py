"""Rotations, and scenes placed before their painting."""

import unittest

import numpy as np

from gear_sdk import Context, Image, Mask, NodeFailure, Scene
from gear_sdk.geometry import about_y, from_matrix, moved, multiply, to_matrix
from gear_sdk.pose import OUTPUTS, _picture, place, placed
from gear_sdk.values import SH_C0


def figure(count=4000):
    """An L-shaped block, red in front and blue behind: no two directions look alike."""
    random = np.random.default_rng(5)
    foot = random.uniform([-0.3, -0.4, -0.15], [0.4, -0.1, 0.15], (count // 2, 3))
    body = random.uniform([-0.3, -0.4, -0.15], [0.0, 0.6, 0.15], (count - count // 2, 3))
    centers = np.concatenate([foot, body])
    colors = np.where(centers[:, 2:] > 0, [0.9, 0.1, 0.1], [0.1, 0.1, 0.9])
    return Scene(
        centers.astype(np.float32),
        np.full((count, 3), np.log(0.02), np.float32),
        np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        np.full(count, 4.0, np.float32),
        ((colors - 0.5) / SH_C0).astype(np.float32),
        np.zeros((count, 0), np.float32),
    )


def painted(scene, width, height, zoom, shift):
    """What a painter of the scene would paint: mask and colours."""
    pixels = scene.centers[:, :2] * [zoom, -zoom] + shift
    points = np.concatenate([pixels, -scene.centers[:, 2:]], axis=1)
    return _picture(points, np.full(len(scene), 2.0), scene.colors, (height, width))


class Rotations(unittest.TestCase):
    def test_quaternions_and_matrices_agree(self):
        q = np.random.default_rng(6).normal(size=(20, 4))
        for a, b in zip(q, q[::-1]):
            np.testing.assert_allclose(to_matrix(multiply(a, b)), to_matrix(a) @ to_matrix(b), atol=1e-12)
            np.testing.assert_allclose(to_matrix(from_matrix(to_matrix(a))), to_matrix(a), atol=1e-12)

    def test_harmonics_of_degree_one_turn_with_the_scene(self):
        """The colour seen along R d in the turned scene is the colour seen along d."""
        random = np.random.default_rng(7)
        one = figure(2)
        one.sh_rest = random.normal(size=(2, 9)).astype(np.float32)
        rotation = to_matrix(random.normal(size=4))
        turned = moved(one, rotation)

        def colour(scene, d):
            rest = scene.sh_rest.reshape(-1, 3, 3)
            return 0.48860251190291992 * (-d[1] * rest[..., 0] + d[2] * rest[..., 1] - d[0] * rest[..., 2])

        d = np.array([0.36, -0.48, 0.8])
        np.testing.assert_allclose(colour(turned, rotation @ d), colour(one, d), atol=1e-6)


class Placing(unittest.TestCase):
    def test_the_direction_size_and_place_are_found(self):
        front = figure()
        mask, rgb = painted(front, 200, 160, 120.0, [90.0, 85.0])
        # The reconstructor gives it back turned, at another size, elsewhere.
        given = moved(front, about_y(70.0), 1.7, np.array([0.3, -2.0, 0.5]))
        fit = place(given, mask, rgb)
        self.assertGreater(fit.iou, 0.8)
        self.assertLess(abs(fit.yaw + 70.0), 8.0, fit.yaw)
        pixels = fit.scene.camera.project(fit.scene.centers)[:, :2]
        wanted = front.centers[:, :2] * [120.0, -120.0] + [90.0, 85.0]
        self.assertLess(np.median(np.abs(pixels - wanted)), 4.0)
        self.assertEqual((fit.scene.camera.width, fit.scene.camera.height), (200, 160))

    def test_a_given_direction_is_kept(self):
        mask, rgb = painted(figure(), 100, 100, 70.0, [50.0, 50.0])
        self.assertEqual(place(figure(), mask, rgb, yaw=0.0).yaw, 0.0)

    def test_a_silhouette_that_covers_the_mask_badly_is_told(self):
        mask, rgb = painted(figure(), 100, 100, 70.0, [50.0, 50.0])
        for shown, notes in ((mask, 0), (np.eye(100, dtype=bool), 1)):
            ctx = Context()
            out = placed(ctx, figure(), Image(rgb.astype(np.float32)), Mask(shown), 0.0)
            self.assertEqual((out.keys(), len(ctx.notes)), (OUTPUTS.keys(), notes))
            self.assertEqual((out["report"].value["yaw_degrees"], out["report"].value["gaussians"]), (0.0, 4000))
        self.assertIn("overlap", ctx.notes[0])

    def test_nothing_to_place_by_is_told(self):
        with self.assertRaisesRegex(NodeFailure, "no pixel inside"):
            place(figure(), np.zeros((4, 4), bool), np.zeros((4, 4, 3)))
        clear = figure()
        clear.opacity_logits[:] = -9
        with self.assertRaisesRegex(NodeFailure, "silhouette"):
            place(clear, np.ones((4, 4), bool), np.zeros((4, 4, 3)))


if __name__ == "__main__":
    unittest.main()
