// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/readout_measurement.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

constexpr int kHeight = 480;

/// What 40 images of a hand-held camera whose rows take `readout` say, placed as if they took `assumed`.
template <class S>
ReadoutMeasurement<S> measured(double readout, double assumed, double shake) {
  const Pinhole<S> camera(S(525), S(525), S(319.5), S(239.5));
  test::Rng random("readout measurement");
  ReadoutMeasurement<S> result;
  for (int image = 0; image < 40; ++image) {
    Eigen::Matrix<S, 6, 1> speed, place;
    for (int i = 0; i < 6; ++i) {
      speed(i) = S(random.uniform(-shake, shake));
      place(i) = S(random.uniform(-0.1, 0.1));
    }
    const RollingShutter<S> truth(speed * S(readout), kHeight), belief(speed * S(assumed), kHeight);
    const SE3<S> T_c_w = SE3<S>::exp(place);
    result.begin_image(image / 30.0, T_c_w, speed);
    for (int k = 0; k < 120; ++k) {
      const S z = S(random.uniform(0.8, 3));
      const Eigen::Matrix<S, 2, 1> x(S(random.uniform(0, 639)), S(random.uniform(0, 479)));
      const Eigen::Matrix<S, 3, 1> p = camera.ray(x) * z;
      const auto seen = truth.project(camera, p);
      REQUIRE(seen);
      const Eigen::Matrix<S, 3, 1> placed = belief.to_middle(truth.to_row(p, seen->y()), seen->y());
      PoseObservation<S> o;
      o.p_w = T_c_w.inverse() * p;
      o.x = *camera.project(placed) +
            Eigen::Matrix<S, 2, 1>(S(random.uniform(-0.5, 0.5)), S(random.uniform(-0.5, 0.5)));
      o.depth = placed.z();
      o.inv_sigma_px2 = S(12);
      o.inv_sigma_z2 = S(1e4);
      result.observe(camera, o, S(1), (seen->y() - S(239.5)) / S(kHeight - 1));
    }
    result.end_image();
  }
  return result;
}

}  // namespace

TEST_CASE_TEMPLATE("the readout of a rolling shutter is measured beside unknown poses", S, float, double) {
  for (const double assumed : {0.0, 0.02, 0.03}) {
    CAPTURE(assumed);
    const auto m = measured<S>(0.024, assumed, 1.0);
    CHECK(std::abs(static_cast<double>(m.correction()) - (0.024 - assumed)) < 0.0006);
    CHECK(m.sigma() < S(0.0003));
    CHECK(m.sigma() > S(1e-5));
  }
  CHECK(std::abs(static_cast<double>(measured<S>(-0.01, 0, 1.0).correction()) + 0.01) < 0.0006);  // upwards
}

TEST_CASE_TEMPLATE("an observation with NaN or infinity in it does not spoil those of all images", S, float,
                   double) {
  const S nan = std::numeric_limits<S>::quiet_NaN(), inf = std::numeric_limits<S>::infinity();
  const auto good = measured<S>(0.024, 0, 1.0);
  for (const S bad : {nan, inf}) {
    auto m = good;
    const Pinhole<S> camera(S(525), S(525), S(319.5), S(239.5));
    PoseObservation<S> o;
    o.p_w = {S(0.1), S(0.2), S(2)};
    o.x = {S(300), S(200)};
    o.inv_sigma_px2 = S(12);
    const Eigen::Matrix<S, 6, 1> speed = Eigen::Matrix<S, 6, 1>::Constant(S(0.5));
    m.begin_image(10.0, SE3<S>(), speed);
    auto at_nowhere = o;
    at_nowhere.x.x() = bad;
    m.observe(camera, at_nowhere, S(1), S(0.2));
    auto deep = o;
    deep.depth = bad;
    deep.inv_sigma_z2 = S(1e4);
    m.observe(camera, deep, S(1), S(0.2));
    m.observe(camera, o, bad, S(0.2));
    m.observe(camera, o, S(1), bad);
    m.end_image();
    // What is left are two pixels, which do not determine a pose.
    CHECK(m.correction() == good.correction());
    CHECK(std::isfinite(m.sigma()));
    CHECK(m.sigma() == doctest::Approx(double(good.sigma())).epsilon(0.01));
  }
}

TEST_CASE_TEMPLATE("a camera that hardly moves does not tell its readout, and one without images nothing", S,
                   float, double) {
  CHECK(measured<S>(0.024, 0, 0.01).sigma() > S(0.002));
  const ReadoutMeasurement<S> nothing;
  CHECK(nothing.correction() == S(0));
  CHECK(nothing.sigma() == std::numeric_limits<S>::infinity());
  CHECK(nothing.interval().half_width == std::numeric_limits<S>::infinity());
  CHECK_FALSE(readout_between<S>(nothing, S(0), nothing, S(0.02)));
}

namespace {

/// A recording of a room by a hand at 30 Hz, and what is wrong with it: noise of keypoints and depth, and map
/// points that are where their first sighting has put them.
struct Recording {
  struct Point {
    Eigen::Vector3d p_w;
    Eigen::Vector2d seen_noise;
    int since;  // image that has made it
  };
  std::vector<SE3<double>> T_c_w;
  std::vector<SE3<double>::Vector6> speed;
  std::vector<Point> points;
  std::uint64_t noise_seed = 0;

