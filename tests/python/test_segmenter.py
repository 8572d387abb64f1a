# SPDX-License-Identifier: BSD-3-Clause
import pathlib
import subprocess
import sys
import unittest

import dynslam
import numpy as np
import scene


class Masks(unittest.TestCase):
    def test_a_loop_finds_the_box(self):
        segmenter = dynslam.MotionSegmenter(scene.camera())
        both = either = 0
        for k in range(40):
            gray, depth, pose, truth = scene.view(k)
            motion = segmenter.segment(gray, depth, k / 30, pose)
            self.assertTrue(motion.ok)
            segmenter.remember(pose, motion.mask)
            if k >= 10:
                both += np.count_nonzero((motion.mask > 0) & truth)
                either += np.count_nonzero((motion.mask > 0) | truth)
        self.assertGreater(both / either, 0.8)

    def test_keypoints_on_the_box_are_dynamic(self):
        segmenter = dynslam.MotionSegmenter(scene.camera())
        on_box, off_box = [], []
        for k in range(40):
            gray, depth, pose, truth = scene.view(k)
            motion = segmenter.segment(gray, depth, k / 30, pose)
            segmenter.remember(pose, motion.mask)
            u, v = motion.pixels.round().astype(int).T
            self.assertEqual((motion.weights.shape, motion.dynamic.shape), (u.shape, u.shape))
            on_box.extend(motion.dynamic[truth[v, u]])
            off_box.extend(motion.dynamic[~truth[v, u]])
        self.assertGreater(len(on_box), 100)
        self.assertGreater(np.mean(on_box), np.mean(off_box) + 0.5)

    def test_statuses(self):
        segmenter = dynslam.MotionSegmenter(scene.camera())
        gray, depth, pose, _ = scene.view(0)
        self.assertEqual(segmenter.segment(gray, depth, 1.0, pose).status, "ok")
        segmenter.remember(pose)
        refused = segmenter.segment(gray, depth, 1.0, pose)
        self.assertEqual((refused.status, refused.ok, refused.mask.any()), ("time_not_later", False, False))
        segmenter.reset()
        self.assertEqual(segmenter.segment(gray, depth, 0.5, pose).status, "ok")

    def test_locate_finds_the_pose(self):
        segmenter = dynslam.MotionSegmenter(scene.camera())
        located = np.eye(4)
        for k in range(10):
            gray, depth, pose, _ = scene.view(k)
            located, found = segmenter.locate(gray, depth, located)
            self.assertEqual(found, k > 0)
            motion = segmenter.segment(gray, depth, k / 30, located)
            segmenter.remember(located, motion.mask)
        np.testing.assert_allclose(located, pose, atol=0.003)

    def test_a_host_that_jumps_gets_the_pose_of_the_mask(self):
        segmenter = dynslam.MotionSegmenter(scene.camera())
        for k in range(10):
            gray, depth, pose, _ = scene.view(k)
            given = pose.copy()
            given[0, 3] += 0.1 * (k == 9)  # the wall repeats every 0.27 m
            motion = segmenter.segment(gray, depth, k / 30, given)
            self.assertEqual(motion.own_pose, k == 9)
            segmenter.remember(given, motion.mask)
        np.testing.assert_allclose(motion.T_c_w, pose, atol=0.003)

    def test_follow_moves_the_memory(self):
        """In a world that was moved, with the memory moved along, masks stay what they are."""
        D = np.eye(4)
        D[:3, 3] = 0.3, -0.1, 0.2
        masks = []
        for moved in (False, True):
            segmenter = dynslam.MotionSegmenter(scene.camera())
            for k in range(12):
                gray, depth, pose, _ = scene.view(k)
                if moved and k == 8:
                    segmenter.follow(D)
                if moved and k >= 8:
                    pose = pose @ D
                motion = segmenter.segment(gray, depth, k / 30, pose)
                segmenter.remember(pose, motion.mask)
            masks.append(motion.mask > 0)
        self.assertTrue(masks[0].any())
        self.assertGreater(np.mean(masks[0] == masks[1]), 0.995)

    def test_the_example_finds_people(self):
        example = pathlib.Path(__file__).parents[2] / "examples/python/masks.py"
        lines = subprocess.run([sys.executable, example, scene.office()[0]], check=True, capture_output=True, text=True).stdout.splitlines()
        self.assertEqual(len(lines), 45)
        shares = [float(line.split(":")[1].split("%")[0]) for line in lines]
        self.assertGreater(max(shares), 3)


class StaticWeights(unittest.TestCase):
    def test_what_moved_has_no_weight(self):
        """Points of the wall lie where the pose says; those of the box moved by 0.05 m - 0.005 m, 8 px."""
        camera = scene.camera()
        (gray0, depth0, pose0, box0), (gray, depth, pose, _) = scene.view(20), scene.view(21)
        T = pose @ np.linalg.inv(pose0)
        v, u = (a.ravel() for a in np.mgrid[60:180:6, 20:300:6])
        x = np.stack([u, v], 1).astype(float)
        on_box = box0[v, u]
        p = camera.unproject(x, depth0[v, u])
        moved = p + np.where(on_box[:, None], [0.05, 0, 0], 0)
        x_m = camera.project(moved @ T[:3, :3].T + T[:3, 3])
        result = dynslam.static_weights(camera, x, p, x_m, gray0, gray, depth, T)
        self.assertTrue(result.ok)
        self.assertGreater(np.count_nonzero(on_box), 50)
        self.assertGreater(np.mean(result.dynamic[on_box] | result.mismatch[on_box]), 0.9)
        self.assertLess(np.mean(result.dynamic[~on_box] | result.mismatch[~on_box]), 0.1)

    def test_sizes_and_too_few(self):
        gray, depth, pose, _ = scene.view(0)
        few = dynslam.static_weights(scene.camera(), np.zeros((3, 2)), np.ones((3, 3)), np.zeros((3, 2)), gray, gray, depth, pose)
        self.assertEqual((few.ok, few.weight.shape), (False, (0,)))
        with self.assertRaisesRegex(ValueError, "as many rows"):
            dynslam.static_weights(scene.camera(), np.zeros((3, 2)), np.ones((4, 3)), np.zeros((3, 2)), gray, gray, depth, pose)


if __name__ == "__main__":
    unittest.main()
