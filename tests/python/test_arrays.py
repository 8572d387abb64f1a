# SPDX-License-Identifier: BSD-3-Clause
"""Wrong arrays are refused one by one, in a message that names the argument, what it has to be and what it is."""
import unittest

import dynslam
import numpy as np
import scene

GRAY, DEPTH, POSE, _ = scene.view(0)


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


def misaligned(array):
    memory = np.zeros(array.nbytes + 1, np.uint8)
    view = memory[1:].view(array.dtype).reshape(array.shape)
    view[:] = array
    return view


class Refused(unittest.TestCase):
    def segment(self, **changed):
        arguments = {"gray": GRAY, "depth": DEPTH, "t": 0.0, "T_c_w": POSE, **changed}
        return dynslam.MotionSegmenter(scene.camera()).segment(**arguments)

    def refused(self, error, *words, **changed):
        with self.assertRaises(error) as caught:
            self.segment(**changed)
        for word in (next(iter(changed)), *words):
            self.assertIn(word, str(caught.exception))

    def test_right_ones_are_taken(self):
        self.assertEqual(self.segment().status, "ok")
        self.assertEqual(self.segment(gray=read_only(GRAY), depth=read_only(DEPTH)).status, "ok")
        self.assertEqual(self.segment(T_c_w=POSE.tolist()).status, "ok")

    def test_no_arrays(self):
        self.refused(TypeError, "numpy array", "list", gray=GRAY.tolist())
        self.refused(TypeError, "numpy array", "NoneType", depth=None)
        self.refused(TypeError, "(4, 4)", "<U8", T_c_w="identity")

    def test_dtypes(self):
        self.refused(TypeError, "uint8", "int64 (240, 320)", gray=GRAY.astype(np.int64))
        self.refused(TypeError, "float32 (metres)", "float64 (240, 320)", depth=DEPTH.astype(np.float64))
        self.refused(TypeError, ">f4", depth=DEPTH.astype(">f4"))
        self.refused(TypeError, "bool", prior=DEPTH)
        self.refused(TypeError, "complex128", T_c_w=POSE.astype(complex))

    def test_shapes(self):
        self.refused(ValueError, "(240, 320)", "(240, 319)", gray=GRAY[:, :-1])
        self.refused(ValueError, "(240, 320)", "(320, 240)", depth=np.ascontiguousarray(DEPTH.T))
        self.refused(ValueError, "(240, 320, 1)", gray=GRAY[..., None])
        self.refused(ValueError, "(0, 0)", prior=np.zeros((0, 0), np.uint8))
        self.refused(ValueError, "(4, 4)", "(3, 4)", T_c_w=POSE[:3])

    def test_strides(self):
        wide = np.zeros((240, 640), np.uint8)
        for strange in (wide[:, ::2], GRAY[:, ::-1], GRAY[::-1], np.asfortranarray(GRAY), np.broadcast_to(GRAY[:1], GRAY.shape)):
            self.refused(ValueError, "strides", "ascontiguousarray", gray=strange)
        self.refused(ValueError, "strides", depth=misaligned(DEPTH))

    def test_values(self):
        self.refused(ValueError, "0 to 255", "multiply by 255", gray=GRAY / np.float32(255))
        self.refused(ValueError, "NaN", gray=np.full(GRAY.shape, np.nan, np.float32))
        self.refused(ValueError, "0 to 300", gray=np.linspace(0, 300, GRAY.size, dtype=np.float32).reshape(GRAY.shape))
        self.refused(ValueError, "no rotation", T_c_w=2 * np.eye(4) - np.diag([0, 0, 0, 1]))
        self.refused(ValueError, "no rotation", T_c_w=np.diag([1.0, 1, -1, 1]))
        self.refused(ValueError, "not finite", T_c_w=np.full((4, 4), np.nan))
        self.refused(ValueError, "last row", T_c_w=np.ones((4, 4)))

    def test_outputs(self):
        self.refused(ValueError, "writeable", "read-only", out=read_only(GRAY))
        self.refused(TypeError, "uint8", out=DEPTH.copy())
        self.refused(TypeError, "list", out=GRAY.tolist())

    def test_slam(self):
        colour = np.dstack([GRAY] * 3)
        for error, image, depth, words in (
                (ValueError, colour[..., :2], DEPTH, "image: expected uint8 (240, 320), (240, 320, 3) or (240, 320, 4)"),
                (ValueError, colour[..., ::-1], DEPTH, "image"), (ValueError, np.moveaxis(colour, 2, 0), DEPTH, "image"),
                (TypeError, colour.astype(np.float32), DEPTH, "image"), (TypeError, colour, DEPTH.astype(np.int16), "depth")):
            with self.assertRaises(error) as caught:
                dynslam.Slam(scene.camera(), map=False).track(image, depth, 0.0)
            self.assertIn(words, str(caught.exception))
        with self.assertRaisesRegex(ValueError, "t: expected a finite number"):
            dynslam.Slam(scene.camera(), map=False).track(colour, DEPTH, float("nan"))
        with self.assertRaisesRegex(TypeError, "t, ns"):
            dynslam.Slam(scene.camera(), map=False).track(colour, DEPTH)
        slam = dynslam.Slam(scene.camera(), map=False)
        slam.track(colour, DEPTH, 1.0)
        with self.assertRaises(dynslam.InputError):
            slam.track(colour, DEPTH, 1.0)

    def test_options(self):
        for call, word in ((lambda: dynslam.Camera("no-such-camera"), "no-such-camera"),
                           (lambda: dynslam.Camera.pinhole(640, 480, -1, 500, 320, 240), "fx"),
                           (lambda: dynslam.Camera.pinhole(640, 480, 500, 500, 320, 240, k9=1), "k9"),
                           (lambda: dynslam.MotionSegmenter(scene.camera(), method="best"), "method"),
                           (lambda: dynslam.Slam(scene.camera(), dynamics="all"), "dynamics"),
                           (lambda: dynslam.Slam(scene.camera(), map_resolution=0), "map_resolution"),
                           (lambda: dynslam.load_sequence("/absent"), "/absent"),
                           (lambda: dynslam.Map.load("/absent"), "/absent")):
            with self.assertRaisesRegex(ValueError, word):
                call()


