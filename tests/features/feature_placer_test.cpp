// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/features/feature_placer.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/features/masked_features.hpp"
#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "random.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("a feature is put where the lens says, to a hundredth of a pixel between pixels", S, float,
                   double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const PinholeBrownConrady<S> camera(Pinhole<S>(S(500), S(505), S(320), S(240)),
                                      BrownConrady<S>(S(0.1), S(-0.2), S(0.001), S(-0.002), S(0)));
  const FeaturePlacer<PinholeBrownConrady<S>> placer(camera, 640, 480);
  Image<float> depth(640, 480, 2.0F);
  for (const Vector2& x :
       {Vector2(S(320.3), S(240.2)), Vector2(S(20.4), S(31.4)), Vector2(S(600.7), S(450.6))}) {
    Feature f;
    placer.place(f, x, depth);
    const auto ideal = camera.undistort_pixel(x);
    REQUIRE(ideal);
    CHECK(std::abs(f.x - static_cast<float>(ideal->x())) < 0.01F);
    CHECK(std::abs(f.y - static_cast<float>(ideal->y())) < 0.01F);
    CHECK(f.depth == 2.0F);
    CHECK(placer.sees(f));
    CHECK(std::abs(placer.point(f).z() - S(2)) < S(1e-5));
  }
  depth(10, 10) = std::numeric_limits<float>::quiet_NaN();
  Feature f;
  placer.place(f, Vector2(S(10), S(10)), depth);
  CHECK(f.depth == 0.0F);
  placer.place(f, Vector2(S(640), S(10)), depth);  // outside the image
  CHECK_FALSE(placer.sees(f));
  CHECK(f.depth == 0.0F);
}

TEST_CASE_TEMPLATE("in a fisheye, places between pixels and their noise are stretched with the image", S,
                   float, double) {
  // Fault: a pixel of noise counted as one ideal pixel, which at 58 degrees are 3.6 along the radius, and a
  // half of a pixel as half of one.
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const KannalaBrandt<S> camera(S(190), S(190), S(320), S(240),
                                Eigen::Matrix<S, 4, 1>(S(-0.02), S(0.004), S(0), S(0)));
  const FeaturePlacer<KannalaBrandt<S>> placer(camera, 640, 480);
  const Image<float> depth(640, 480, 2.0F);
  test::Rng rng("stretched noise");
  for (int k = 0; k < 200; ++k) {
    const double radius = rng.uniform(0, 190), angle = rng.uniform(-3, 3);
    const Vector2 x(S(320 + radius * std::cos(angle)), S(240 + radius * std::sin(angle)));
    const auto ideal = to_ideal(camera, placer.pinhole(), x);
    REQUIRE(ideal);
    Feature f;
    placer.place(f, x, depth);
    CHECK((Vector2(S(f.x), S(f.y)) - *ideal).norm() < S(0.05));
    double sum = 0;
    constexpr int kTrials = 400;
    for (int i = 0; i < kTrials; ++i) {
      const auto off =
          to_ideal(camera, placer.pinhole(), Vector2(x + S(0.3) * Vector2(S(rng.normal()), S(rng.normal()))));
      REQUIRE(off);
      sum += static_cast<double>((*off - *ideal).squaredNorm());
    }
    const double expected = std::sqrt(sum / (2 * kTrials)) / 0.3;
    CHECK(static_cast<double>(placer.stretch(x)) == doctest::Approx(expected).epsilon(0.15));
  }
  const FeaturePlacer<Pinhole<S>> pinhole(Pinhole<S>(S(500), S(505), S(320), S(240)), 640, 480);
  for (const Vector2& x : {Vector2(S(0.3), S(479)), Vector2(S(320.4), S(11.6)), Vector2(S(-5), S(5))}) {
    CHECK(pinhole.stretch(x) == 1.0F);
    Feature f;
    pinhole.place(f, x, depth);
    if (x.x() > S(0)) CHECK((f.x == f.u && f.y == f.v));
  }
}

