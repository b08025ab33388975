"""EXR, PLY, PNG and JSON: what is written is read, and what is damaged is an error."""

import struct
import unittest
import zlib

import numpy as np

from gear_sdk import Camera, Field, Image, Mask, Number, Pinhole, Report, Scene, View, Views, exr, ply, png


def picture(width, height):
    return np.random.default_rng(1).random((height, width, 3), np.float32)


def scene(count=5, rest=9):
    random = np.random.default_rng(2)
    draw = lambda *shape: random.normal(size=shape).astype(np.float32)  # noqa: E731
    return Scene(draw(count, 3), draw(count, 3), draw(count, 4), draw(count), draw(count, 3), draw(count, rest))


class Exr(unittest.TestCase):
    def test_pictures_survive(self):
        for alpha in (None, np.full((5, 7), 0.5, np.float32)):
            back = Image.decode(Image(picture(7, 5), alpha).encode())
            np.testing.assert_array_equal(back.rgb, picture(7, 5))
            self.assertEqual(back.alpha is None, alpha is None)

    def test_what_is_not_finite_survives_in_a_field(self):
        data = np.array([[np.nan, np.inf], [-np.inf, 0.1]], np.float32)
        np.testing.assert_array_equal(Field.decode(Field(data).encode()).data, data)

    def test_views_survive_with_their_cameras_and_odd_names(self):
        camera = Camera.front(4, 3)
        camera.projection = Pinhole(11.5)
        whole = View(camera, 'yaw "−30" α', picture(4, 3), *(np.ones((3, 4), np.float32),) * 2, picture(4, 3))
        few = View(Camera.front(2, 2), "b", picture(2, 2), weight=np.zeros((2, 2), np.float32))
        for views in ([], [whole], [whole, few]):
            back = Views.decode(Views(views).encode()).views
            self.assertEqual([view.name for view in back], [view.name for view in views])
            for view, same in zip(views, back):
                self.assertEqual(view.camera.to_json(), same.camera.to_json())
                np.testing.assert_array_equal(view.rgb, same.rgb)
                for plane in ("alpha", "depth", "normal", "weight"):
                    self.assertEqual(getattr(view, plane) is None, getattr(same, plane) is None)

    def test_zip_blocks_of_halves_are_read(self):
        """A file as other programs write it: half floats, ZIP, sixteen lines a block, a window that starts elsewhere."""
        width, height = 5, 19
        plane = np.arange(width * height, dtype=np.float16).reshape(height, width) / 8
        attribute = lambda name, kind, data: (  # noqa: E731
            name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data
        )
        window = struct.pack("<4i", 3, -2, 3 + width - 1, -2 + height - 1)
        header = struct.pack("<ii", exr.MAGIC, 2)
        header += attribute("channels", "chlist", b"Y\0" + struct.pack("<iB3xii", 1, 0, 1, 1) + b"\0")
        header += attribute("compression", "compression", b"\3") + attribute("dataWindow", "box2i", window)
        header += attribute("displayWindow", "box2i", window) + attribute("lineOrder", "lineOrder", b"\0") + b"\0"
        blocks = []
        for start in range(0, height, 16):
            raw = np.frombuffer(plane[start : start + 16].tobytes(), np.uint8).astype(int)
            halves = np.concatenate([raw[0::2], raw[1::2]])
            coded = np.concatenate([halves[:1], (np.diff(halves) + 128) & 0xFF]).astype(np.uint8)
            data = zlib.compress(coded.tobytes(), 9)
            self.assertLess(len(data), len(raw))
            blocks.append(struct.pack("<ii", start - 2, len(data)) + data)
        table, at = b"", len(header) + 8 * len(blocks)
        for block in blocks:
            table += struct.pack("<Q", at)
            at += len(block)
        np.testing.assert_array_equal(Field.decode(header + table + b"".join(blocks)).data, plane)

    def test_damaged_files_are_errors(self):
        whole = Image(picture(3, 2)).encode()
        for cut in range(0, len(whole), 7):
            with self.assertRaises((ValueError, struct.error)):
                exr.read(whole[:cut])
        with self.assertRaises(exr.ExrError):
            exr.read(whole[:4] + struct.pack("<i", 2 | 0x200) + whole[8:])


