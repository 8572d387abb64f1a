// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/rolling_pose.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "jacobian.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

constexpr int kRollingRows = 480;

/// A desk, near below and far above, seen by a camera that turns by `turn` while it reads its rows, and
/// placed as if it did not.
template <class S>
struct RollingSights {
  Pinhole<S> camera{S(525), S(525), S(319.5), S(239.5)};
  SE3<S> truth;
  std::vector<PoseObservation<S>> observations;
  std::vector<S> share, rows;
  std::vector<Eigen::Matrix<S, 3, 1>> recorded;  // in the camera's frame, by its row

  explicit RollingSights(const Eigen::Vector3d& turn, double noise = 0.2, int n = 300) {
    test::Rng random("rolling pose");
    Eigen::Matrix<S, 6, 1> place;
    place << S(0.1), S(-0.2), S(0.05), S(0.1), S(-0.05), S(0.2);
    truth = SE3<S>::exp(place);
    Eigen::Matrix<S, 6, 1> motion = Eigen::Matrix<S, 6, 1>::Zero();
    motion.template tail<3>() = turn.cast<S>();
    const RollingShutter<S> shutter(motion, kRollingRows);
    while (static_cast<int>(observations.size()) < n) {
      const double u = random.uniform(10, 630), v = random.uniform(10, 470);
      const double du = noise * random.normal(), dv = noise * random.normal();
      const S z = S(2.2 - v / 400 + random.uniform(-0.1, 0.1));
      const Eigen::Matrix<S, 3, 1> p = camera.ray(Eigen::Matrix<S, 2, 1>(S(u), S(v))) * z;
      const auto seen = shutter.project(camera, p);
      REQUIRE(seen);
      const Eigen::Matrix<S, 3, 1> in_row = shutter.to_row(p, seen->y());
      PoseObservation<S> o;
      o.p_w = truth.inverse() * p;
      o.x = *camera.project(in_row) + Eigen::Matrix<S, 2, 1>(S(du), S(dv));
      o.depth = in_row.z() + S(0.002 * random.normal());
      o.inv_sigma_px2 = S(1 / std::max(1e-4, noise * noise));
      o.inv_sigma_z2 = S(1 / 4e-6);
      observations.push_back(o);
      rows.push_back(seen->y());
      share.push_back(shutter.share(seen->y()));
      recorded.push_back(camera.ray(o.x) * o.depth);
    }
  }
  [[nodiscard]] PoseResult<S> still() const { return optimize_pose<S>(camera, observations, truth); }
  [[nodiscard]] PoseResult<S> rolling(const TurnPrior<S>& prior) const {
    return optimize_rolling_pose<S>(camera, observations, share, truth, prior);
  }
  [[nodiscard]] double shift(const PoseResult<S>& result) const {
    return static_cast<double>((result.T_c_w.inverse().translation() - truth.inverse().translation()).norm());
  }
};

const Eigen::Vector3d kShearingTurn(0.006, -0.004, 0.005);

}  // namespace

TEST_CASE_TEMPLATE("a turn during the readout is found, and no longer taken for a shift", S, float, double) {
  const RollingSights<S> sights(kShearingTurn);
  const TurnPrior<S> open{.sigma = S(0.05)};
  const auto still = sights.still(), rolling = sights.rolling(open);
  REQUIRE(still.ok());
  REQUIRE(rolling.ok());
  CHECK((rolling.turn.template cast<double>() - kShearingTurn).norm() < 8e-4);  // of 8.8e-3, by the noise
  CHECK(rolling.inliers > 280);
  CHECK(sights.shift(still) > 0.003);  // millimetres, by 2 mrad above and below the middle
  CHECK(sights.shift(rolling) < 0.0006);
  // What is not known is in the covariance: that of a pose whose rows are known is smaller.
  CHECK(rolling.covariance.trace() > still.covariance.trace() / 4);
  CHECK(still.turn.isZero(S(0)));
}

TEST_CASE_TEMPLATE("a prior that is sure of itself decides, in the mean as elsewhere", S, float, double) {
  const RollingSights<S> sights(kShearingTurn);
  const auto still = sights.still();
  const auto sure = sights.rolling({.sigma = S(1e-7)});
  REQUIRE(sure.ok());
  CHECK(sure.turn.norm() < S(1e-5));
  CHECK(static_cast<double>((sure.T_c_w * still.T_c_w.inverse()).log().norm()) < 1e-3);
  const auto told = sights.rolling({.mean = kShearingTurn.cast<S>(), .sigma = S(1e-7)});
  REQUIRE(told.ok());
  CHECK((told.turn.template cast<double>() - kShearingTurn).norm() < 1e-5);
  CHECK(sights.shift(told) < 0.0006);
}