TEST_CASE_TEMPLATE("many features are placed as each one alone", S, float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const PinholeBrownConrady<S> camera(Pinhole<S>(S(50), S(50), S(32), S(24)),
                                      BrownConrady<S>(S(0.1), S(-0.2), S(0.001), S(-0.002), S(0)));
  FeaturePlacer<PinholeBrownConrady<S>> placer(camera, 64, 48);
  placer.set_depth_motion(SE3<S>::exp((Eigen::Matrix<S, 6, 1>() << S(0.02), 0, 0, 0, S(0.01), 0).finished()));
  Image<float> depth(64, 48);
  for (int i = 0; i < 64 * 48; ++i) depth.data()[i] = i % 11 == 0 ? 0.0F : 1.0F + 0.001F * float(i % 37);
  std::vector<Feature> features;
  for (int i = 0; i < 40; ++i) {  // some of them outside the image
    Feature f;
    f.u = static_cast<float>((i * 13) % 75) - 4.6F;
    f.v = static_cast<float>((i * 7) % 60) - 5.3F;
    features.push_back(f);
  }
  auto alone = features;
  for (Feature& f : alone) placer.place(f, Vector2(S(f.u), S(f.v)), depth);
  placer.place(std::span<Feature>(features), depth);
  for (std::size_t i = 0; i < features.size(); ++i) {
    CHECK(features[i].u == alone[i].u);
    CHECK(features[i].v == alone[i].v);
    CHECK(features[i].x == alone[i].x);
    CHECK(features[i].y == alone[i].y);
    CHECK(features[i].depth == alone[i].depth);
  }
}

TEST_CASE_TEMPLATE("a pixel to which the lens has no inverse has neither a place nor a depth", S, float,
                   double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const PinholeBrownConrady<S> camera(
      Pinhole<S>(S(300), S(300), S(320), S(240)),
      BrownConrady<S>(S(-0.5), S(0), S(0), S(0), S(0)));  // folds inside the image
  const FeaturePlacer<PinholeBrownConrady<S>> placer(camera, 640, 480);
  const Image<float> depth(640, 480, 2.0F);
  Feature f;
  placer.place(f, Vector2(S(2), S(2)), depth);
  CHECK_FALSE(placer.sees(f));
  CHECK(f.depth == 0.0F);
  placer.place(f, Vector2(S(320), S(240)), depth);
  CHECK(f.depth == 2.0F);
}

TEST_CASE_TEMPLATE("depth taken later than the colour is brought back to its time", S, float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const Pinhole<S> camera(S(500), S(500), S(320), S(240));
  FeaturePlacer<Pinhole<S>> placer(camera, 640, 480);
  // A slanted wall, z = 2 + x / 2. Between colour and depth the camera moves 4 cm aside and 3 cm ahead.
  const Eigen::Matrix<S, 3, 1> moved(S(-0.04), S(0), S(-0.03));
  Image<float> depth(640, 480);
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {  // the ray r z + (-moved) meets the wall
      const S r = (S(u) - S(320)) / S(500);
      depth(u, v) = static_cast<float>((S(2) - moved.x() / S(2) + moved.z()) / (S(1) - r / S(2)));
    }
  }
  Feature then, now;
  placer.place(then, Vector2(S(400), S(200)), depth);
  placer.set_depth_motion(SE3<S>(SO3<S>(), moved));
  placer.place(now, Vector2(S(400), S(200)), depth);
  const float truth = static_cast<float>(S(2) / (S(1) - S(80) / S(500) / S(2)));
  // A whole pixel of the wall's slant is what the rounding costs.
  CHECK(std::abs(now.depth - truth) < 0.003F);
  CHECK(std::abs(then.depth - truth) > 0.005F);
}

