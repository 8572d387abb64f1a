// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/rolling_shutter.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "random.hpp"
#include "test_cameras.hpp"

using namespace dynslam;

namespace {

/// A hand's quick turn while an image is read: 2 rad/s and 0.5 m/s for 24 ms.
template <class S>
Eigen::Matrix<S, 6, 1> quick_turn() {
  Eigen::Matrix<S, 6, 1> motion;
  motion << S(0.012), S(-0.006), S(0.004), S(0.02), S(0.048), S(-0.015);
  return motion;
}

template <class S>
Eigen::Matrix<S, 3, 1> at_row(const Eigen::Matrix<S, 3, 1>& p, S v) {
  return SE3<S>::exp(quick_turn<S>() * (v / S(479) - S(0.5))) * p;
}

}  // namespace

TEST_CASE_TEMPLATE("a rolling shutter's rows have the poses of an even motion", S, float, double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const RollingShutter<S> shutter(quick_turn<S>(), 480);
  CHECK(shutter.moves());
  const Vector3 p(S(0.6), S(-0.4), S(1.5));
  for (const S v : {S(0), S(100), S(239.5), S(300.25), S(479)}) {
    CAPTURE(v);
    const S tolerance = S(1e-6);
    CHECK((shutter.to_row(p, v) - at_row<S>(p, v)).norm() < tolerance);
    CHECK((shutter.to_middle(at_row<S>(p, v), v) - p).norm() < tolerance);
  }
  CHECK((shutter.to_row(p, S(239.5)) - p).norm() == S(0));
  CHECK((shutter.to_row(p, S(0)) - p).norm() > S(0.02));
}

TEST_CASE_TEMPLATE("a global shutter, and a camera at rest, leave points where they are", S, float, double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Vector3 p(S(0.6), S(-0.4), S(1.5));
  const RollingShutter<S> global;
  CHECK_FALSE(global.moves());
  CHECK(global.to_row(p, S(0)) == p);
  CHECK(global.to_middle(p, S(479)) == p);
  const RollingShutter<S> at_rest(Eigen::Matrix<S, 6, 1>::Zero(), 480);
  CHECK(at_rest.to_row(p, S(0)) == p);
}

TEST_CASE_TEMPLATE("a point is seen in the row that is read when it is there", S, float, double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const PinholeBrownConrady<S> camera(Pinhole<S>(S(517), S(516), S(318), S(255)),
                                      BrownConrady<S>(S(0.1), S(-0.2), S(0.001), S(-0.002), S(0)));
  const RollingShutter<S> shutter(quick_turn<S>(), 480);
  for (const Vector3& p : {Vector3(S(0.6), S(-0.6), S(1.5)), Vector3(S(-1), S(0.8), S(2)),
                           Vector3(S(0.1), S(0.05), S(0.7)), Vector3(S(0.7), S(0.6), S(1.6))}) {
    CAPTURE(p.transpose());
    const auto x = shutter.project(camera, p);
    REQUIRE(x);
    // By bisection: rows before it are read when the point is below them, rows behind when it is above.
    S low = S(-200), high = S(680);
    for (int i = 0; i < 40; ++i) {
      const S v = (low + high) / S(2);
      const auto seen = camera.project(at_row<S>(p, v));
      REQUIRE(seen);
      (seen->y() > v ? low : high) = v;
    }
    const auto truth = camera.project(at_row<S>(p, low));
    REQUIRE(truth);
    CHECK((*x - *truth).norm() < S(0.002));
    CHECK((*x - *camera.project(p)).norm() > S(0.3));
  }
  CHECK_FALSE(shutter.project(camera, Vector3(S(0), S(0), S(-1))));
  CHECK(*RollingShutter<S>().project(camera, Vector3(S(0.1), S(0.2), S(1))) ==
        *camera.project(Vector3(S(0.1), S(0.2), S(1))));
}