TEST_CASE_TEMPLATE("the normal equations with a turn of the rows equal those of their Jacobian's rows", S,
                   float, double) {
  const RollingSights<S> sights(kShearingTurn);
  const TurnPrior<S> prior{.mean = {S(0.001), S(-0.002), S(0.003)}, .sigma = S(0.02)};
  const detail::TurningRows<S> rows(sights.share, prior);
  typename detail::TurningRows<S>::Sums sums;
  NormalEquations<S, 9> expected, system;
  const Eigen::Matrix<S, 3, 1> turn(S(0.002), S(0.001), S(-0.001));
  PointLinearisation<Pinhole<S>> point;
  test::Rng random("turning rows");
  for (std::size_t i = 0; i < sights.observations.size(); ++i) {
    const PoseObservation<S>& o = sights.observations[i];
    const Eigen::Matrix<S, 3, 1> p = rows.in_row(turn, i, sights.truth * o.p_w);
    REQUIRE(point.at(sights.camera, p, o));
    const S pixel = S(random.uniform(0.1, 2)), depth = S(random.uniform(10, 1000));
    rows.add(point, sights.camera, i, pixel, depth, sums);
    Eigen::Matrix<S, 3, 1> r;
    Eigen::Matrix<S, 3, 6> J;
    PoseObservation<S> there = o;
    there.p_w = p;
    REQUIRE(pose_residual<S>(sights.camera, SE3<S>(), there, r, &J));
    Eigen::Matrix<S, 3, 9> row;
    row << J, sights.share[i] * J.template rightCols<3>();
    for (int k = 0; k < 3; ++k) expected.add_row(row.row(k), r(k), k < 2 ? pixel : depth);
  }
  const S information = S(1) / (prior.sigma * prior.sigma);
  for (int k = 0; k < 3; ++k) {
    expected.add_row(Eigen::Matrix<S, 1, 9>::Unit(6 + k), turn(k) - prior.mean(k), information);
  }
  rows.store(sums, turn, system);
  const double tolerance = std::is_same_v<S, float> ? 1e-4 : 1e-12;
  CHECK(test::relative_error(system.hessian().template cast<double>(),
                             expected.hessian().template cast<double>()) < tolerance);
  CHECK(test::relative_error(system.gradient().template cast<double>(),
                             expected.gradient().template cast<double>()) < tolerance);
}

TEST_CASE("the turn is the one for which observations brought to the middle row fit one pose best") {
  const RollingSights<double> sights(kShearingTurn);
  PoseOptions<double> options;
  options.rounds = 1;  // on all of them
  options.max_iterations = 30;
  PoseWorkspace<double> workspace;
  const auto kernel = TDistribution<double>::with_dimension(5, 1);
  const auto found = optimize_rolling_pose<double>(sights.camera, sights.observations, sights.share,
                                                   sights.truth, {.sigma = 10}, options, kernel, workspace);
  REQUIRE(found.ok());
  const auto cost_of = [&](const Eigen::Vector3d& turn) {  // the oracle: each placed by the shutter itself
    Eigen::Matrix<double, 6, 1> motion = Eigen::Matrix<double, 6, 1>::Zero();
    motion.tail<3>() = turn;
    const RollingShutter<double> shutter(motion, kRollingRows);
    auto placed = sights.observations;
    for (std::size_t i = 0; i < placed.size(); ++i) {
      const Eigen::Vector3d p = shutter.to_middle(sights.recorded[i], sights.rows[i]);
      placed[i].x = *sights.camera.project(p);
      placed[i].depth = p.z();
    }
    const auto pose = optimize_pose<double>(sights.camera, placed, sights.truth, options, kernel, workspace);
    REQUIRE(pose.ok());
    double cost = 0;
    for (const auto& o : placed) cost += kernel.rho(observation_chi2(sights.camera, pose.T_c_w, o));
    return cost;
  };
  const double least = cost_of(found.turn);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double step : {-8e-4, 8e-4})
      CHECK(cost_of(found.turn + step * Eigen::Vector3d::Unit(axis)) > least);
  }
  CHECK(cost_of(Eigen::Vector3d::Zero()) > 1.5 * least);
}

TEST_CASE_TEMPLATE("moving objects are told from what a turn shears", S, float, double) {
  RollingSights<S> sights(kShearingTurn);
  for (std::size_t i = 0; i < 60; ++i) sights.observations[5 * i].x.x() += S(9);
  const auto result = sights.rolling({.sigma = S(0.05)});
  REQUIRE(result.ok());
  CHECK((result.turn.template cast<double>() - kShearingTurn).norm() < 1e-3);
  CHECK(result.inliers > 220);
  CHECK(result.inliers < 245);
}

TEST_CASE("too few observations and nonsense fail as without a turn") {
  RollingSights<double> sights(kShearingTurn, 0.2, 20);
  const auto rolling = [&](std::size_t n) {
    return optimize_rolling_pose<double>(sights.camera, std::span(sights.observations).first(n),
                                         std::span(sights.share).first(n), sights.truth);
  };
  const auto few = rolling(4);
  CHECK(few.status == PoseStatus::too_few_observations);
  CHECK(few.turn.isZero(0));
  CHECK(rolling(20).ok());
  for (auto& o : sights.observations) o.p_w.setConstant(std::nan(""));
  const auto nonsense = rolling(20);
  CHECK_FALSE(nonsense.ok());
  CHECK(nonsense.inliers == 0);
}
