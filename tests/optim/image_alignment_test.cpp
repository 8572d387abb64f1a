// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/image_alignment.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "moved_camera.hpp"
#include "moving_scene.hpp"

using namespace dynslam;
using test::surface_texture;

namespace {

constexpr int kWidth = 160, kHeight = 120;

/// Structure of all sizes from a room's to a hand's, as in a picture of a room; 0 to 1.
double texture(double x, double y, std::uint64_t seed) {
  return 0.4 * surface_texture(x / 16, y / 16, seed) + 0.3 * surface_texture(x / 5, y / 5, seed + 1) +
         0.3 * surface_texture(x / 2, y / 2, seed + 2);
}

/// Two views of a wall with a slope and of a board before it, which is carried between them.
template <class S>
struct Pair {
  Pinhole<S> camera{S(130), S(130), S(80), S(60)};
  SE3<double> T_w_image;
  std::array<Image<std::uint8_t>, 2> grey;
  Image<float> depth;
  Image<std::uint8_t> board;  // in the reference
  std::array<HalvingPyramid<std::uint8_t>, 2> pyramids;

  Pair(const SE3<double>& T_reference_image, const Eigen::Vector2d& carried, double brighter = 0)
      : T_w_image(T_reference_image), depth(kWidth, kHeight), board(kWidth, kHeight, 0) {
    for (std::size_t k = 0; k < 2; ++k) {
      grey[k].resize(kWidth, kHeight);
      const SE3<double> T_w_c = k == 0 ? SE3<double>() : T_w_image;
      const Eigen::Vector2d centre = Eigen::Vector2d(-0.4, 0.1) + (k == 0 ? Eigen::Vector2d(0, 0) : carried);
      for (int v = 0; v < kHeight; ++v) {
        for (int u = 0; u < kWidth; ++u) {
          const Eigen::Vector3d o = T_w_c.translation(),
                                d = T_w_c.rotation_matrix() *
                                    Eigen::Vector3d((u - 80) / 130.0, (v - 60) / 130.0, 1);
          double t = (2 - o.z()) / d.z();  // the board, at z = 2
          Eigen::Vector2d p = (o + t * d).head<2>() - centre;
          const bool on_board = p.cwiseAbs().maxCoeff() < 0.4;
          if (!on_board) {  // the wall, z = 3 + 0.3 x
            t = (3 + 0.3 * o.x() - o.z()) / (d.z() - 0.3 * d.x());
            p = (o + t * d).head<2>();
          }
          grey[k](u, v) = static_cast<std::uint8_t>(30 + 180 * texture(p.x(), p.y(), on_board ? 7 : 3) +
                                                    (k == 0 ? 0 : brighter) + 0.5);
          if (k == 0) {
            depth(u, v) = static_cast<float>(t);
            board(u, v) = on_board ? 255 : 0;
          }
        }
      }
      pyramids[k].build(grey[k], 4);
    }
  }
  void mask_the_board() {
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) depth(u, v) = board(u, v) != 0 ? 0.0F : depth(u, v);
    }
  }
  [[nodiscard]] ImageAlignmentResult<S> align(const SE3<double>& start = {},
                                              const ImageAlignmentOptions<S>& options = {}) const {
    return align(start, options, depth);
  }
  [[nodiscard]] ImageAlignmentResult<S> align(const SE3<double>& start,
                                              const ImageAlignmentOptions<S>& options,
                                              const Image<float>& reference_depth) const {
    ImageAlignmentWorkspace<S> workspace;
    const std::array<SE3<S>, 1> starts{start.template cast<S>()};
    return align_images<S>(pyramids[0], reference_depth, pyramids[1], camera, std::span<const SE3<S>>(starts),
                           options, workspace);
  }
  /// How far off the wall's pixels of the reference are in the image, on average [px].
  [[nodiscard]] double error(const SE3<S>& T_image_reference) const {
    double sum = 0;
    int n = 0;
    for (int v = 0; v < kHeight; v += 5) {
      for (int u = 0; u < kWidth; u += 5) {
        if (board(u, v) != 0) continue;
        const auto p =
            camera.unproject(Eigen::Matrix<S, 2, 1>(S(u), S(v)), S(depth(u, v) > 0 ? depth(u, v) : 3));
        const auto x = camera.project(T_image_reference * *p);
        const auto truth =
            camera.project((T_w_image.inverse() * p->template cast<double>()).template cast<S>());
        if (!x || !truth) continue;
        sum += static_cast<double>((*x - *truth).norm());
        ++n;
      }
    }
    return sum / n;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("a turn by a tenth of the view and a change of exposure are found to a tenth of a pixel",
                   S, float, double) {
  // 6 degrees are 14 of 160 pixels, on the coarsest of four levels 1.7.
  Pair<S> pair(test::moved(0.03, -0.02, 0.04, 0.10), Eigen::Vector2d::Zero(), 12);
  const auto found = pair.align();
  REQUIRE(found.ok());
  CHECK(pair.error(found.T_image_reference) < 0.1);
  CHECK(static_cast<double>(found.brightness) == doctest::Approx(12).epsilon(0.1));
  CHECK(found.overlap > S(0.75));
}

TEST_CASE_TEMPLATE("what moves does not lead astray where it is left out, and little where it is not", S,
                   float, double) {
  for (const bool masked : {true, false}) {
    CAPTURE(masked);
    Pair<S> pair(test::moved(0.01, 0, 0, 0.04), Eigen::Vector2d(0.08, 0.03));
    if (masked) pair.mask_the_board();
    const auto found = pair.align();
    REQUIRE(found.ok());
    CHECK(pair.error(found.T_image_reference) < (masked ? 0.1 : 0.5));
  }
}

TEST_CASE_TEMPLATE("of several starts the one that fits is taken", S, float, double) {
  Pair<S> pair(test::moved(0.02, 0, 0, 0.35), Eigen::Vector2d::Zero());  // 20 degrees: a third of the view
  const SE3<double> near = test::moved(0, 0, 0, 0.31).inverse();
  ImageAlignmentWorkspace<S> workspace;
  for (const bool first : {true, false}) {
    const std::array<SE3<S>, 2> starts{first ? near.cast<S>() : SE3<S>(), first ? SE3<S>() : near.cast<S>()};
    const auto found = align_images<S>(pair.pyramids[0], pair.depth, pair.pyramids[1], pair.camera,
                                       std::span<const SE3<S>>(starts), {}, workspace);
    REQUIRE(found.ok());
    CHECK(pair.error(found.T_image_reference) < 0.1);
  }
}

TEST_CASE("depth of half the size serves as well") {
  Pair<double> pair(test::moved(0.03, -0.02, 0.04, 0.10), Eigen::Vector2d::Zero());
  Image<float> half(kWidth / 2, kHeight / 2);
  for (int v = 0; v < half.height(); ++v) {
    for (int u = 0; u < half.width(); ++u) half(u, v) = pair.depth(2 * u + 1, 2 * v + 1);
  }
  const auto found = pair.align({}, {}, half);
  REQUIRE(found.ok());
  CHECK(pair.error(found.T_image_reference) < 0.2);
}

TEST_CASE("a level without gradients is passed over: the coarser ones serve") {
  const Pair<double> pair(test::moved(0.03, -0.02, 0.04, 0.10), Eigen::Vector2d::Zero());
  ImageAlignmentOptions<double> options;
  const auto all = pair.align({}, options);
  options.min_gradient = 14;
  const auto coarse = pair.align({}, options);
  REQUIRE(all.ok());
  REQUIRE(coarse.ok());
  CHECK(coarse.pixels < all.pixels / 2);
  CHECK(pair.error(coarse.T_image_reference) < 1);
}

TEST_CASE_TEMPLATE("without depth, without texture and without overlap nothing is claimed", S, float,
                   double) {
  const SE3<double> start = test::moved(0.01, 0, 0, 0.02);
  {
    Pair<S> pair(test::moved(0, 0, 0, 0.03), Eigen::Vector2d::Zero());
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) pair.depth(u, v) = std::numeric_limits<float>::quiet_NaN();
    }
    const auto found = pair.align(start);
    CHECK(found.status == ImageAlignmentStatus::too_few_pixels);
    CHECK((found.T_image_reference.translation() - start.translation().cast<S>()).norm() == S(0));
  }
  {
    Pair<S> pair(test::moved(0, 0, 0, 0.03), Eigen::Vector2d::Zero());
    ImageAlignmentOptions<S> options;
    options.min_gradient = S(300);
    CHECK(pair.align(start, options).status == ImageAlignmentStatus::too_few_pixels);
  }
  {
    Pair<S> pair(test::moved(0, 0, 0, 0.03), Eigen::Vector2d::Zero());
    const auto found = pair.align(test::moved(0, 0, 0, 1.3));  // looks past the reference's view
    CHECK(found.status == ImageAlignmentStatus::little_overlap);
    CHECK_FALSE(found.ok());
  }
}