class NotCopied(unittest.TestCase):
    def test_rows_of_any_distance(self):
        """A part of a larger image is used where it is, and its frame gives what its copy gives."""
        results = []
        for part in (False, True):
            segmenter = dynslam.MotionSegmenter(scene.camera())
            for k in range(12):
                gray, depth, pose, _ = scene.view(k)
                if part:
                    padded = np.zeros((250, 400), np.uint8)
                    padded[3:243, 5:325] = gray
                    gray = padded[3:243, 5:325]
                motion = segmenter.segment(gray, depth, k / 30, pose)
                segmenter.remember(pose, motion.mask)
            results.append(motion.mask)
        self.assertTrue(results[0].any())
        np.testing.assert_array_equal(*results)

    def test_output_is_the_callers_array(self):
        out = np.full(GRAY.shape, 7, np.uint8)
        motion = dynslam.MotionSegmenter(scene.camera()).segment(GRAY, DEPTH, 0.0, POSE, out=out)
        self.assertIs(motion.mask, out)
        self.assertFalse((out == 7).any())

    def test_float_and_16_bit_images(self):
        """They are the same image, so they have the same mask."""
        masks = []
        for kind in ("metres", "millimetres"):
            segmenter = dynslam.MotionSegmenter(scene.camera())
            for k in range(12):
                gray, depth, pose, _ = scene.view(k)
                if kind == "millimetres":
                    gray, depth = gray.astype(np.float32), (1000 * depth).astype(np.uint16)
                motion = segmenter.segment(gray, depth, k / 30, pose)
                segmenter.remember(pose, motion.mask)
            masks.append(motion.mask)
        np.testing.assert_array_equal(*masks)


if __name__ == "__main__":
    unittest.main()
