# SPDX-License-Identifier: BSD-3-Clause
"""A wall that the camera passes and a box that crosses the view; a rendered office."""
import functools
import os
import pathlib
import subprocess
import tempfile

import dynslam
import numpy as np

WIDTH, HEIGHT = 320, 240
PROGRAM = os.environ["DYNSLAM_PROGRAM"]


def camera():
    return dynslam.Camera.pinhole(WIDTH, HEIGHT, 260, 260, 159.5, 119.5)


def view(k):
    """gray, depth, T_c_w and the true mask of frame k."""
    camera_x, box_x = 0.005 * k, -1.2 + 0.05 * k
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    x, y = (u - 159.5) / 260, (v - 119.5) / 260
    box = (np.abs(1.5 * x + camera_x - box_x) < 0.3) & (np.abs(y) < 0.25)
    z = np.where(box, 1.5, 3.0)
    gray = 128 + 99 * np.sin(23 * (z * x + camera_x - np.where(box, box_x, 0))) * np.sin(31 * z * y)
    T_c_w = np.eye(4)
    T_c_w[0, 3] = -camera_x
    return gray.astype(np.uint8), z.astype(np.float32), T_c_w, box


def call(*arguments):
    subprocess.run([PROGRAM, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@functools.cache
def office():
    """The folder of a sequence in which people walk, and its owner."""
    folder = tempfile.TemporaryDirectory(prefix="dynslam_python_")
    call("synth", f"{folder.name}/walking", "--path", "xyz", "--scenario", "walking", "--seed", 2, "--frames", 45)
    return pathlib.Path(folder.name) / "walking", folder


@functools.cache
def office_run():
    """The folder that `dynslam run` makes of office()."""
    run = office()[0].parent / "run"
    call("run", office()[0], "--out", run, "--dynamics", "geometric")
    return run