  Recording(test::Rng& random, int images) {
    SE3<double>::Vector6 rate, phase, strength;
    for (int i = 0; i < 6; ++i) {
      rate(i) = random.uniform(3, 9);  // [rad/s]
      phase(i) = random.uniform(0, 6.28);
      strength(i) = random.uniform(0.1, i < 3 ? 0.4 : 1.0);
    }
    SE3<double> pose;
    for (int n = 0; n < images; ++n) {
      const SE3<double>::Vector6 now =
          strength.cwiseProduct((rate * (n / 30.0) + phase).array().sin().matrix());
      pose = SE3<double>::exp(now / 30.0) * pose;
      T_c_w.push_back(pose);
      speed.push_back(now);
      if (n % 10 != 0) continue;
      for (int k = 0; k < 60; ++k) {
        const Eigen::Vector2d x(random.uniform(0, 639), random.uniform(0, 479));
        const Eigen::Vector3d p = Pinhole<double>(525, 525, 319.5, 239.5).ray(x) * random.uniform(0.8, 3);
        points.push_back({pose.inverse() * p, {random.normal(0, 0.5), random.normal(0, 0.5)}, n});
      }
    }
  }

  /// What it says as if rows took `assumed` where they take `readout`.
  template <class S>
  [[nodiscard]] ReadoutMeasurement<S> measure(double readout, double assumed,
                                              const std::string& noise) const {
    const Pinhole<double> camera(525, 525, 319.5, 239.5);
    test::Rng random(noise);
    ReadoutMeasurement<S> result;
    std::vector<std::optional<Eigen::Vector3d>> map(points.size());
    for (std::size_t n = 0; n < T_c_w.size(); ++n) {
      const RollingShutter<double> truth(speed[n] * readout, kHeight), belief(speed[n] * assumed, kHeight);
      result.begin_image(static_cast<double>(n) / 30, SE3<S>(T_c_w[n].cast<S>()), speed[n].cast<S>());
      for (std::size_t k = 0; k < points.size(); ++k) {
        const Eigen::Vector2d shake(random.normal(0, 0.3), random.normal(0, 0.3));
        const double depth_noise = random.normal(0, 0.01);
        if (points[k].since > static_cast<int>(n)) continue;
        const Eigen::Vector3d p = T_c_w[n] * points[k].p_w;
        if (p.z() < 0.5) continue;  // no depth camera measures there
        const auto seen = truth.project(camera, p);
        if (!seen || seen->minCoeff() < 0 || seen->x() > 639 || seen->y() > kHeight - 1) continue;
        const bool first = points[k].since == static_cast<int>(n);
        const Eigen::Vector2d x = *seen + (first ? points[k].seen_noise : shake);
        const double z = truth.to_row(p, seen->y()).z() + depth_noise;
        const Eigen::Vector3d placed = belief.to_middle(camera.ray(x) * z, x.y());
        if (first) {
          map[k] = T_c_w[n].inverse() * placed;
          continue;
        }
        if (!map[k]) continue;  // its own image has just missed it
        PoseObservation<S> o;
        o.p_w = map[k]->cast<S>();
        o.x = camera.project(placed)->cast<S>();
        o.depth = S(placed.z());
        o.inv_sigma_px2 = S(4);
        o.inv_sigma_z2 = S(1e4);
        result.observe(camera.cast<S>(), o, S(1), S((x.y() - 239.5) / (kHeight - 1)));
      }
      result.end_image();
    }
    return result;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("the interval of a readout covers the truth in 95 of 100 recordings", S, float, double) {
  for (const double readout : {0.0, 0.024}) {
    for (const int images : {30, 60, 90}) {
      CAPTURE(readout);
      CAPTURE(images);
      int covered = 0, trials = 0;
      std::vector<double> widths;
      for (int n = 0; n < (std::is_same_v<S, double> && images == 30 ? 200 : 50); ++n) {
        const std::string name = "recording " + std::to_string(n);
        test::Rng random(name);
        const Recording recording(random, images);
        const auto low = recording.measure<S>(readout, readout - 0.006, name),
                   high = recording.measure<S>(readout, readout + 0.01, name);
        const auto found = readout_between<S>(low, S(readout - 0.006), high, S(readout + 0.01));
        ++trials;
        if (!found) {  // says nothing, and does not pretend to
          ++covered;
          continue;
        }
        const double off = std::abs(static_cast<double>(found->time) - readout);
        covered += off <= static_cast<double>(found->half_width) ? 1 : 0;
        widths.push_back(static_cast<double>(found->half_width));
      }
      std::nth_element(widths.begin(), widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 2),
                       widths.end());
      const double width = widths[widths.size() / 2];
      CAPTURE(width);
      // 95 % of them, less four standard deviations of such a count: compilers draw other recordings.
      CHECK(covered >= 0.95 * trials - 4 * std::sqrt(0.95 * 0.05 * trials));
      CHECK(static_cast<double>(widths.size()) >= 0.9 * trials);
      CHECK(width < 0.001);
    }
  }
}
