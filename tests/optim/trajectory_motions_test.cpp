// SPDX-License-Identifier: BSD-3-Clause
// Motions that smoothing must not take away. The oracle is the error of the poses as they were measured.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "allocations.hpp"
#include "dynslam/optim/trajectory_smoothing.hpp"
#include "random.hpp"

using namespace dynslam;
using Eigen::Vector3d;

namespace {

/// A trajectory with what is true of it.
struct Measured {
  std::vector<TrackedPose<double>> poses;
  std::vector<Vector3d> truth;
};

struct MotionErrors {
  double rms = 0, worst = 0, near = 0;  ///< [m]; near an event
};

Vector3d normal3(test::Rng& random) {
  const double x = random.normal(), y = random.normal();
  return {x, y, random.normal()};
}

TrackedPose<double> pose_at(double t, const Vector3d& centre) {
  TrackedPose<double> pose;
  pose.t = t;
  const SO3d R = SO3d::exp(Vector3d(0.3 * std::sin(t), 0.2 * std::cos(1.3 * t), 0));
  pose.T_c_w = SE3d(R, -(R * centre));
  pose.covariance.diagonal().setConstant(1e-6);
  return pose;
}

using MotionNoise = std::function<Vector3d(test::Rng&)>;

Measured measure(const std::function<Vector3d(double)>& motion, double seconds, double rate,
                 test::Rng& random, const MotionNoise& noise) {
  Measured result;
  for (int i = 0; i < static_cast<int>(seconds * rate); ++i) {
    const double t = i / rate;
    result.truth.push_back(motion(t));
    result.poses.push_back(pose_at(t, result.truth.back() + noise(random)));
  }
  return result;
}

MotionNoise white(double sigma) {
  return [sigma](test::Rng& random) { return Vector3d(sigma * normal3(random)); };
}

/// A hand's way, up to 0.5 m/s.
Vector3d by_hand(double t) {
  return {0.3 * std::sin(1.6 * t) + 0.02 * std::sin(5.1 * t),
          0.2 * std::cos(2.1 * t) + 0.01 * std::sin(9.3 * t), 0.15 * std::sin(t) + 0.01 * std::cos(7 * t)};
}

MotionErrors errors_of(const Measured& m, double event) {
  MotionErrors errors;
  double sum = 0, near = 0, count = 0;
  for (std::size_t i = 0; i < m.poses.size(); ++i) {
    const double error = (m.poses[i].T_c_w.inverse().translation() - m.truth[i]).norm();
    sum += error * error;
    errors.worst = std::max(errors.worst, error);
    if (std::abs(m.poses[i].t - event) > 0.34) continue;
    near += error * error;
    count += 1;
  }
  errors.rms = std::sqrt(sum / static_cast<double>(m.poses.size()));
  errors.near = count > 0 ? std::sqrt(near / count) : 0;
  return errors;
}

/// Neutral or better: RMS and that near the event 1.05 of the unsmoothed, the worst 1.1. @return ratio of RMS
double check_neutral(Measured m, double event = -1) {
  const MotionErrors before = errors_of(m, event);
  const SmoothingResult result = smooth_trajectory<double>(m.poses);
  const MotionErrors after = errors_of(m, event);
  INFO("rms ", before.rms, " -> ", after.rms, ", worst ", before.worst, " -> ", after.worst, ", near ",
       before.near, " -> ", after.near, ", clock ", result.clock, ", unchanged ", result.unchanged);
  CHECK(result.ok());
  CHECK(after.rms <= 1.05 * before.rms);
  CHECK(after.worst <= 1.1 * before.worst);
  CHECK(after.near <= 1.05 * before.near);
  return after.rms / before.rms;
}

/// 1 m/s, braked by a deceleration [m/s^2] from a time on.
std::function<Vector3d(double)> braked(double deceleration, double from) {
  return [=](double t) {
    const double u = std::min(t - from, 1 / deceleration);
    const double x = u < 0 ? u : u - 0.5 * deceleration * u * u;
    return Vector3d(x, 0.1 * x, 0);
  };
}

}  // namespace

TEST_CASE("a camera that brakes by 10 m/s^2 brakes, and is smoothed before and after") {
  test::Rng random("brakes");
  for (const double rate : {10.0, 15.0, 30.0, 60.0}) {
    for (const double noise : {0.0002, 0.001, 0.002, 0.005}) {
      CAPTURE(rate);
      CAPTURE(noise);
      const double ratio = check_neutral(measure(braked(10, 30.01), 60, rate, random, white(noise)), 30.06);
      CHECK(ratio < 0.75);
    }
  }
}