namespace {

constexpr int kRows = 480;
constexpr double kReadoutTime = 0.03;  // [s]

/// Where each row of an image that sees a point sees it: bisection between all neighbouring rows, row poses
/// by the exponential.
template <class C>
std::vector<Eigen::Vector2d> rows_that_see(const C& camera, const Eigen::Matrix<double, 6, 1>& motion,
                                           const Eigen::Vector3d& p) {
  const auto seen = [&](double v) {
    return camera.project(SE3<double>::exp(motion * (v / (kRows - 1) - 0.5)) * p);
  };
  std::vector<Eigen::Vector2d> all;
  auto before = seen(0);
  for (int row = 1; row < kRows; ++row) {
    const auto after = seen(row);
    if (before && after && (before->y() < row - 1) != (after->y() < row)) {
      const bool above = before->y() < row - 1;
      double low = row - 1, high = row;
      for (int i = 0; i < 50; ++i) {
        const double v = 0.5 * (low + high);
        const auto x = seen(v);
        if (!x) break;
        ((x->y() < v) == above ? low : high) = v;
      }
      if (const auto x = seen(low)) all.push_back(*x);
    }
    before = after;
  }
  return all;
}

/// Random points in random motions against rows_that_see(). @return how many points had a row
template <class S, class C>
int compare_with_rows(const C& camera, const Pinhole<double>& around, double rate, double speed,
                      const std::string& name) {
  const auto exact = camera.template cast<double>();
  const double tolerance = std::is_same_v<S, float> ? 0.02 : 0.002;
  test::Rng random(name);
  int had_a_row = 0;
  for (int n = 0; n < 400; ++n) {
    Eigen::Matrix<double, 6, 1> motion;
    for (int i = 0; i < 6; ++i) motion(i) = random.uniform(-1, 1);
    motion.head<3>() *= speed * kReadoutTime / motion.head<3>().norm();
    motion.tail<3>() *= rate * kReadoutTime / motion.tail<3>().norm();
    const Eigen::Matrix<S, 6, 1> motion_s = motion.cast<S>();
    const RollingShutter<S> shutter(motion_s, kRows);
    const Eigen::Matrix<S, 3, 1> p_s =
        (around.ray(Eigen::Vector2d(random.uniform(-150, 790), random.uniform(-150, 630))) *
         random.uniform(0.3, 4))
            .cast<S>();
    const auto rows = rows_that_see(exact, motion_s.template cast<double>(), p_s.template cast<double>());
    const auto x = shutter.project(camera, p_s);
    CAPTURE(name);
    CAPTURE(motion.transpose());
    CAPTURE(p_s.transpose());
    CAPTURE(rows.size());
    const bool twins = rows.size() > 1 && std::abs(rows[0].y() - rows[1].y()) < kRows / 64.0;
    if (!twins) CHECK((rows.empty() || x));
    had_a_row += rows.empty() ? 0 : 1;
    if (!x) continue;
    const Eigen::Vector2d found = x->template cast<double>();
    double nearest = 1e9;
    for (const Eigen::Vector2d& row : rows) nearest = std::min(nearest, (row - found).norm());
    const bool inside = found.y() > 0.1 && found.y() < kRows - 1.1;
    if (inside || !rows.empty()) {
      CHECK(nearest < tolerance);
    } else {  // outside it is still what such a row would see
      const auto again = camera.project(shutter.to_row(p_s, x->y()));
      REQUIRE(again);
      CHECK((*again - *x).norm() < S(5) * S(tolerance));
    }
  }
  return had_a_row;
}

}  // namespace

TEST_CASE_TEMPLATE("in motions of up to 20 rad/s a point is where some row sees it, or nowhere", S, float,
                   double) {
  const Pinhole<double> pinhole(525, 525, 319.5, 239.5);
  const Pinhole<S> ideal = pinhole.cast<S>();
  const PinholeBrownConrady<S> lens(ideal, BrownConrady<S>(S(0.26), S(-0.95), S(-0.005), S(0.003), S(1.16)));
  const KannalaBrandt<S> fisheye(S(280), S(280), S(319.5), S(239.5),
                                 Eigen::Matrix<S, 4, 1>(S(0.01), S(-0.005), S(0.001), S(-0.0002)));
  const Pinhole<double> wide(200, 200, 319.5, 239.5);
  for (const double rate : {0.1, 2.0, 5.0, 10.0, 20.0}) {
    for (const double speed : {0.1, 1.0, 3.0}) {
      const std::string name = std::to_string(rate) + " rad/s, " + std::to_string(speed) + " m/s";
      CHECK(compare_with_rows<S>(ideal, pinhole, rate, speed, "pinhole, " + name) > 100);
      CHECK(compare_with_rows<S>(lens, pinhole, rate, speed, "lens, " + name) > 100);
      CHECK(compare_with_rows<S>(fisheye, wide, rate, speed, "fisheye, " + name) > 100);
      CHECK(compare_with_rows<S>(test::Panorama<S>(S(150), S(319.5), S(239.5)), wide, rate, speed,
                                 "panorama, " + name) > 100);
    }
  }
}

namespace {

/// A pinhole that counts how often it is asked.
struct CountingCamera : Pinhole<double> {
  explicit CountingCamera(int& asked) : Pinhole<double>(525, 525, 319.5, 239.5), count(&asked) {}
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p) const {
    ++*count;
    return Pinhole<double>::project(p);
  }
  int* count;
};

}  // namespace

TEST_CASE("the row of a hand's motion takes at most five projections") {
  int asked = 0, most = 0;
  const CountingCamera camera(asked);
  test::Rng random("steps of a rolling shutter");
  const RollingShutter<double> shutter(quick_turn<double>(), kRows);
  double sum = 0;
  for (int n = 0; n < 1000; ++n) {
    asked = 0;
    const Eigen::Vector2d x(random.uniform(0, 639), random.uniform(0, 479));
    REQUIRE(shutter.project(camera, camera.ray(x) * random.uniform(0.5, 4)));
    most = std::max(most, asked);
    sum += asked;
  }
  CHECK(most <= 5);
  CHECK(sum / 1000 <= 4);
}
