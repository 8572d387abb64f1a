// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/trajectory_smoothing.hpp"

#include <doctest/doctest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

/// Where a hand carries a camera, 0.3 m to either side in 4 s, turning.
SE3d carried(double t) {
  Eigen::Matrix<double, 6, 1> turn = Eigen::Matrix<double, 6, 1>::Zero();
  turn.tail<3>() << 0.3 * std::sin(2 * t), 0.5 * std::cos(1.3 * t), 0.2 * std::sin(3 * t);
  const SO3d R = SE3d::exp(turn).so3();
  const Eigen::Vector3d centre(0.3 * std::sin(1.6 * t), 0.2 * std::cos(2.1 * t), 5 + 0.15 * std::sin(t));
  return {R, -(R * centre)};
}

template <class S>
std::vector<TrackedPose<S>> carried_poses(double noise, int n = 200, double rate = 30) {
  test::Rng random("trajectory smoothing");
  std::vector<TrackedPose<S>> poses;
  for (int i = 0; i < n; ++i) {
    const double t = 1e9 + i / rate + (i % 3) * 0.002;  // stamps jitter
    Eigen::Matrix<double, 6, 1> error = Eigen::Matrix<double, 6, 1>::Zero();
    error.head<3>() = noise * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    TrackedPose<S> pose;
    pose.t = t;
    pose.T_c_w = (SE3d::exp(error) * carried(t - 1e9)).template cast<S>();
    pose.covariance.diagonal().setConstant(S(1e-6));
    poses.push_back(pose);
  }
  return poses;
}

/// Distance of a centre to where it should be [m].
template <class S>
double centre_error(const TrackedPose<S>& pose) {
  return (pose.T_c_w.template cast<double>().inverse().translation() -
          carried(pose.t - 1e9).inverse().translation())
      .norm();
}
template <class S>
double rms_centre_error(std::span<const TrackedPose<S>> poses) {
  double sum = 0;
  for (const auto& pose : poses) sum += centre_error(pose) * centre_error(pose);
  return std::sqrt(sum / static_cast<double>(poses.size()));
}

}  // namespace

TEST_CASE_TEMPLATE("what poses err by themselves is averaged away, at every noise and rate", S, float,
                   double) {
  for (const double noise : {0.02, 0.004, 0.001}) {
    for (const double rate : {60.0, 30.0, 10.0}) {
      CAPTURE(noise);
      CAPTURE(rate);
      auto poses = carried_poses<S>(noise, 200, rate);
      const double before = rms_centre_error<S>(poses);
      const SmoothingResult result = smooth_trajectory<S>(poses);
      REQUIRE(result.ok());
      CHECK(rms_centre_error<S>(poses) < (rate > 20 ? 0.55 : 0.8) * before);
      CHECK(result.noise > 0.8 * before);
      CHECK(result.noise < 1.7 * before);
      CHECK(result.correction < 1.1 * before);
      CHECK(result.stiffness > 0);
    }
  }
}

TEST_CASE_TEMPLATE("exact poses stay where they are, also where a camera makes long steps", S, float,
                   double) {
  for (const double rate : {30.0, 10.0}) {
    CAPTURE(rate);
    auto poses = carried_poses<S>(0, 150, rate);
    REQUIRE(smooth_trajectory<S>(poses).ok());
    CHECK(rms_centre_error<S>(poses) < (rate > 20 ? 1e-4 : 1e-3));  // of steps of 6 to 16 cm
  }
}

