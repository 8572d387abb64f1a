// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/eval/trajectory.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <span>
#include <vector>

#include "pose_distance.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

std::vector<StampedPose<double>> wander(test::Rng& rng, int n) {
  std::vector<StampedPose<double>> out;
  SE3d T;
  for (int i = 0; i < n; ++i) {
    Eigen::Matrix<double, 6, 1> step;
    for (int k = 0; k < 6; ++k) step(k) = 0.02 * rng.normal();
    T = SE3d::exp(step) * T;
    out.push_back({100.0 + i / 30.0, T});
  }
  return out;
}

}  // namespace

TEST_CASE("the end error is that of the motion from first to last, whatever the frames of reference") {
  std::vector<StampedPose<double>> truth, estimate;
  const SE3d frame(SO3d::exp(Eigen::Vector3d(0.3, -1.0, 0.4)), Eigen::Vector3d(5, 6, 7));
  for (int k = 0; k <= 10; ++k) {
    truth.push_back({double(k), SE3d(SO3d::exp(Eigen::Vector3d(0, 0.1 * k, 0)), Eigen::Vector3d(k, 0, 0))});
    const Eigen::Vector3d drift(0, 0.003 * k, 0.004 * k);
    estimate.push_back(
        {double(k), frame * SE3d(truth.back().T_w_c.so3(), truth.back().T_w_c.translation() + drift)});
  }
  CHECK(*end_error<double>(estimate, truth) == doctest::Approx(0.05));
  CHECK_FALSE(end_error<double>(std::span(estimate).first(1), truth));
}

TEST_CASE("association is one-to-one, nearest first, within the limit") {
  const std::vector<double> a{0.00, 0.03, 0.06, 1.00}, b{0.010, 0.029, 0.058, 0.071, 1.03};
  const auto pairs = associate(a, b, 0.02);
  CHECK(pairs == std::vector<std::pair<std::size_t, std::size_t>>{{0, 0}, {1, 1}, {2, 2}});
  // A brute-force greedy rule on random stamps.
  test::Rng rng("association");
  for (const double longest : {0.002, 0.01, 0.05}) {
    std::vector<double> x, y;
    // Multiples of 1/4096 s: equal differences are common.
    const auto step = [&] { return (1 + std::floor(4096 * rng.uniform(0, longest))) / 4096; };
    for (double t = 0; t < 3; t += step()) x.push_back(t);
    for (double t = 0; t < 3; t += step()) y.push_back(t);
    std::vector<std::tuple<double, std::size_t, std::size_t>> all;
    for (std::size_t i = 0; i < x.size(); ++i) {
      for (std::size_t j = 0; j < y.size(); ++j) {
        if (std::abs(x[i] - y[j]) < 0.02) all.emplace_back(std::abs(x[i] - y[j]), i, j);
      }
    }
    std::sort(all.begin(), all.end());
    std::vector<bool> used_x(x.size()), used_y(y.size());
    std::vector<std::pair<std::size_t, std::size_t>> expected;
    for (const auto& [d, i, j] : all) {
      if (used_x[i] || used_y[j]) continue;
      used_x[i] = used_y[j] = true;
      expected.emplace_back(i, j);
    }
    std::sort(expected.begin(), expected.end());
    CHECK(associate(x, y) == expected);
  }
}

TEST_CASE("association of stamps that all lie within the limit takes no more memory than the stamps") {
  // Every pair is a candidate: 400 million of them were kept once.
  std::vector<double> a, b;
  for (int k = 0; k < 20000; ++k) {
    a.push_back(1 + k * 0.7e-6);
    b.push_back(1 + 0.3e-6 + k * 0.7e-6);
  }
  const auto pairs = associate(a, b, 0.02);
  REQUIRE(pairs.size() == 20000);
  for (std::size_t k = 0; k < pairs.size(); ++k) REQUIRE(pairs[k] == std::pair(k, k));
  CHECK(associate(a, std::vector<double>{}, 0.02).empty());
  CHECK(associate(a, b, 0.0).empty());
  // Ties go to the earlier stamp, as in a sorted list of all pairs.
  using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;
  CHECK(associate(std::vector<double>{1, 3}, std::vector<double>{2}, 2.0) == Pairs{{0, 0}});
  CHECK(associate(std::vector<double>{2}, std::vector<double>{1, 3}, 2.0) == Pairs{{0, 0}});
  CHECK(associate(std::vector<double>{0.5, 1}, std::vector<double>{0.25, 0.75}, 0.3, 0.25) ==
        Pairs{{0, 0}, {1, 1}});
}

