# SPDX-License-Identifier: BSD-3-Clause
import json
import pathlib
import subprocess
import sys
import tempfile
import threading
import unittest

import dynslam
import numpy as np
import scene


class Office(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = scene.office()[0]
        cls.work = tempfile.TemporaryDirectory(prefix="dynslam_python_")
        cls.out = pathlib.Path(cls.work.name)

    @classmethod
    def tearDownClass(cls):
        cls.work.cleanup()

    def test_frames_give_the_bytes_of_the_program(self):
        sequence = dynslam.load_sequence(self.folder)
        slam = dynslam.Slam(sequence.camera)
        results = [slam.track(frame) for frame in sequence]
        self.assertTrue(all(r.ok for r in results))
        slam.finish()
        slam.trajectory.save(self.out / "trajectory.txt")
        slam.live_trajectory.save(self.out / "live.txt")
        slam.save_map(self.out)
        run = scene.office_run()
        for own, name in (("trajectory.txt",) * 2, ("live.txt", "trajectory_live.txt"), ("map.sot",) * 2):
            self.assertEqual((self.out / own).read_bytes(), (run / name).read_bytes(), name)
        self.assertTrue(any((r.mask == 255).any() for r in results))
        np.testing.assert_array_equal(results[-1].T_w_c, slam.live_trajectory.T_w_c[-1])

        with self.subTest("the same errors as `dynslam eval`"):
            report = dynslam.evaluate(slam.trajectory, sequence.groundtruth)
            printed = subprocess.run([scene.PROGRAM, "eval", run / "trajectory.txt", self.folder, "--json"], check=True,
                                     capture_output=True, text=True).stdout
            self.assertEqual(report["pairs"], 45)
            self.assertAlmostEqual(report["ate_m"]["rmse"], json.loads(printed)["ate_m"]["rmse"], 6)
            self.assertEqual(dynslam.evaluate(run / "trajectory.txt", self.folder), json.loads(printed))
            self.assertLess(report["ate_m"]["rmse"], 0.05)

        with self.subTest("the map in memory is the one that was saved"):
            memory, saved = slam.map(), dynslam.Map.load(run)
            self.assertEqual(memory.summary(), saved.summary())
            for a, b in zip(memory.voxels(), saved.voxels()):
                np.testing.assert_array_equal(a, b)

    def test_arrays_give_the_bytes_of_the_program(self):
        sequence = dynslam.load_sequence(self.folder)
        slam = dynslam.Slam(sequence.camera, map=False)
        for frame in sequence:
            slam.track(frame.bgr.copy(), frame.depth.copy(), frame.t, depth_delay=frame.depth_delay)
        slam.finish()
        slam.trajectory.save(self.out / "arrays.txt")
        self.assertEqual((self.out / "arrays.txt").read_bytes(), (scene.office_run() / "trajectory.txt").read_bytes())

    def test_frames(self):
        sequence = dynslam.load_sequence(self.folder)
        self.assertEqual((len(sequence), sequence.format), (45, "tum"))
        frame = sequence[-1]
        shape = (sequence.camera.height, sequence.camera.width)
        self.assertEqual((frame.bgr.shape, frame.gray.shape, frame.depth.shape), ((*shape, 3), shape, shape))
        self.assertEqual((frame.bgr.dtype, frame.depth.dtype), (np.uint8, np.float32))
        with self.assertRaises(ValueError):
            frame.gray[0, 0] = 1
        with self.assertRaises(IndexError):
            sequence[45]
        depth = frame.depth
        del frame, sequence
        self.assertTrue(0.3 < np.nanmedian(depth) < 10)  # the array keeps its memory

    def test_broken_frames_are_warned_of(self):
        folder = self.out / "broken"
        scene.call("synth", folder, "--frames", 4)
        sorted((folder / "depth").iterdir())[1].write_bytes(b"\x89PNG")
        with self.assertWarnsRegex(RuntimeWarning, "depth/"):
            self.assertEqual(len(list(dynslam.load_sequence(folder))), 3)

    def test_trajectories(self):
        truth = dynslam.load_sequence(self.folder).groundtruth
        copy = dynslam.Trajectory(truth.t, truth.T_w_c)
        self.assertLess(dynslam.evaluate(copy, truth)["ate_m"]["max"], 1e-9)
        for wrong, word in ((lambda: dynslam.Trajectory(truth.t[::-1], truth.T_w_c), "increasing"),
                            (lambda: dynslam.Trajectory(truth.t, truth.T_w_c[1:]), "T_w_c"),
                            (lambda: dynslam.evaluate(copy, truth, align="best"), "align"),
                            (lambda: dynslam.evaluate(copy, dynslam.Trajectory(truth.t + 1e6, truth.T_w_c)), "no ATE")):
            with self.assertRaisesRegex(ValueError, word):
                wrong()

    def test_questions_to_the_map(self):
        room = dynslam.Map.load(scene.office_run() / "map.sot")
        centres, labels = room.voxels()
        self.assertEqual(centres.shape, (len(labels), 3))
        first = centres[0]
        cell = room.query_point(first)
        self.assertEqual((cell.state, cell.label), ("occupied", room.class_name(labels[0])))
        np.testing.assert_allclose(cell.centre, first)
        self.assertLess(room.nearest_obstacle(first, 0.5).distance, 1e-9)
        self.assertIsNone(room.nearest_obstacle([0, 0, -500], 1))
        hit = room.cast_ray([0, 0, 0.5], [0, 0, 1], 20)
        self.assertAlmostEqual(hit.centre[2] - hit.edge / 2 - 0.5, hit.distance, 6)
        self.assertIsNone(room.cast_ray([0, 0, 0.5], [0, 0, 1], 0.1))
        inside, _ = room.query_box(first - 0.2, first + 0.2)
        self.assertTrue((np.abs(inside - first) < 0.2 + room.resolution).all() and len(inside))
        room.export(self.out / "map.ply")
        room.save_point_cloud(self.out / "cloud.pcd")
        self.assertGreater(room.save_mesh(self.out / "mesh.ply"), 0)
        room.save_grid(self.out / "grid.pgm", camera_height=1.2)
        for name in ("map.ply", "cloud.pcd", "mesh.ply", "grid.pgm", "grid.yaml"):
            self.assertGreater((self.out / name).stat().st_size, 0)
        for wrong in (lambda: room.query_point([0, 0]), lambda: room.query_point([0, 0, np.nan]), lambda: room.query_point(first, 16),
                      lambda: room.cast_ray(first, [0, 0, 0]), lambda: room.export(self.out / "map.xyz"),
                      lambda: room.class_name(99)):
            self.assertRaises(ValueError, wrong)


class Threads(unittest.TestCase):
    def test_python_runs_while_a_frame_is_tracked(self):
        """While one thread tracks, another one counts."""
        sequence = dynslam.load_sequence(scene.office()[0])
        slam = dynslam.Slam(sequence.camera, map=False)
        frames = [sequence[i] for i in range(8)]
        done, counted, during = threading.Event(), [0], []
        other = threading.Thread(target=count_slowly, args=(done, counted))
        interval = sys.getswitchinterval()
        sys.setswitchinterval(1e4)  # who has the lock keeps it until it gives it away
        try:
            other.start()
            for frame in frames:
                before = counted[0]
                slam.track(frame)
                during.append(counted[0] - before)
        finally:
            sys.setswitchinterval(interval)
            done.set()
            other.join()
        self.assertGreater(sum(during), 0)

    def test_one_segmenter_in_many_threads(self):
        """They wait for each other; nothing breaks, and each mask is one."""
        segmenter = dynslam.MotionSegmenter(scene.camera())
        gray, depth, pose, _ = scene.view(0)
        statuses = []

        def work(n):
            for k in range(5):
                statuses.append(segmenter.segment(gray, depth, 1.0 + n + 10 * k, pose).status)
                segmenter.remember(pose)

        threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(statuses), 20)
        self.assertLessEqual(set(statuses), {"ok", "time_not_later"})

    def test_two_systems_beside_each_other(self):
        """Each gives what it gives alone."""
        sequence = dynslam.load_sequence(scene.office()[0])
        frames = list(sequence)[:12]

        def run(poses):
            slam = dynslam.Slam(sequence.camera, map=False)
            poses.extend(slam.track(frame).T_w_c for frame in frames)

        results = [[], [], []]
        threads = [threading.Thread(target=run, args=(r,)) for r in results[:2]]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        run(results[2])
        np.testing.assert_array_equal(results[0], results[2])
        np.testing.assert_array_equal(results[1], results[2])


def count_slowly(stop, counted):
    """Gives Python's lock away after each step, so that a frame may begin."""
    while not stop.is_set():
        counted[0] += 1
        stop.wait(0.001)


if __name__ == "__main__":
    unittest.main()