TEST_CASE("a camera that stops at once stops") {
  test::Rng random("stops");
  for (const double rate : {10.0, 15.0, 30.0, 60.0}) {
    for (const double noise : {0.0002, 0.001, 0.002, 0.005}) {
      CAPTURE(rate);
      CAPTURE(noise);
      const double ratio = check_neutral(measure(braked(1e9, 30.01), 60, rate, random, white(noise)), 30.01);
      CHECK(ratio < 0.75);
    }
  }
}

TEST_CASE("one jolt of 2 cm among small noise stays, for one frame or for good") {
  test::Rng random("one jolt");
  for (const bool moves : {false, true}) {
    for (const double noise : {0.0001, 0.0003}) {
      for (const bool stays : {false, true}) {
        CAPTURE(moves);
        CAPTURE(noise);
        CAPTURE(stays);
        const auto motion = [&](double t) {
          const Vector3d base = moves ? by_hand(t) : Vector3d::Zero();
          const bool away = stays ? t > 9.99 : std::abs(t - 10) < 0.01;
          return Vector3d(base + Vector3d(away ? 0.02 : 0, 0, 0));
        };
        CHECK(check_neutral(measure(motion, 20, 30, random, white(noise)), 10) < 0.8);
      }
    }
  }
}

TEST_CASE("jolts of 3 cm over two frames every 20 frames stay") {
  test::Rng random("jolts");
  for (const double noise : {0.0003, 0.0005}) {  // rendered: 0.85 mm as tracked
    for (const bool stays : {false, true}) {
      CAPTURE(noise);
      CAPTURE(stays);
      const auto motion = [&](double t) {
        const int frame = static_cast<int>(std::lround(t * 30)), jolt = (frame + 10) / 20;
        const int phase = (frame + 10) % 20;
        const double share = stays ? std::min(1.0, (phase + 1) / 2.0) : phase < 2 ? 1.0 : 0.0;
        const Vector3d way = jolt % 2 == 0 ? Vector3d(0.03, 0.01, 0) : Vector3d(-0.03, 0.01, 0.005);
        const double before = stays && jolt % 2 == 1 ? 0.03 : 0;
        return Vector3d(by_hand(t) + Vector3d(before, 0, 0) + share * way);
      };
      check_neutral(measure(motion, 20, 30, random, white(noise)));
    }
  }
}

TEST_CASE("a hand that shakes at 5 Hz shakes") {
  test::Rng random("shakes");
  for (const double amplitude : {0.002, 0.005, 0.01, 0.02}) {
    for (const double noise : {0.0005, 0.001, 0.002, 0.004}) {
      CAPTURE(amplitude);
      CAPTURE(noise);
      const auto motion = [&](double t) {
        return Vector3d(by_hand(t) +
                        amplitude * Vector3d(std::sin(31.4 * t), 0.5 * std::cos(31.4 * t + 1), 0));
      };
      check_neutral(measure(motion, 20, 30, random, white(noise)));
    }
  }
}

TEST_CASE("at 5 poses per second neighbours know nothing of a hand's motion, and nothing is changed") {
  test::Rng random("few per second");
  for (const double noise : {0.0002, 0.001, 0.002, 0.005}) {
    CAPTURE(noise);
    Measured m = measure(by_hand, 20, 5, random, white(noise));
    const auto before = m.poses;
    CHECK(smooth_trajectory<double>(m.poses).status == SmoothingStatus::too_few_poses);
    for (std::size_t i = 0; i < before.size(); ++i)
      CHECK(m.poses[i].T_c_w.translation() == before[i].T_c_w.translation());
  }
}

TEST_CASE("stamps that jitter by 8 ms are no errors of the poses") {
  test::Rng random("stamps jitter");
  for (const double noise : {0.0008, 0.002}) {
    for (const bool frames_are_even : {true, false}) {
      CAPTURE(noise);
      CAPTURE(frames_are_even);
      Measured m;
      for (int i = 0; i < 600; ++i) {
        const double even = i / 30.0, uneven = even + 0.008 * std::clamp(random.normal(), -2.0, 2.0);
        m.truth.push_back(by_hand(frames_are_even ? even : uneven));
        m.poses.push_back(pose_at(frames_are_even ? uneven : even, m.truth.back() + noise * normal3(random)));
      }
      check_neutral(m);
      const SmoothingResult result = smooth_trajectory<double>(m.poses);
      CHECK(result.clock > 0.004);
      CHECK(result.clock < 0.016);
    }
  }
  Measured true_clock = measure(by_hand, 20, 30, random, white(0.002));
  CHECK(smooth_trajectory<double>(true_clock.poses).clock < 0.003);
}

