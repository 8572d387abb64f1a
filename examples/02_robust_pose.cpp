// SPDX-License-Identifier: BSD-3-Clause
//
// Example 2: the pose of a camera from known points, one in four of which has moved.
//
// Three hundred points are seen with half a pixel of noise and the depth noise of a structured-light camera.
// A quarter of them belongs to something that moved by 20 cm since it was mapped: their pixels all agree with
// one another, on a wrong motion. A robust kernel and the chi-square test of each round leave them out.
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <random>
#include <span>
#include <vector>

#include <dynslam/geometry/pinhole.hpp>
#include <dynslam/geometry/se3.hpp>
#include <dynslam/image/depth.hpp>
#include <dynslam/optim/pose.hpp>
#include <dynslam/robust/t_distribution.hpp>

int main() {
  using dynslam::SE3d;
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  const dynslam::Pinhole<double> camera(535.4, 539.2, 320.1, 247.6);
  const SE3d T_c_w = SE3d::exp((Vector6() << 0.2, -0.1, 0.3, 0.05, 0.1, -0.02).finished());
  const SE3d T_w_c = T_c_w.inverse();

  constexpr std::size_t kPoints = 300;
  constexpr double kPixelNoise = 0.5;
  const dynslam::DepthNoise<double> depth_noise;
  const Eigen::Vector3d motion(0.2, 0.0, 0.0);

  std::mt19937 engine(4);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> u(20.0, 620.0);
  std::uniform_real_distribution<double> v(20.0, 460.0);
  std::uniform_real_distribution<double> depth(0.8, 4.0);

  std::vector<dynslam::PoseObservation<double>> observations;
  std::vector<bool> moved;
  while (observations.size() < kPoints) {
    const Eigen::Vector3d p_w =
        T_w_c * Eigen::Vector3d(camera.ray(Eigen::Vector2d(u(engine), v(engine))) * depth(engine));
    const bool moves = observations.size() % 4 == 0;
    const Eigen::Vector3d p_c = T_c_w * (moves ? Eigen::Vector3d(p_w + motion) : p_w);
    const auto x = camera.project(p_c);
    if (!x) continue;
    const double sigma_z = depth_noise.sigma(p_c.z());
    dynslam::PoseObservation<double> o{};
    o.p_w = p_w;  // where the map believes the point to be
    o.x = *x + kPixelNoise * Eigen::Vector2d(normal(engine), normal(engine));
    o.depth = p_c.z() + sigma_z * normal(engine);
    o.inv_sigma_px2 = 1.0 / (kPixelNoise * kPixelNoise);
    o.inv_sigma_z2 = 1.0 / (sigma_z * sigma_z);
    observations.push_back(o);
    moved.push_back(moves);
  }

  // Starts 5 cm and some degrees beside the truth.
  const SE3d initial = SE3d::exp((Vector6() << 0.03, -0.03, 0.02, 0.03, 0.02, -0.03).finished()) * T_c_w;
  const auto kernel = dynslam::TDistribution<double>::with_dimension(5, 1);
  dynslam::PoseWorkspace<double> workspace;
  const auto result = dynslam::optimize_pose<double>(camera, observations, initial,
                                                     dynslam::PoseOptions<double>(), kernel, workspace);

  std::size_t kept_moving = 0;
  std::size_t lost_static = 0;
  for (std::size_t i = 0; i < kPoints; ++i) {
    const bool inlier = workspace.inlier[i] != 0;
    kept_moving += moved[i] && inlier ? 1U : 0U;
    lost_static += !moved[i] && !inlier ? 1U : 0U;
  }
  const Vector6 error = (result.T_c_w * T_w_c).log();
  const double sigma = std::sqrt(result.covariance.diagonal().head<3>().sum());
  std::printf("inliers       %d of %zu (%zu that moved, %zu static ones lost)\n", result.inliers, kPoints,
              kept_moving, lost_static);
  std::printf("translation   %.2f mm off (one sigma by the covariance: %.2f mm)\n",
              1e3 * error.head<3>().norm(), 1e3 * sigma);
  std::printf("rotation      %.4f deg off\n", error.tail<3>().norm() * 180.0 / 3.141592653589793);

  const bool right = kept_moving == 0 && lost_static < kPoints / 20 && error.head<3>().norm() < 0.005;
  std::puts(right ? "as expected" : "NOT as expected");
  return right ? 0 : 1;
}
