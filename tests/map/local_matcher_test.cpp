// SPDX-License-Identifier: BSD-3-Clause
// Points made from one image, found again in the next, and the pose that follows from them: PointMaker,
// LocalMatcher and MatchedPose on a textured wall, of which the camera sees another part.
#include "dynslam/map/local_matcher.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/map/matched_pose.hpp"
#include "dynslam/map/point_maker.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

constexpr int kWidth = 320, kHeight = 240, kShift = 6;  // pixels between the two images
constexpr std::array<float, 2> kScales{1.0F, 2.0F};

/// A wall 2 m ahead, seen before and after a step of 4.8 cm to the right.
template <class S>
struct Wall {
  using Map = KeyframeMap<S, PointPatch>;

  Pinhole<S> camera{S(250), S(250), S(160), S(120)};
  Image<float> depth{kWidth, kHeight, 2.0F};
  std::array<HalvingPyramid<std::uint8_t>, 2> pyramids;
  SE3<S> T_c1_w{SO3<S>(), Eigen::Matrix<S, 3, 1>(S(-kShift) * S(2) / S(250), S(0), S(0))};
  Map map;
  LocalMatcher<Pinhole<S>> matcher{camera, kWidth, kHeight, kScales};
  PointMaker<S> maker{camera, kWidth, kHeight};
  MatchedPose<S> pose{camera};
  test::Rng rng{"wall"};