TEST_CASE_TEMPLATE("what rows saw one after the other is placed as the middle row would have seen it", S,
                   float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const PinholeBrownConrady<S> camera(Pinhole<S>(S(500), S(505), S(320), S(240)),
                                      BrownConrady<S>(S(0.1), S(-0.2), S(0.001), S(-0.002), S(0)));
  FeaturePlacer<PinholeBrownConrady<S>> placer(camera, 640, 480);
  Eigen::Matrix<S, 6, 1> motion;  // in 24 ms: 0.5 m/s and 1.5 rad/s
  motion << S(0.010), S(-0.005), S(0.006), S(0.018), S(0.03), S(-0.012);
  const auto row_pose = [&](S v) { return SE3<S>::exp(motion * (v / S(479) - S(0.5))); };
  // A slanted wall of the middle row's frame, n p = 1, as each row sees it.
  const Vector3 n(S(-0.15), S(0.1), S(0.5));
  Image<float> depth(640, 480);
  for (int v = 0; v < 480; ++v) {
    const SE3<S> T_middle_row = row_pose(S(v)).inverse();
    for (int u = 0; u < 640; ++u) {
      const auto ray = camera.unproject(Vector2(S(u), S(v)), S(1));
      REQUIRE(ray);
      depth(u, v) =
          static_cast<float>((S(1) - n.dot(T_middle_row.translation())) / n.dot(T_middle_row.so3() * *ray));
    }
  }
  placer.set_rolling_shutter(RollingShutter<S>(motion, 480));
  for (const Vector2& ideal : {Vector2(S(60), S(40)), Vector2(S(590), S(50)), Vector2(S(330), S(250)),
                               Vector2(S(80), S(440)), Vector2(S(560), S(430))}) {
    const Vector3 ray = placer.pinhole().ray(ideal);
    const Vector3 p = ray / n.dot(ray);
    const auto seen = placer.project(p);
    REQUIRE(seen);
    Feature f;
    placer.place(f, *seen, depth);
    CHECK((Vector2(S(f.x), S(f.y)) - ideal).norm() < S(0.05));
    CHECK(std::abs(S(f.depth) - p.z()) < S(0.004));  // and the slant within one
    // Without depth its place is that of something far away: turned, not moved.
    Feature far;
    placer.place(far, *seen, Image<float>(640, 480, 0.0F));
    const Vector3 turned = row_pose(seen->y()).so3().inverse() * *camera.unproject(*seen, S(1));
    CHECK(far.depth == 0.0F);
    CHECK((Vector2(S(far.x), S(far.y)) - *placer.pinhole().project(turned)).norm() < S(0.12));
  }
}

TEST_CASE("features on a mask are flagged, flags that are set stay, and outside the image nothing is read") {
  Image<std::uint8_t> mask(10, 10, 0);
  mask(3, 4) = 1;
  std::vector<Feature> features(4);
  features[0].u = 3.4F;
  features[0].v = 3.6F;
  features[1].u = 5.0F;
  features[2].u = -7.0F;
  features[3].u = 1000.0F;
  std::array<std::uint8_t, 4> flags{0, 1, 0, 0};
  flag_masked(mask, features, flags);
  CHECK(flags == std::array<std::uint8_t, 4>{1, 1, 0, 0});
  features[2].depth = features[1].depth = 1;
  CHECK(unmasked_with_depth(features, flags) == 1);
  CHECK(unmasked_share<double>(flags) == 0.5);
  CHECK(unmasked_share<float>({}) == 1.0F);
}

TEST_CASE_TEMPLATE("a feature placed by one motion is placed again by another as if by that at once", S,
                   float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const PinholeBrownConrady<S> camera(Pinhole<S>(S(500), S(505), S(320), S(240)),
                                      BrownConrady<S>(S(0.1), S(-0.2), S(0.001), S(-0.002), S(0)));
  FeaturePlacer<PinholeBrownConrady<S>> placer(camera, 640, 480);
  Image<float> depth(640, 480, 2.0F);
  depth(60, 40) = std::numeric_limits<float>::quiet_NaN();
  Eigen::Matrix<S, 6, 1> first, second;
  first << S(0.010), S(-0.005), S(0.006), S(0.018), S(0.03), S(-0.012);
  second << S(-0.004), S(0.008), S(-0.006), S(-0.02), S(0.01), S(0.02);
  const RollingShutter<S> none, by_first(first, 480), by_second(second, 480);
  for (const auto& [before, after] :
       {std::pair(by_first, by_second), std::pair(none, by_second), std::pair(by_first, none)}) {
    for (const Vector2& x : {Vector2(S(60), S(40)), Vector2(S(590.3), S(50.7)), Vector2(S(330), S(250)),
                             Vector2(S(80), S(440.4)), Vector2(S(700), S(20))}) {
      Feature again, once;
      placer.set_rolling_shutter(before);
      placer.place(again, x, depth);
      placer.set_rolling_shutter(after);
      placer.place_again(again, before);
      placer.place(once, x, depth);
      CHECK(std::abs(again.x - once.x) < 0.005F);
      CHECK(std::abs(again.y - once.y) < 0.005F);
      CHECK(std::abs(again.depth - once.depth) < 1e-4F);
    }
  }
}