class Png(unittest.TestCase):
    def test_masks_survive(self):
        inside = np.random.default_rng(3).random((9, 11)) > 0.5
        np.testing.assert_array_equal(Mask.decode(Mask(inside).encode()).inside, inside)

    def test_every_filter_is_undone(self):
        pixels = np.random.default_rng(4).integers(0, 256, (6, 8)).astype(np.uint8)
        rows = b""
        for y in range(6):
            kind, line = y % 5, pixels[y].astype(int)
            up = pixels[y - 1].astype(int) if y else np.zeros(8, int)
            left, corner = np.concatenate([[0], line[:-1]]), np.concatenate([[0], up[:-1]])
            paeth = []
            for a, b, c in zip(left, up, corner):
                p = a + b - c
                paeth.append(min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2])
            guess = [0 * line, left, up, (left + up) // 2, np.array(paeth)][kind]
            rows += bytes([kind]) + ((line - guess) & 0xFF).astype(np.uint8).tobytes()
        plain = png.write_grey(pixels)
        body = plain.index(b"IDAT")
        filtered = plain[: body - 4] + png._chunk(b"IDAT", zlib.compress(rows)) + png._chunk(b"IEND", b"")
        np.testing.assert_array_equal(png.read_grey(filtered), pixels)

    def test_other_pictures_are_refused(self):
        for data in (b"GIF89a", png.write_grey(np.zeros((2, 2), np.uint8))[:30]):
            with self.assertRaises(png.PngError):
                png.read_grey(data)


class Ply(unittest.TestCase):
    def test_scenes_survive_with_their_camera(self):
        for rest in (0, 9):
            whole = scene(rest=rest)
            whole.camera = Camera.front(30, 20)
            back = Scene.decode(whole.encode())
            for name in ("centers", "log_scales", "rotations", "opacity_logits", "sh_dc", "sh_rest"):
                np.testing.assert_array_equal(getattr(back, name), getattr(whole, name))
            self.assertEqual(back.camera.to_json(), whole.camera.to_json())

    def test_an_empty_scene_survives(self):
        self.assertEqual(len(Scene.decode(scene(0, 0).encode())), 0)

    def test_ascii_and_the_other_byte_order_are_read(self):
        names = ply.names(0)
        row = [0.5 * i for i in range(len(names))]
        head = lambda kind: "\n".join(  # noqa: E731
            ["ply", f"format {kind} 1.0", "element vertex 1"] + [f"property double {n}" for n in names] + ["end_header\n"]
        ).encode()
        ascii_file = head("ascii") + " ".join(map(str, row)).encode()
        big = head("binary_big_endian") + struct.pack(f">{len(row)}d", *row)
        for data in (ascii_file, big):
            back = Scene.decode(data)
            np.testing.assert_array_equal(back.rotations[0], row[-4:])
            np.testing.assert_array_equal(back.centers[0], row[:3])

    def test_damaged_files_are_errors(self):
        data = scene().encode()
        for cut in (0, 3, 50, len(data) - 1):
            with self.assertRaises(ValueError):
                Scene.decode(data[:cut])


class Json(unittest.TestCase):
    def test_numbers_and_reports_survive(self):
        for value in (1.5, float("inf"), float("-inf")):
            self.assertEqual(Number.decode(Number(value).encode()).value, value)
        self.assertEqual(Report.decode(Report({"a": [1, None]}).encode()).value, {"a": [1, None]})
        with self.assertRaises(ValueError):
            Report({"a": float("nan")}).encode()


if __name__ == "__main__":
    unittest.main()