  Wall() {
    Image<std::uint8_t> texture(kWidth + kShift, kHeight);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth + kShift; ++u) {
        const double g = 128 + 50 * std::sin(0.31 * u + 0.2 * v) + 50 * std::cos(0.27 * v - 0.11 * u);
        texture(u, v) = static_cast<std::uint8_t>(g);
      }
    }
    for (int k = 0; k < 2; ++k) {
      pyramids[static_cast<std::size_t>(k)].build(
          ImageView<const std::uint8_t>(texture.data() + k * kShift, kWidth, kHeight, kWidth + kShift), 2);
    }
  }

  [[nodiscard]] Descriptor descriptor() {
    Descriptor d;
    for (auto& word : d) word = rng.engine()();
    return d;
  }

  /// A frame with features at the given pixels, of level 0.
  [[nodiscard]] FeatureFrame<S> frame(const std::vector<Eigen::Vector2d>& pixels,
                               const std::vector<Descriptor>& looks) {
    FeatureFrame<S> f;
    for (const auto& x : pixels) {
      f.features.emplace_back();
      matcher.placer().place(f.features.back(), x.cast<S>(), depth);
    }
    f.descriptors = looks;
    f.point.assign(pixels.size(), -1);
    f.dynamic.assign(pixels.size(), 0);
    f.grid.build(f.features, kWidth, kHeight);
    return f;
  }

  /// The first keyframe, with features every 24 pixels.
  FeatureFrame<S> first_keyframe() {
    std::vector<Eigen::Vector2d> pixels;
    std::vector<Descriptor> looks;
    for (int v = 30; v < kHeight - 20; v += 24) {
      for (int u = 30; u < kWidth - 20; u += 24) {
        pixels.emplace_back(u, v);
        looks.push_back(descriptor());
      }
    }
    FeatureFrame<S> f = frame(pixels, looks);
    maker.trust_all(f);
    CHECK(maker.make(map, pyramids[0], f) == static_cast<int>(pixels.size()));
    map.add_keyframe(f);
    return f;
  }

  [[nodiscard]] SE3<S> off() const {  // a start 1 cm and half a degree away
    return SE3<S>::exp(
               (Eigen::Matrix<S, 6, 1>() << S(0.01), S(-0.004), S(0.006), S(0.004), S(0.006), S(-0.005))
                   .finished()) *
           T_c1_w;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("patches find every point of the map without a corner, and the pose to a millimetre", S,
                   float, double) {
  Wall<S> wall;
  const FeatureFrame<S> first = wall.first_keyframe();
  FeatureFrame<S> now = wall.frame({}, {});
  wall.matcher.begin(now);
  // The local map is that of the keyframe in common; the newest one always belongs to it.
  const int matches = wall.matcher.match_local(wall.map, wall.T_c1_w, wall.pyramids[1], wall.depth, now);
  CHECK(matches == static_cast<int>(first.features.size()));
  REQUIRE(now.features.size() == first.features.size());
  for (std::size_t i = 0; i < now.features.size(); ++i) {
    const Feature& before = first.features[static_cast<std::size_t>(now.point[i])];
    CHECK(std::abs(now.features[i].u + static_cast<float>(kShift) - before.u) < 0.1F);
    CHECK(std::abs(now.features[i].v - before.v) < 0.1F);
    CHECK(now.features[i].depth == 2.0F);
  }
  const auto result = wall.pose.optimize(wall.map, wall.off(), now);
  CHECK(result.ok());
  CHECK(result.inliers == matches);
  CHECK((result.T_c_w * wall.T_c1_w.inverse()).log().norm() < S(2e-3));

  now.point[0] = -1;  // a feature that stands for a point only goes with it
  wall.matcher.drop_unmatched(now);
  CHECK(now.features.size() == first.features.size() - 1);
  wall.matcher.clear(now);
  CHECK(now.features.empty());
}

TEST_CASE_TEMPLATE(
    "descriptors match corners near where they are expected, of whom the consensus drops a mover", S, float,
    double) {
  Wall<S> wall;
  FeatureFrame<S> last = wall.first_keyframe();
  std::vector<Eigen::Vector2d> pixels;
  std::vector<Descriptor> looks;
  for (std::size_t i = 0; i < last.features.size(); ++i) {
    const bool moved = i % 5 == 0;  // carried 4 pixels down
    pixels.emplace_back(static_cast<double>(last.features[i].u) - kShift,
                        static_cast<double>(last.features[i].v) + (moved ? 4 : 0));
    looks.push_back(last.descriptors[i]);
  }
  FeatureFrame<S> now = wall.frame(pixels, looks);
  wall.matcher.begin(now);
  now.dynamic[1] = 1;  // on a mask: not to be matched
  const int matches = wall.matcher.match_last(wall.map, last, SE3<S>(), 12.0F, now);
  CHECK(matches == static_cast<int>(pixels.size()) - 1);
  CHECK(now.point[1] == -1);
  wall.pose.gather(wall.map, now);
  PoseConsensusOptions<S> options;
  const SE3<S> start = wall.pose.consensus(SE3<S>(), {}, options, nullptr);
  wall.pose.keep_consistent(start, options.truncation, now);
  for (std::size_t i = 0; i < pixels.size(); ++i) CHECK((now.point[i] >= 0) == (i % 5 != 0 && i != 1));
  const auto result = wall.pose.optimize(wall.map, start, now);
  CHECK((result.T_c_w * wall.T_c1_w.inverse()).log().norm() < S(2e-3));
}

TEST_CASE_TEMPLATE("points are made where there is depth, trust and room, and nowhere else", S, float,
                   double) {
  Wall<S> wall;
  const std::vector<Eigen::Vector2d> pixels{{100, 100}, {101, 101}, {200, 100},
                                            {150, 150}, {60, 60},   {250, 200}};
  std::vector<Descriptor> looks;
  for (std::size_t i = 0; i < pixels.size(); ++i) looks.push_back(wall.descriptor());
  FeatureFrame<S> f = wall.frame(pixels, looks);
  f.features[2].depth = 0;
  f.features[3].depth = 20;
  f.dynamic[4] = 1;
  PointMakerOptions<S> options;
  options.enough_known = 1;
  PointMaker<S> maker(wall.camera, kWidth, kHeight, options);
  maker.trust(f, [](float u, float) { return u < 240; });  // the last is newly seen
  CHECK(maker.make(wall.map, wall.pyramids[0], f) == 1);
  CHECK(f.point == std::vector<int>{0, -1, -1, -1, -1, -1});
  CHECK((wall.map.point(0).p_w - Eigen::Matrix<S, 3, 1>(S(-0.48), S(-0.16), S(2))).norm() < S(1e-5));
  wall.map.add_keyframe(f);  // whose points the next make() looks at
  // Where too little is known everything is trusted: the camera has to go on.
  options.enough_known = 100;
  PointMaker<S> hurried(wall.camera, kWidth, kHeight, options);
  hurried.trust(f, [](float, float) { return false; });
  CHECK(hurried.make(wall.map, wall.pyramids[0], f) == 2);
  CHECK(f.point[5] == 1);
}