TEST_CASE("a hand's motion is smoothed at every noise and rate") {
  test::Rng random("hand");
  for (const double noise : {0.001, 0.002, 0.005}) {
    for (const double rate : {15.0, 30.0, 60.0}) {
      CAPTURE(noise);
      CAPTURE(rate);
      CHECK(check_neutral(measure(by_hand, 20, rate, random, white(noise))) < (rate < 20 ? 0.85 : 0.6));
    }
  }
}

TEST_CASE("noise with heavy tails, correlated noise and wrong covariances cost nothing") {
  test::Rng random("other noise");
  for (const double noise : {0.001, 0.004}) {
    CAPTURE(noise);
    const double heavy = check_neutral(measure(by_hand, 20, 30, random, [&](test::Rng& r) {
      const Vector3d g = normal3(r);
      return Vector3d(noise * normal3(r) / std::sqrt(g.squaredNorm() / 3));  // t of 3 degrees of freedom
    }));
    CHECK(heavy < 0.7);
    for (const double a : {0.5, 0.8, 0.95}) {
      CAPTURE(a);
      Vector3d state = Vector3d::Zero();
      check_neutral(measure(by_hand, 20, 30, random, [&](test::Rng& r) {
        state = (a * state + noise * std::sqrt(1 - a * a) * normal3(r)).eval();
        return state;
      }));
    }
    Measured wrong = measure(by_hand, 20, 30, random, white(noise));
    for (auto& pose : wrong.poses) pose.covariance *= std::exp(random.normal());
    check_neutral(wrong);
    Measured factor = measure(by_hand, 20, 30, random, white(noise));
    Measured same = factor;
    for (auto& pose : factor.poses) pose.covariance *= 1e4;
    (void)smooth_trajectory<double>(factor.poses);
    (void)smooth_trajectory<double>(same.poses);
    for (std::size_t i = 0; i < same.poses.size(); i += 17) {
      CHECK((factor.poses[i].T_c_w.translation() - same.poses[i].T_c_w.translation()).norm() < 1e-9);
    }
  }
}

TEST_CASE_TEMPLATE("no pose goes farther than its own standard deviations, nor one that is not finite", S,
                   float, double) {
  test::Rng random("bounded");
  const Measured m = measure(by_hand, 10, 30, random, [](test::Rng& r) {
    return Vector3d((r.chance(0.05) ? 0.02 : 0.002) * normal3(r));
  });
  std::vector<TrackedPose<S>> poses;
  for (const auto& pose : m.poses)
    poses.push_back({pose.t, pose.T_c_w.template cast<S>(), pose.covariance.template cast<S>(), false});
  const S nan = std::numeric_limits<S>::quiet_NaN();
  poses[40].covariance(1, 1) = nan;
  poses[41].covariance.setConstant(std::numeric_limits<S>::infinity());
  poses[150].T_c_w = SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(nan, S(0), S(0)));
  const auto before = poses;
  REQUIRE(smooth_trajectory<S>(poses).ok());
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (i == 150) continue;
    CHECK(poses[i].T_c_w.translation().allFinite());
    const double moved = static_cast<double>(
        (poses[i].T_c_w.inverse().translation() - before[i].T_c_w.inverse().translation()).norm());
    CHECK(moved < SmoothingOptions().max_move * 2.2 * 0.002);  // the noise as estimated around
    sum += moved;
    count += 1;
  }
  CHECK(sum / count > 0.001);
  CHECK(std::isnan(poses[150].T_c_w.translation().x()));
}

TEST_CASE("smoothing is linear in the poses, gives the same twice and allocates nothing the second time") {
  test::Rng random("workspace");
  const Measured m = measure(by_hand, 20, 30, random, white(0.002));
  SmoothingWorkspace workspace;
  auto first = m.poses, second = m.poses;
  (void)smooth_trajectory<double>(first, {}, workspace);
  const std::size_t blocks =
      test::allocations_of([&] { (void)smooth_trajectory<double>(second, {}, workspace); });
  if (test::counts_allocations()) CHECK(blocks == 0);
  for (std::size_t i = 0; i < first.size(); ++i)
    CHECK(first[i].T_c_w.translation() == second[i].T_c_w.translation());
}
