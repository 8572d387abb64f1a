// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/reference_keyframe.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "moving_scene.hpp"

using namespace dynslam;

namespace {

constexpr int kWallWidth = 320, kWallHeight = 240;

/// A textured wall; its left part, up to column `covered`, behind something of another texture.
HalvingPyramid<std::uint8_t> wall(int covered, int levels) {
  Image<std::uint8_t> image(kWallWidth, kWallHeight);
  for (int v = 0; v < kWallHeight; ++v) {
    for (int u = 0; u < kWallWidth; ++u)
      image(u, v) = static_cast<std::uint8_t>(
          220 *
          test::surface_texture(0.01 * u, 0.01 * v, u < covered ? std::uint64_t(77) : std::uint64_t(5)));
  }
  HalvingPyramid<std::uint8_t> pyramid;
  pyramid.build(image, levels);
  return pyramid;
}

/// A reference keyframe before an uncovered wall 2 m away. @param moving  columns left of it move
template <class S>
ReferenceKeyframe<S> reference_of(const Pinhole<S>& camera, int moving, const ReferenceOptions& options) {
  std::vector<ReferenceKeypoint<S>> keypoints;
  for (int v = 20; v < kWallHeight - 20; v += 12) {
    for (int u = 20; u < kWallWidth - 20; u += 12)
      keypoints.push_back({{S(u), S(v)}, S(2), S(1), u < moving});
  }
  ReferenceKeyframe<S> reference;
  reference.set(camera, wall(0, options.levels), std::span<const ReferenceKeypoint<S>>(keypoints), {},
                options);
  return reference;
}

template <class S>
double found_after(ReferenceKeyframe<S> reference, const Pinhole<S>& camera, int covered, const SE3<S>& T_c_w,
                   const ReferenceOptions& options) {
  std::vector<KeypointMatch<S>> matches;
  reference.track(camera, wall(covered, options.levels), T_c_w, Image<std::uint8_t>(), options, matches);
  return reference.resting_found();
}

}  // namespace

TEST_CASE_TEMPLATE("keypoints at rest are found but where something covers them, whatever moved on", S, float,
                   double) {
  const Pinhole<S> camera(S(260), S(260), S(159.5), S(119.5));
  const ReferenceOptions options;
  const auto at_rest = reference_of(camera, 0, options);
  CHECK(at_rest.resting_found() == 1.0);
  const double all = found_after(at_rest, camera, 0, {}, options);  // but those where the texture is too weak
  CHECK(all > 0.8);
  CHECK(found_after(at_rest, camera, kWallWidth / 4, {}, options) ==
        doctest::Approx(0.75 * all).epsilon(0.1));
  CHECK(found_after(at_rest, camera, 3 * kWallWidth / 4, {}, options) ==
        doctest::Approx(0.25 * all).epsilon(0.2));
  // What stood there moved, and has moved on: all that is at rest is found.
  const auto moved = reference_of(camera, 3 * kWallWidth / 4, options);
  CHECK(found_after(moved, camera, 3 * kWallWidth / 4, {}, options) == doctest::Approx(all).epsilon(0.05));
}

TEST_CASE_TEMPLATE("keypoints out of view are not missed", S, float, double) {
  const Pinhole<S> camera(S(260), S(260), S(159.5), S(119.5));
  const ReferenceOptions options;
  const SE3<S> away(SO3<S>::exp(Eigen::Matrix<S, 3, 1>(S(0), S(3), S(0))), Eigen::Matrix<S, 3, 1>::Zero());
  CHECK(found_after(reference_of(camera, 0, options), camera, 0, away, options) == 1.0);
}
