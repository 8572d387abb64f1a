// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/readout_measurement.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

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
    result.begin_image(T_c_w, speed);
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
    m.begin_image(SE3<S>(), speed);
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
}
