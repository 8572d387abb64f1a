// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/patch_matcher.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "dynslam/image/image_view.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/optim/patch_alignment.hpp"

namespace dynslam::runtime {
namespace {

using Template = AlignmentPatch<float, 8>;
constexpr float kMinGradient = 8.0F;  // smaller eigenvalue of the mean gradient product, grey^2
constexpr float kRounding = 1e-4F;    // of coordinates inside a patch [px]

}  // namespace

std::optional<Eigen::Matrix2d> patch_warp(const Pinhole<double>& camera, const PointPatch& patch,
                                          const Eigen::Vector3d& p_c, const Eigen::Matrix3d& R) {
  Pinhole<double>::Jacobian J;
  if (!camera.project(p_c, &J)) return std::nullopt;
  const auto z = static_cast<double>(patch.depth);
  Eigen::Matrix<double, 3, 2> plane;
  plane.col(0) = R.col(0) * (z / camera.fx());
  plane.col(1) = R.col(1) * (z / camera.fy());
  return J * plane;
}

PointPatch PatchMatcher::cut(const ImagePyramid& pyramid, const Eigen::Vector2d& x, int level) {
  PointPatch patch;
  const cv::Mat& image = pyramid.levels[static_cast<std::size_t>(level)];
  const Eigen::Vector2d p = pyramid.to_level(x, level);
  constexpr int kHalf = PointPatch::kSide / 2;
  const int u = static_cast<int>(std::lround(p.x())), v = static_cast<int>(std::lround(p.y()));
  if (u < kHalf || v < kHalf || u + kHalf > image.cols || v + kHalf > image.rows) return patch;
  for (int y = 0; y < PointPatch::kSide; ++y) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(v - kHalf + y) + (u - kHalf);
    std::copy(row, row + PointPatch::kSide, patch.grey.begin() + y * PointPatch::kSide);
  }
  patch.centre =
      Eigen::Vector2f(static_cast<float>(kHalf + p.x() - u), static_cast<float>(kHalf + p.y() - v));
  patch.level = static_cast<std::int16_t>(level);
  return patch;
}

bool PatchMatcher::match(const ImagePyramid& pyramid, const PointPatch& patch, const Eigen::Matrix2d& warp,
                         const Eigen::Vector2d& start, PatchMatch& out) {
  if (patch.level < 0) return false;
  const double determinant = warp.determinant();
  if (!(determinant > 0.1 && determinant < 10)) return false;
  // The level on which the patch has the size it was cut with.
  const auto& sizes = pyramid.pixel_size;
  const double wanted = sizes[static_cast<std::size_t>(patch.level)].x() * std::sqrt(determinant);
  int level = 0;
  while (level + 1 < static_cast<int>(sizes.size()) &&
         sizes[static_cast<std::size_t>(level) + 1].x() < 1.1 * wanted)
    ++level;

  // Template: the patch as it must look from here.
  const Eigen::Matrix2f to_patch = (warp.inverse() * (sizes[static_cast<std::size_t>(level)].x() /
                                                      sizes[static_cast<std::size_t>(patch.level)].x()))
                                       .cast<float>();
  constexpr int kSide = Template::kBordered;
  constexpr int kOrigin = Template::kSize / 2 + 1;
  // An affine image of a square lies inside where its corners do.
  const auto source = [&](int x, int y) {
    return Eigen::Vector2f(patch.centre + to_patch * Eigen::Vector2f(static_cast<float>(x - kOrigin),
                                                                     static_cast<float>(y - kOrigin)));
  };
  for (const int y : {0, kSide - 1}) {
    for (const int x : {0, kSide - 1}) {
      const Eigen::Vector2f p = source(x, y);
      constexpr auto kLimit = static_cast<float>(PointPatch::kSide - 1) - kRounding;
      if (!(p.x() >= kRounding && p.y() >= kRounding && p.x() < kLimit && p.y() < kLimit)) return false;
    }
  }
  using Row = Eigen::Array<float, kSide, 1>;
  const Row columns = Row::LinSpaced(kSide, 0.0F, static_cast<float>(kSide - 1));
  std::array<float, static_cast<std::size_t>(kSide * kSide)> bordered;
  for (int y = 0; y < kSide; ++y) {
    const Eigen::Vector2f first = source(0, y);
    const Row px = first.x() + to_patch(0, 0) * columns, py = first.y() + to_patch(1, 0) * columns;
    const Eigen::Array<int, kSide, 1> u = px.cast<int>(), v = py.cast<int>();
    const Row a = px - u.cast<float>(), b = py - v.cast<float>();
    Row g00, g10, g01, g11;
    for (int x = 0; x < kSide; ++x) {
      const std::uint8_t* g = patch.grey.data() + v[x] * PointPatch::kSide + u[x];
      g00[x] = g[0];
      g10[x] = g[1];
      g01[x] = g[PointPatch::kSide];
      g11[x] = g[PointPatch::kSide + 1];
    }
    const Row top = g00 + a * (g10 - g00), bottom = g01 + a * (g11 - g01);
    Eigen::Map<Row>(bordered.data() + y * kSide) = top + b * (bottom - top);
  }
  Template reference;
  if (!reference.set(bordered, kMinGradient)) return false;
  const auto image = interop::view<const std::uint8_t>(pyramid.levels[static_cast<std::size_t>(level)]);
  const auto found = reference.align(image, Eigen::Vector2f(pyramid.to_level(start, level).cast<float>()));
  if (!found.ok) return false;
  out.x = pyramid.to_base(found.x.cast<double>(), level);
  out.level = level;
  out.correlation = found.correlation;
  return true;
}

}  // namespace dynslam::runtime
