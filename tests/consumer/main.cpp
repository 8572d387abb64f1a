// SPDX-License-Identifier: BSD-3-Clause
// A program of another project: every header of the core, and something computed with it.
#include <dynslam/dynslam.hpp>

#include <cmath>
#include <optional>

int main() {
  const dynslam::Pinhole<float> camera(500.0F, 500.0F, 320.0F, 240.0F);
  const dynslam::SE3<float> T_c_w = dynslam::SE3<float>::exp(Eigen::Matrix<float, 6, 1>::Constant(0.1F));
  const Eigen::Vector3f p_w(0.1F, -0.2F, 2.0F);
  const Eigen::Vector3f p_c = T_c_w * p_w;
  const std::optional<Eigen::Vector2f> x = camera.project(p_c);
  if (!x) return 1;
  const Eigen::Vector3f back = T_c_w.inverse() * *camera.unproject(*x, p_c.z());
  return std::abs((back - p_w).norm()) < 1e-5F ? 0 : 1;
}