TEST_CASE_TEMPLATE("alignment undoes any rigid motion, and never a scale", S, float, double) {
  test::Rng rng("horn");
  std::vector<Eigen::Matrix<S, 3, 1>> a, b, twice;
  const SE3<S> T =
      SE3<S>::exp((Eigen::Matrix<S, 6, 1>() << S(1), S(-2), S(3), S(0.5), S(2), S(-1)).finished());
  for (int i = 0; i < 50; ++i) {
    a.emplace_back(static_cast<S>(rng.normal()), static_cast<S>(rng.normal()), static_cast<S>(rng.normal()));
    b.push_back(T * a.back());
    twice.push_back(S(2) * b.back());
  }
  const auto found = horn_alignment<S>(a, b);
  REQUIRE(found);
  CHECK(test::pose_distance(*found, T) < (std::is_same_v<S, float> ? 1e-5 : 1e-12));
  const auto scaled = horn_alignment<S>(a, twice);
  REQUIRE(scaled);
  CHECK(static_cast<double>(scaled->rotation_matrix().determinant()) == doctest::Approx(1.0));
}

TEST_CASE("a mirrored cloud is not aligned by a reflection; a line or a point is degenerate") {
  test::Rng rng("horn degenerate");
  std::vector<Eigen::Vector3d> a, mirrored, line, point(10, Eigen::Vector3d(1, 2, 3));
  for (int i = 0; i < 10; ++i) {
    a.emplace_back(rng.normal(), rng.normal(), rng.normal());
    mirrored.emplace_back(-a.back().x(), a.back().y(), a.back().z());
    line.emplace_back(i, 2.0 * i, -1.0 * i);
  }
  CHECK(horn_alignment<double>(a, mirrored)->rotation_matrix().determinant() == doctest::Approx(1.0));
  CHECK_FALSE(horn_alignment<double>(line, line));
  CHECK_FALSE(horn_alignment<double>(point, point));
  CHECK_FALSE(horn_alignment<double>(std::span(a).first(2), std::span(a).first(2)));
}

TEST_CASE("a rigidly moved copy has no error; a shaken one has the error it was given") {
  test::Rng rng("ate");
  const auto truth = wander(rng, 300);
  const SE3d T = SE3d::exp((Eigen::Matrix<double, 6, 1>() << 1, 2, 3, 0.3, 0.2, 0.1).finished());
  auto estimate = truth;
  for (auto& p : estimate) p.T_w_c = T * p.T_w_c;
  auto ate = absolute_trajectory_error<double>(estimate, truth);
  REQUIRE(ate);
  CHECK(ate->pairs == 300);
  CHECK(ate->translation.max < 1e-12);
  CHECK((ate->T_gt_est * T).log().norm() < 1e-10);
  const auto rpe = relative_pose_error<double>(estimate, truth);
  REQUIRE(rpe);
  CHECK(rpe->translation.max < 1e-10);
  CHECK(rpe->rotation_deg.max < 1e-6);
  for (auto& p : estimate)
    p.T_w_c = SE3d(p.T_w_c.so3(),
                   p.T_w_c.translation() + 0.01 * Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal()));
  ate = absolute_trajectory_error<double>(estimate, truth);
  CHECK(ate->translation.rmse == doctest::Approx(0.01 * std::sqrt(3.0)).epsilon(0.1));
}