TEST_CASE("the smoothed centres and their noise are those of a dense solution that leaves one out") {
  auto poses = carried_poses<double>(0.004, 40);
  for (std::size_t i = 0; i < poses.size(); i += 7) poses[i].covariance *= 4;
  const auto before = poses;
  SmoothingOptions options;
  options.iterations = 1;
  options.nu = 1e9;
  const SmoothingResult result = smooth_trajectory<double>(poses, options);
  REQUIRE(result.ok());
  const auto n = static_cast<Eigen::Index>(poses.size());
  std::vector<double> gaps;
  for (std::size_t i = 1; i < before.size(); ++i) gaps.push_back(before[i].t - before[i - 1].t);
  std::nth_element(gaps.begin(), gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2), gaps.end());
  const double usual = gaps[gaps.size() / 2];
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(n, n), c(n, 3);
  Eigen::VectorXd w(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& pose = before[static_cast<std::size_t>(i)];
    w(i) = i % 7 == 0 ? 0.25 : 1;
    c.row(i) = pose.T_c_w.inverse().translation().transpose();
    if (i + 3 >= n) continue;
    // Divided differences, one order after the other.
    Eigen::Matrix4d M = Eigen::Matrix4d::Identity();
    for (int order = 1; order <= 3; ++order) {
      for (int k = 0; k + order <= 3; ++k) {
        const double h =
            (before[static_cast<std::size_t>(i + k + order)].t - before[static_cast<std::size_t>(i + k)].t) /
            usual / order;
        M.row(k) = ((M.row(k + 1) - M.row(k)) / h).eval();
      }
    }
    P.block<4, 4>(i, i) += M.row(0).transpose() * M.row(0);
  }
  const auto solve = [&](const Eigen::VectorXd& weight) -> Eigen::MatrixXd {
    return (Eigen::MatrixXd(weight.asDiagonal()) + result.stiffness * P).llt().solve(weight.asDiagonal() * c);
  };
  const Eigen::MatrixXd smooth = solve(w);
  std::vector<double> left_out;
  for (Eigen::Index i = 0; i < n; ++i) {
    // Of the movement along the path, what stamps that err have of the noise is missing.
    const Eigen::Vector3d path =
        (c.row(std::min(n - 1, i + 1)) - c.row(std::max<Eigen::Index>(0, i - 1))).transpose().normalized();
    const Eigen::Vector3d moved =
        poses[static_cast<std::size_t>(i)].T_c_w.inverse().translation() - c.row(i).transpose();
    const Eigen::Vector3d solved = (smooth.row(i) - c.row(i)).transpose();
    const double along = path.dot(solved), share = path.dot(moved) / along;
    CHECK((moved - solved - path * (share - 1) * along).norm() < 1e-8);
    CHECK(share > 0.05);
    CHECK(share < 1 + 1e-6);
    Eigen::VectorXd others = w;
    others(i) = 1e-12;
    left_out.push_back(w(i) * (solve(others).row(i) - c.row(i)).squaredNorm());
  }
  double sum = 0;
  for (const double e : left_out) sum += e;
  CHECK(result.noise == doctest::Approx(std::sqrt(sum / static_cast<double>(n))).epsilon(1e-3));
}

TEST_CASE_TEMPLATE("a camera that rests and then makes a quick movement makes it", S, float, double) {
  test::Rng random("quick movement");
  std::vector<TrackedPose<S>> poses(300);
  const auto centre = [](double t) {  // 12 cm within a third of a second, at 30 Hz
    return Eigen::Vector3d(t < 5 ? 0.0 : t > 5.33 ? 0.12 : 0.06 * (1 - std::cos(9.52 * (t - 5))), 0, 0);
  };
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].t = static_cast<double>(i) / 30;
    const Eigen::Vector3d noise(random.normal(), random.normal(), random.normal());
    const Eigen::Vector3d c = centre(poses[i].t) + 0.0002 * noise;
    poses[i].T_c_w = SE3<S>(SO3<S>(), -c.cast<S>());
  }
  REQUIRE(smooth_trajectory<S>(poses).ok());
  for (const auto& pose : poses)
    CHECK((pose.T_c_w.inverse().translation().template cast<double>() - centre(pose.t)).norm() < 0.0015);
}

TEST_CASE_TEMPLATE("a pose that is far off may be a jolt, and pulls none of the others", S, float, double) {
  auto poses = carried_poses<S>(0.002);
  Eigen::Matrix<S, 6, 1> jump = Eigen::Matrix<S, 6, 1>::Zero();
  jump(0) = S(0.1);
  poses[100].T_c_w = SE3<S>::exp(jump) * poses[100].T_c_w;
  const auto before = poses;
  REQUIRE(smooth_trajectory<S>(poses).ok());
  CHECK((poses[100].T_c_w.translation() - before[100].T_c_w.translation()).norm() < S(1e-6));
  for (const std::size_t i : {97U, 98U, 99U, 101U, 102U, 103U})
    CHECK(centre_error(poses[i]) < 1e-6 + centre_error(before[i]));
  for (const std::size_t i : {94U, 95U, 96U, 104U, 105U, 106U}) CHECK(centre_error(poses[i]) < 0.004);
  // One that is off by some of its standard deviations is brought back.
  poses = carried_poses<S>(0.002);
  jump(0) = S(0.012);
  poses[100].T_c_w = SE3<S>::exp(jump) * poses[100].T_c_w;
  REQUIRE(smooth_trajectory<S>(poses).ok());
  CHECK(centre_error(poses[100]) < 0.005);
}

