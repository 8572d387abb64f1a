// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/features/patch_matcher.hpp"

#include <doctest/doctest.h>

#include <cmath>

#include "dynslam/features/corners.hpp"
#include "dynslam/features/patch_search.hpp"
#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "equidistant_camera.hpp"
#include "moving_scene.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A texture, turned about the image's centre and shifted. @param fineness  0.01: structures of 6 and 12
/// pixels
Image<std::uint8_t> textured(double turn, const Eigen::Vector2d& shift, double fineness = 0.01) {
  Image<std::uint8_t> image(320, 240);
  for (int v = 0; v < 240; ++v) {
    for (int u = 0; u < 320; ++u) {
      const Eigen::Vector2d d = Eigen::Rotation2Dd(-turn) * (Eigen::Vector2d(u - 160, v - 120) - shift);
      image(u, v) =
          static_cast<std::uint8_t>(220 * test::surface_texture(fineness * d.x(), fineness * d.y(), 5));
    }
  }
  return image;
}

/// Derivative, by central differences, of where the plane that faced the first camera appears in the second.
template <class C>
void check_warp(const C& camera) {
  using S = typename C::ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const SE3<S> T(SO3<S>::exp(Eigen::Matrix<S, 3, 1>(S(0.1), S(-0.2), S(0.3))),
                 Eigen::Matrix<S, 3, 1>(S(0.2), S(-0.1), S(0.3)));
  const Vector2 x(S(210), S(90));
  const S z = S(1.7), h = S(0.5);
  const auto there = [&](const Vector2& from) { return *camera.project(T * *camera.unproject(from, z)); };
  const auto p_ref = camera.unproject(x, z);
  REQUIRE(p_ref);
  const auto A = patch_warp(camera, *p_ref, T * *p_ref, T.rotation_matrix());
  REQUIRE(A);
  for (int k = 0; k < 2; ++k) {
    const Vector2 step = h * Vector2::Unit(k);
    CHECK(((there(x + step) - there(x - step)) / (S(2) * h) - A->col(k)).norm() < S(2e-3));
  }
  CHECK_FALSE(patch_warp(camera, *p_ref, Eigen::Matrix<S, 3, 1>(S(0), S(0), S(-1)), T.rotation_matrix()));
}

}  // namespace

TEST_CASE_TEMPLATE("the warp is the derivative of what it stands for, with any lens", S, float, double) {
  const Pinhole<S> pinhole(S(260), S(250), S(160), S(120));
  check_warp(pinhole);
  check_warp(PinholeBrownConrady<S>(pinhole, BrownConrady<S>(S(-0.2), S(0.05), S(0.001), S(-0.002), S(0))));
  check_warp(test::EquidistantCamera<S>{S(200), S(160), S(120)});
}

TEST_CASE_TEMPLATE("a patch is found where it is, in both scalars", S, float, double) {
  const Eigen::Vector2d shift(2.3, -1.6);
  HalvingPyramid<> before, after;
  before.build(textured(0, Eigen::Vector2d::Zero()), 3);
  after.build(textured(0.1, shift), 3);
  const Eigen::Matrix<S, 2, 2> A = Eigen::Rotation2D<S>(S(0.1)).toRotationMatrix();
  test::Rng rng("patch in both scalars");
  int found = 0, precise = 0;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Matrix<S, 2, 1> x(S(rng.uniform(80, 240)), S(rng.uniform(70, 170)));
    const Eigen::Matrix<S, 2, 1> centre(S(160), S(120));
    const Eigen::Matrix<S, 2, 1> expected = A * (x - centre) + centre + shift.cast<S>();
    const auto match =
        match_patch<S>(after, cut_patch<S>(before, x, i % 2), A, Eigen::Matrix<S, 2, 1>(expected + A.col(0)));
    if (!match) continue;
    ++found;
    precise += (match->x - expected).norm() < S(0.25) ? 1 : 0;
  }
  CHECK(found > 50);
  CHECK(precise > found * 9 / 10);
}

TEST_CASE("what is far from where it is expected is found over the pyramid's levels") {
  const Eigen::Vector2d shift(19.0, -13.0);
  HalvingPyramid<> before, after;
  before.build(textured(0, Eigen::Vector2d::Zero(), 0.003), 4);
  after.build(textured(0, shift, 0.003), 4);
  const Eigen::Matrix2d A = Eigen::Matrix2d::Identity();
  test::Rng rng("patch search");
  int found = 0, near = 0;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector2d x(rng.uniform(80, 240), rng.uniform(70, 170));
    const auto to = search_patch<double>(before, x, A, after, x);
    found += to && (*to - x - shift).norm() < 1 ? 1 : 0;
    const auto match = match_patch<double>(after, cut_patch<double>(before, x, 0), A, x);
    near += match && (match->x - x - shift).norm() < 1 ? 1 : 0;
  }
  CHECK(found > 40);
  CHECK(near < 5);  // a single level does not reach so far
}

TEST_CASE("corners are spread over the image and lie on texture") {
  Image<std::uint8_t> image = textured(0, Eigen::Vector2d::Zero());
  for (int v = 0; v < 240; ++v) {
    for (int u = 160; u < 320; ++u) image(u, v) = 90;  // half of it flat
  }
  const CornerOptions options;
  CornerWorkspace workspace;
  std::vector<Eigen::Vector2i> corners;
  find_corners(image, 100, options, workspace, corners);
  CHECK(corners.size() > 30);
  CHECK(corners.size() < 75);
  for (const auto& c : corners) {
    CHECK(c.x() < 165);
    CHECK(c.x() >= options.border);
    CHECK(c.y() >= options.border);
    CHECK(c.y() < 240 - options.border);
  }
  find_corners(Image<std::uint8_t>(15, 15), 100, options, workspace, corners);
  CHECK(corners.empty());
}