TEST_CASE_TEMPLATE("a trajectory in one place, as far as the scalar can tell, gives no scale", S, float,
                   double) {
  test::Rng rng("scale");
  std::vector<StampedPose<S>> moving, twice, still;
  const Eigen::Matrix<S, 3, 1> place(S(1.25), S(-3), S(2));
  for (const auto& pose : wander(rng, 60)) {
    const Eigen::Matrix<S, 3, 1> p = pose.T_w_c.translation().cast<S>();
    moving.push_back({pose.t, SE3<S>(SO3<S>(), p)});
    twice.push_back({pose.t, SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(S(2) * p + place))});
    const Eigen::Matrix<S, 3, 1> rounding = p / p.norm() * std::numeric_limits<S>::epsilon();
    still.push_back({pose.t, SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(place + rounding))});
  }
  using Poses = std::span<const StampedPose<S>>;
  const auto sim3 = [](Poses estimate, Poses truth) {
    return absolute_trajectory_error<S>(estimate, truth, 0.02, Alignment::sim3);
  };
  REQUIRE(sim3(moving, twice));
  CHECK(sim3(moving, twice)->scale == doctest::Approx(2).epsilon(1e-4));
  CHECK_FALSE(sim3(still, moving));
  CHECK_FALSE(sim3(moving, still));
}

TEST_CASE("a steady drift is the relative error per second") {
  std::vector<StampedPose<double>> truth, estimate;
  for (int i = 0; i < 300; ++i) {
    const double t = i / 30.0;
    truth.push_back({t, SE3d(SO3d(), Eigen::Vector3d(std::sin(t), std::cos(t), 0.1 * t))});
    estimate.push_back({t, SE3d(SO3d(), truth.back().T_w_c.translation() + Eigen::Vector3d(0.05 * t, 0, 0))});
  }
  const auto rpe = relative_pose_error<double>(estimate, truth);
  REQUIRE(rpe);
  CHECK(rpe->translation.mean == doctest::Approx(0.05).epsilon(0.02));
  CHECK(rpe->rotation_deg.max < 1e-9);
}

TEST_CASE("statistics by hand, and Eq (13) as in the paper's Table 1") {
  const std::vector<double> v{1, 2, 3, 10};
  const auto s = statistics<double>(v);
  CHECK(s.mean == 4.0);
  CHECK(s.median == 2.5);
  CHECK(s.rmse == doctest::Approx(std::sqrt(114.0 / 4.0)));
  CHECK(s.std == doctest::Approx(std::sqrt(12.5)));
  CHECK(s.min == 1.0);
  CHECK(s.max == 10.0);
  CHECK(improvement_percent(0.3409, 0.0267) == doctest::Approx(92.17).epsilon(1e-3));
}

TEST_CASE_TEMPLATE("poses of any scalar keep their time: stamps of 2011 at 30 Hz", S, float, double) {
  // Fault: a float of 1.3e9 s is a multiple of 128 s, so that all stamps of a sequence were one.
  std::vector<StampedPose<S>> truth, estimate;
  for (int i = 0; i < 90; ++i) {
    const double t = 1305031102.175304 + i / 30.0;
    truth.push_back({t, SE3<S>(SO3<S>(), {S(i) * S(0.01), S(i % 7), S(i % 3)})});
    estimate.push_back({t + 0.004, truth.back().T_w_c});
  }
  const auto ate = absolute_trajectory_error<S>(std::span<const StampedPose<S>>(estimate),
                                                std::span<const StampedPose<S>>(truth));
  REQUIRE(ate);
  CHECK(ate->pairs == 90);
  CHECK(ate->translation.max < S(1e-4));
  CHECK(ate->times[1] - ate->times[0] == doctest::Approx(1 / 30.0).epsilon(1e-4));
  const auto rpe = relative_pose_error<S>(std::span<const StampedPose<S>>(estimate),
                                          std::span<const StampedPose<S>>(truth));
  REQUIRE(rpe);
  CHECK(rpe->pairs > 50);
  CHECK(rpe->translation.max < S(1e-4));
}
