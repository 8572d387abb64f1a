// SPDX-License-Identifier: BSD-3-Clause
#include "synth/camera_path.hpp"

#include <numbers>

namespace dynslam::runtime::synth {
namespace {

using Eigen::Vector3d;

/// Pose of a camera at `eye` that looks at `target`, with small extra rotations about its axes.
SE3<double> look_at(const Vector3d& eye, const Vector3d& target, const Vector3d& turn) {
  const Vector3d z = (target - eye).normalized();
  const Vector3d x = z.cross(Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return SE3<double>(SO3<double>(R) * SO3<double>::exp(turn), eye);
}

}  // namespace

Shake::Shake(Random& random) {
  for (auto& axis : phase_) {
    for (double& p : axis) p = random.uniform(0, 2 * std::numbers::pi);
  }
}

View view_of(const std::string& scenario) {
  if (scenario == "crowd")  // feet at 2.5 m and heads
    return {Vector3d(0, -2.05, 1.4), Vector3d(0.1, 2.2, 0.5), 4.2, 0.4, 0.216, 0.04};
  return {Vector3d(0, -0.55, 1.35), Vector3d(0.1, 2.6, 0.95), 3.1, 0.5, 0.24, 0.16};
}

SE3<double> camera_pose(const std::string& path, const View& view, double t, const Shake& shake) {
  const Vector3d& target = view.target;
  Vector3d eye = view.eye;
  Vector3d turn = 0.006 * Vector3d(shake(0, t), shake(1, t), shake(2, t));
  const auto wave = [&](double frequency) { return std::sin(2 * std::numbers::pi * frequency * t); };
  if (path == "xyz") {
    eye += Vector3d(0.30 * wave(0.23), 0.22 * wave(0.17), 0.18 * wave(0.31));
    eye += 0.004 * Vector3d(shake(3, t), shake(4, t), shake(5, t));
    return look_at(eye, target + (eye - view.eye), turn);
  }
  if (path == "rpy") {
    turn += Vector3d(0.14 * wave(0.29), 0.22 * wave(0.19), 0.20 * wave(0.37));
  } else if (path == "halfsphere") {
    const double azimuth = view.azimuth * wave(0.09), elevation = view.elevation + view.nod * wave(0.13);
    eye = target + view.radius * Vector3d(std::sin(azimuth) * std::cos(elevation),
                                          -std::cos(azimuth) * std::cos(elevation), std::sin(elevation));
  }
  if (path == "loop") {  // outwards, on a circle
    const double a = 2 * std::numbers::pi * t / 18.0;
    const Vector3d out(std::sin(a), std::cos(a), 0), centre(0, -0.4, 1.35);
    eye = centre + 0.55 * out + Vector3d(0, 0, 0.12 * std::sin(2 * a)) +
          0.004 * Vector3d(shake(3, t), shake(4, t), shake(5, t));
    return look_at(eye, eye + out + Vector3d(0, 0, -0.12), turn);
  }
  const double shiver = path == "static" ? 0.002 : 0.004;
  eye += shiver * Vector3d(shake(3, t), shake(4, t), shake(5, t));
  return look_at(eye, target, turn);
}

}  // namespace dynslam::runtime::synth