TEST_CASE_TEMPLATE("a pose that states how little it knows counts less", S, float, double) {
  auto sure = carried_poses<S>(0.001), stated = sure;
  test::Rng random("weak stretch");
  for (std::size_t i = 90; i < 102; ++i) {  // a mover fills the view
    Eigen::Matrix<S, 6, 1> error = Eigen::Matrix<S, 6, 1>::Zero();
    for (int a = 0; a < 3; ++a) error(a) = S(0.02 * random.normal());
    sure[i].T_c_w = stated[i].T_c_w = SE3<S>::exp(error) * sure[i].T_c_w;
    stated[i].covariance *= S(400);
  }
  REQUIRE(smooth_trajectory<S>(sure).ok());
  REQUIRE(smooth_trajectory<S>(stated).ok());
  const auto stretch = [](const auto& poses) {
    return rms_centre_error<S>(std::span<const TrackedPose<S>>(poses).subspan(88, 16));
  };
  CHECK(stretch(stated) < 0.006);
  CHECK(stretch(stated) < 0.8 * stretch(sure));
}

TEST_CASE_TEMPLATE("nothing is known of the motion over a gap or to a place where the camera was found", S,
                   float, double) {
  for (const bool gap : {true, false}) {
    CAPTURE(gap);
    auto poses = carried_poses<S>(0.002);
    const SE3<S> elsewhere(SO3<S>(), Eigen::Matrix<S, 3, 1>(S(0.2), S(0), S(0)));
    for (std::size_t i = 100; i < poses.size(); ++i) {
      poses[i].T_c_w = poses[i].T_c_w * elsewhere;
      if (gap) poses[i].t += 1;
    }
    poses[100].begins = !gap;
    const auto before = poses;
    REQUIRE(smooth_trajectory<S>(poses).ok());
    for (const std::size_t i : {97U, 98U, 99U, 100U, 101U, 102U}) {
      CHECK((poses[i].T_c_w.inverse().translation() - before[i].T_c_w.inverse().translation()).norm() <
            S(0.008));
    }
  }
}

TEST_CASE_TEMPLATE("a pose is turned as its covariance ties the turn to the shift", S, float, double) {
  auto poses = carried_poses<S>(0.004), free = poses;
  for (auto& pose : poses) {  // a wall 2 m ahead: a shift to the right looks like a turn
    pose.covariance(4, 0) = pose.covariance(0, 4) = S(0.4e-6);
    pose.covariance(3, 1) = pose.covariance(1, 3) = S(-0.4e-6);
  }
  const auto before = poses;
  REQUIRE(smooth_trajectory<S>(poses).ok());
  REQUIRE(smooth_trajectory<S>(free).ok());
  for (std::size_t i = 0; i < poses.size(); i += 13) {
    const Eigen::Matrix<S, 3, 1> turn = (poses[i].T_c_w.so3() * before[i].T_c_w.so3().inverse()).log();
    const Eigen::Matrix<S, 3, 1> moved =
        poses[i].T_c_w.inverse().translation() - before[i].T_c_w.inverse().translation();
    const Eigen::Matrix<S, 3, 1> upsilon = -(before[i].T_c_w.so3() * moved);
    CHECK(std::abs(turn.y() - S(0.4) * upsilon.x()) < S(2e-5));
    CHECK(std::abs(turn.x() + S(0.4) * upsilon.y()) < S(2e-5));
    CHECK((free[i].T_c_w.so3() * before[i].T_c_w.so3().inverse()).log().norm() < S(2e-6));
  }
}

TEST_CASE_TEMPLATE("what cannot be smoothed is left as it is", S, float, double) {
  auto few = carried_poses<S>(0.004, 11);
  const auto few_before = few;
  CHECK(smooth_trajectory<S>(few).status == SmoothingStatus::too_few_poses);
  CHECK(few[5].T_c_w.translation() == few_before[5].T_c_w.translation());
  auto back = carried_poses<S>(0.004);
  back[50].t = back[49].t;
  CHECK(smooth_trajectory<S>(back).status == SmoothingStatus::not_increasing);
  back[50].t = std::nan("");
  CHECK(smooth_trajectory<S>(back).status == SmoothingStatus::not_increasing);
  CHECK(smooth_trajectory<S>(std::span<TrackedPose<S>>()).status == SmoothingStatus::too_few_poses);
  auto unknown = carried_poses<S>(0.004);  // no covariance anywhere
  for (auto& pose : unknown) pose.covariance.setZero();
  const double before = rms_centre_error<S>(unknown);
  CHECK(smooth_trajectory<S>(unknown).ok());
  CHECK(rms_centre_error<S>(unknown) < 0.55 * before);
  auto still = carried_poses<S>(0);  // a camera on a table
  for (auto& pose : still) pose.T_c_w = still[0].T_c_w;
  const auto place = still[0].T_c_w.translation().eval();
  CHECK(smooth_trajectory<S>(still).ok());
  for (const auto& pose : still) CHECK((pose.T_c_w.translation() - place).norm() < S(1e-6));
}
