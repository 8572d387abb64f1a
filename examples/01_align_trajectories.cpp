// SPDX-License-Identifier: BSD-3-Clause
//
// Example 1: how far is an estimated trajectory from the truth?
//
// A camera drives once around a circle. An estimator saw the same motion in a frame of its own, rotated and
// moved against the world, its positions disturbed by noise of known size, its clock a little off. The
// example associates the two by time, aligns them with Horn's method (the rigid motion that minimises the sum
// of squared distances), and reports the absolute trajectory error. Without alignment the error would be
// metres; with it, it must come close to the noise that was put in.
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include <dynslam/eval/trajectory.hpp>
#include <dynslam/geometry/se3.hpp>

int main() {
  using dynslam::SE3d;
  using dynslam::StampedPose;
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  constexpr int kPoses = 400;
  constexpr double kPeriod = 1.0 / 30.0;  // s
  constexpr double kNoise = 0.02;         // m, per axis
  constexpr double kTurn = 6.283185307179586;

  // The estimator's frame e, seen from the world w.
  const SE3d T_w_e = SE3d::exp((Vector6() << 1.0, -2.0, 0.5, 0.3, -0.2, 0.8).finished());

  std::mt19937 engine(1);
  std::normal_distribution<double> normal(0.0, kNoise);
  std::vector<StampedPose<double>> truth;
  std::vector<StampedPose<double>> estimate;
  for (int i = 0; i < kPoses; ++i) {
    const double angle = kTurn * i / kPoses;
    const Eigen::Vector3d centre(2.0 * std::cos(angle), 2.0 * std::sin(angle), 0.1 * std::sin(3.0 * angle));
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
    const SE3d T_w_c(rotation, centre);
    truth.push_back({kPeriod * i, T_w_c});

    const Eigen::Vector3d disturbed =
        centre + Eigen::Vector3d(normal(engine), normal(engine), normal(engine));
    estimate.push_back({kPeriod * i + 0.004, T_w_e.inverse() * SE3d(rotation, disturbed)});
  }

  const auto ate = dynslam::absolute_trajectory_error<double>(estimate, truth);
  if (!ate) {
    std::puts("the trajectories share too few times");
    return 1;
  }
  const double expected = kNoise * std::sqrt(3.0);
  std::printf("pairs       %zu\n", static_cast<std::size_t>(ate->pairs));
  std::printf("ATE rmse    %.4f m   (noise put in: %.4f m)\n", ate->translation.rmse, expected);
  std::printf("ATE median  %.4f m\n", ate->translation.median);
  std::printf("ATE max     %.4f m\n", ate->translation.max);

  // The alignment must undo the estimator's frame.
  const SE3d difference = ate->T_gt_est * T_w_e.inverse();
  std::printf("alignment   %.4f m, %.4f rad from the truth\n", difference.translation().norm(),
              difference.so3().log().norm());

  const bool right = std::abs(ate->translation.rmse - expected) < 0.1 * expected &&
                     difference.so3().log().norm() < 0.01 && difference.translation().norm() < 0.02;
  std::puts(right ? "as expected" : "NOT as expected");
  return right ? 0 : 1;
}
