#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Open3D's RGB-D odometry, frame to frame, and its map (TSDF), with and without the pixels that dynslam found to move.

    dynslam masks SEQUENCE --out MASKS
    open3d_odometry.py SEQUENCE [--masks MASKS] [--out TRAJECTORY.txt] [--mesh MESH.ply]

SEQUENCE is what `dynslam convert ANY SEQUENCE` makes: rgb.txt, depth.txt, camera.txt and the images. What moves loses its
depth in every frame, which takes it out of the odometry and out of the map. The trajectory is in TUM's format, for
`dynslam eval`.
Needs Open3D 0.13 or later and numpy (Debian: python3-open3d)."""
import argparse
import pathlib
import sys

import numpy as np
import open3d as o3d


def lines_of(file):
    return [line.split() for line in file.read_text().splitlines() if line and line[0] != "#"]


def pairs_of(sequence):
    """(stamp, colour file, depth file) of colour images with a depth image within 0.02 s."""
    depth = [(float(line[0]), line[1]) for line in lines_of(sequence / "depth.txt")]
    for stamp, colour in lines_of(sequence / "rgb.txt"):
        t, file = min(depth, key=lambda d: abs(d[0] - float(stamp)))
        if abs(t - float(stamp)) < 0.02:
            yield stamp, sequence / colour, sequence / file


def image_of(colour, depth, mask, units):
    """An RGB-D image whose depth is 0 where the mask is not."""
    values = np.asarray(o3d.io.read_image(str(depth))).copy()
    if mask is not None:
        values[np.asarray(o3d.io.read_image(str(mask))) > 0] = 0
    return o3d.geometry.RGBDImage.create_from_color_and_depth(
        o3d.io.read_image(str(colour)), o3d.geometry.Image(values), depth_scale=units, depth_trunc=5.0,
        convert_rgb_to_intensity=False)


def grey(image):
    """The same with intensities, as the odometry takes it."""
    intensity = (np.asarray(image.color) @ [0.299, 0.587, 0.114] / 255).astype(np.float32)
    return o3d.geometry.RGBDImage.create_from_color_and_depth(
        o3d.geometry.Image(intensity), image.depth, depth_scale=1.0, depth_trunc=5.0, convert_rgb_to_intensity=False)


def quaternion_of(R):
    """x, y, z, w of a rotation matrix."""
    w, V = np.linalg.eigh(np.array([
        [R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
        [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
        [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]],
        [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], R[0, 0] + R[1, 1] + R[2, 2]]]))
    return V[:, -1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=pathlib.Path)
    parser.add_argument("--masks", type=pathlib.Path, help="PNG files STAMP.png, not 0 where something moves")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--mesh", type=pathlib.Path)
    arguments = parser.parse_args()
    camera = {line[0]: line[2] for line in lines_of(arguments.sequence / "camera.txt")}
    intrinsic = o3d.camera.PinholeCameraIntrinsic(int(camera["width"]), int(camera["height"]),
                                                  *(float(camera[key]) for key in ("fx", "fy", "cx", "cy")))
    units = float(camera.get("depth_units_per_metre", 5000))
    volume = o3d.pipelines.integration.ScalableTSDFVolume(
        voxel_length=0.02, sdf_trunc=0.06, color_type=o3d.pipelines.integration.TSDFVolumeColorType.RGB8)
    last, T_c_w, trajectory = None, np.eye(4), []
    for stamp, colour, depth in pairs_of(arguments.sequence):
        mask = arguments.masks / f"{stamp}.png" if arguments.masks else None
        image = image_of(colour, depth, mask, units)
        now = grey(image)
        if last is not None:
            found, T_now_last, _ = o3d.pipelines.odometry.compute_rgbd_odometry(
                last, now, intrinsic, np.eye(4), o3d.pipelines.odometry.RGBDOdometryJacobianFromHybridTerm(),
                o3d.pipelines.odometry.OdometryOption())
            if found:
                T_c_w = T_now_last @ T_c_w
        last = now
        if arguments.mesh:
            volume.integrate(image, intrinsic, T_c_w)
        T_w_c = np.linalg.inv(T_c_w)
        trajectory.append([stamp, *(f"{x:.6f}" for x in (*T_w_c[:3, 3], *quaternion_of(T_w_c[:3, :3])))])
    if arguments.out:
        arguments.out.write_text("".join(" ".join(line) + "\n" for line in trajectory))
    if arguments.mesh:
        o3d.io.write_triangle_mesh(str(arguments.mesh), volume.extract_triangle_mesh())
    print(f"{len(trajectory)} frames")


if __name__ == "__main__":
    try:
        main()
    except OSError as error:
        sys.exit(f"open3d_odometry: {error}")
