// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/image/image_view.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/optim/patch_alignment.hpp"

namespace dynslam {

/// What a point looked like in the image that it is compared with.
struct PointPatch {
  static constexpr int kSide = 20;  ///< pixels of its level; room for turning and scaling an 8 x 8 template
  std::array<std::uint8_t, static_cast<std::size_t>(kSide* kSide)> grey{};
  Eigen::Vector2f centre = Eigen::Vector2f::Zero();  ///< where in `grey` the point lies
  std::int16_t level = -1;                           ///< pyramid level; -1: no patch (too near the border)
  int keyframe = -1;                                 ///< which image it is from; the owner's number
  Eigen::Vector2f ideal = Eigen::Vector2f::Zero();   ///< Feature::x, y in that image
  float depth = 0;                                   ///< and depth there [m]
};

/// Where a patch was found.
template <std::floating_point S>
struct PatchMatch {
  Eigen::Matrix<S, 2, 1> x = Eigen::Matrix<S, 2, 1>::Zero();  ///< recorded pixel
  int level = 0;                                              ///< of the pyramid, where it was found
  float correlation = 0;                                      ///< see PatchAlignmentResult
};

/// Options of match_patch().
struct PatchMatchOptions {
  PatchAlignmentOptions<float> alignment;
  float min_gradient = 8.0F;  ///< smaller eigenvalue of the mean gradient product [grey^2/px^2]: textured
  double min_area = 0.1;      ///< of the patch's image against the patch; less or more is another view
  double max_area = 10.0;
  double coarser = 1.1;  ///< a level with pixels this much larger than wanted still serves
};

namespace detail {
template <class S>
[[nodiscard]] S determinant(const Eigen::Matrix<S, 2, 2>& m) {
  return m(0, 0) * m(1, 1) - m(1, 0) * m(0, 1);
}
template <class S>
[[nodiscard]] Eigen::Matrix<S, 2, 2> inverse(const Eigen::Matrix<S, 2, 2>& m, const S& determinant) {
  const S scale = S(1) / determinant;
  Eigen::Matrix<S, 2, 2> inverse;
  inverse(0, 0) = m(1, 1) * scale;
  inverse(1, 0) = -m(1, 0) * scale;
  inverse(0, 1) = -m(0, 1) * scale;
  inverse(1, 1) = m(0, 0) * scale;
  return inverse;
}
/// The same in numbers of the kind T.
template <std::floating_point T, std::floating_point S, int C>
[[nodiscard]] Eigen::Matrix<T, 2, C> cast(const Eigen::Matrix<S, 2, C>& m) {
  Eigen::Matrix<T, 2, C> out;
  for (int c = 0; c < C; ++c) {
    for (int r = 0; r < 2; ++r) out(r, c) = static_cast<T>(m(r, c));
  }
  return out;
}
}  // namespace detail

/// Change of an offset in a patch's image to the present one, in pixels of level 0 (2 x 2). The patch is
/// taken for a plane that faced the camera which cut it: A = J(p_c) R [J_xy(p_ref)^-1; 0], J being d x / d p.
/// @param p_ref  the point in the frame of the camera that cut the patch [m]
/// @param p_c    the point in the present camera's frame [m]
/// @param R      rotation from the camera that cut the patch to the present one
/// @return nullopt where either camera does not see the point
template <DifferentiableCamera C, class S = typename C::ScalarType>
[[nodiscard]] std::optional<Eigen::Matrix<S, 2, 2>> patch_warp(
    const C& camera, const std::type_identity_t<Eigen::Matrix<S, 3, 1>>& p_ref,
    const std::type_identity_t<Eigen::Matrix<S, 3, 1>>& p_c,
    const std::type_identity_t<Eigen::Matrix<S, 3, 3>>& R) {
  Eigen::Matrix<S, 2, 3> J;
  if (!camera.project(p_c, &J)) return std::nullopt;
  Eigen::Matrix<S, 3, 2> plane;
  if constexpr (requires { camera.fx(), camera.fy(); }) {  // an ideal pinhole: its derivative is diagonal
    const S per_x = p_ref.z() / camera.fx(), per_y = p_ref.z() / camera.fy();
    for (int i = 0; i < 3; ++i) {
      plane(i, 0) = R(i, 0) * per_x;
      plane(i, 1) = R(i, 1) * per_y;
    }
  } else {
    Eigen::Matrix<S, 2, 3> J_ref;
    if (!camera.project(p_ref, &J_ref)) return std::nullopt;
    Eigen::Matrix<S, 2, 2> across;
    for (int i = 0; i < 4; ++i) across(i % 2, i / 2) = J_ref(i % 2, i / 2);
    const Eigen::Matrix<S, 2, 2> back = detail::inverse(across, detail::determinant(across));
    for (int i = 0; i < 3; ++i) {
      plane(i, 0) = R(i, 0) * back(0, 0) + R(i, 1) * back(1, 0);
      plane(i, 1) = R(i, 0) * back(0, 1) + R(i, 1) * back(1, 1);
    }
  }
  return Eigen::Matrix<S, 2, 2>(J * plane);
}

/// Cuts the surroundings of pixel `x` (level 0) out of `level`; `level` of the result is -1 at the border.
template <std::floating_point S, ImagePyramidLike P>
[[nodiscard]] PointPatch cut_patch(const P& pyramid, const Eigen::Matrix<S, 2, 1>& x, int level) {
  PointPatch patch;
  const auto& image = pyramid.image(level);
  const Eigen::Matrix<S, 2, 1> p = to_level<S>(pyramid, x, level);
  constexpr int kHalf = PointPatch::kSide / 2;
  const int u = static_cast<int>(std::lround(p.x())), v = static_cast<int>(std::lround(p.y()));
  if (u < kHalf || v < kHalf || u + kHalf > image.width() || v + kHalf > image.height()) return patch;
  for (int y = 0; y < PointPatch::kSide; ++y) {
    const auto* row = image.row(v - kHalf + y) + (u - kHalf);
    std::transform(row, row + PointPatch::kSide, patch.grey.begin() + y * PointPatch::kSide,
                   [](const auto& g) { return static_cast<std::uint8_t>(g); });
  }
  patch.centre =
      Eigen::Vector2f(static_cast<float>(kHalf + p.x() - S(u)), static_cast<float>(kHalf + p.y() - S(v)));
  patch.level = static_cast<std::int16_t>(level);
  return patch;
}

namespace detail {
using PatchTemplate = AlignmentPatch<float, 8>;

/// Samples the template, with its border, as an affine image of a patch: the template's offset d from its
/// origin shows what is at centre + to_patch d.
/// @return false where that lies outside the patch
template <RowImage I>
[[nodiscard]] bool sample_template(
    const I& patch, const Eigen::Vector2f& centre, const Eigen::Matrix2f& to_patch,
    std::array<float, static_cast<std::size_t>(PatchTemplate::kBordered* PatchTemplate::kBordered)>&
        bordered) {
  constexpr float kRounding = 1e-4F;  // of coordinates inside a patch [px]
  constexpr int kSide = PatchTemplate::kBordered;
  constexpr int kOrigin = PatchTemplate::kSize / 2 + 1;
  // An affine image of a square lies inside where its corners do.
  const auto source = [&](int x, int y) {
    const auto d_x = static_cast<float>(x - kOrigin), d_y = static_cast<float>(y - kOrigin);
    return Eigen::Vector2f(centre.x() + (to_patch(0, 0) * d_x + to_patch(0, 1) * d_y),
                           centre.y() + (to_patch(1, 0) * d_x + to_patch(1, 1) * d_y));
  };
  const float right = static_cast<float>(patch.width() - 1) - kRounding,
              bottom_edge = static_cast<float>(patch.height() - 1) - kRounding;
  for (const int y : {0, kSide - 1}) {
    for (const int x : {0, kSide - 1}) {
      const Eigen::Vector2f p = source(x, y);
      if (!(p.x() >= kRounding && p.y() >= kRounding && p.x() < right && p.y() < bottom_edge)) return false;
    }
  }
  using Row = Eigen::Array<float, kSide, 1>;
  const Row columns = Row::LinSpaced(kSide, 0.0F, static_cast<float>(kSide - 1));
  for (int y = 0; y < kSide; ++y) {
    const Eigen::Vector2f first = source(0, y);
    const Row px = first.x() + to_patch(0, 0) * columns, py = first.y() + to_patch(1, 0) * columns;
    const Eigen::Array<int, kSide, 1> u = px.cast<int>(), v = py.cast<int>();
    const Row a = px - u.cast<float>(), b = py - v.cast<float>();
    Row g00, g10, g01, g11;
    for (int x = 0; x < kSide; ++x) {
      const auto *above = patch.row(v[x]) + u[x], *below = patch.row(v[x] + 1) + u[x];
      g00[x] = static_cast<float>(above[0]);
      g10[x] = static_cast<float>(above[1]);
      g01[x] = static_cast<float>(below[0]);
      g11[x] = static_cast<float>(below[1]);
    }
    const Row top = g00 + a * (g10 - g00), bottom = g01 + a * (g11 - g01);
    Eigen::Map<Row>(bordered.data() + y * kSide) = top + b * (bottom - top);
  }
  return true;
}
}  // namespace detail

/// Finds a point in an image by its patch, with sub-pixel accuracy.
/// @param warp   change of an offset in the patch's image to the present one, in pixels of level 0
/// @param start  expected pixel
/// @return nullopt without a patch, seen from behind or much nearer or farther, without texture, and where
///         nothing near `start` looks like it
template <std::floating_point S, ImagePyramidLike P>
[[nodiscard]] std::optional<PatchMatch<S>> match_patch(const P& pyramid, const PointPatch& patch,
                                                       const Eigen::Matrix<S, 2, 2>& warp,
                                                       const Eigen::Matrix<S, 2, 1>& start,
                                                       const PatchMatchOptions& options = {}) {
  if (patch.level < 0) return std::nullopt;
  const S determinant = detail::determinant(warp);
  if (!(determinant > S(options.min_area) && determinant < S(options.max_area))) return std::nullopt;
  // The level on which the patch has the size it was cut with.
  const auto size = [&](int i) { return static_cast<S>(pyramid.scale(i).x()); };
  const S wanted = size(patch.level) * std::sqrt(determinant);
  int level = 0;
  while (level + 1 < pyramid.size() && size(level + 1) < S(options.coarser) * wanted) ++level;

  // The patch as it must look from here.
  Eigen::Matrix<S, 2, 2> back = detail::inverse(warp, determinant);
  const S scale = size(level) / size(patch.level);
  for (int i = 0; i < 4; ++i) back(i % 2, i / 2) *= scale;
  const Eigen::Matrix2f to_patch = detail::cast<float>(back);
  std::array<float,
             static_cast<std::size_t>(detail::PatchTemplate::kBordered * detail::PatchTemplate::kBordered)>
      bordered;
  const ImageView<const std::uint8_t> grey(patch.grey.data(), PointPatch::kSide, PointPatch::kSide);
  if (!detail::sample_template(grey, patch.centre, to_patch, bordered)) return std::nullopt;
  detail::PatchTemplate reference;
  if (!reference.set(bordered, options.min_gradient)) return std::nullopt;
  const auto found = reference.align(
      pyramid.image(level), detail::cast<float>(to_level<S>(pyramid, start, level)), options.alignment);
  if (!found.ok()) return std::nullopt;
  PatchMatch<S> match;
  match.x = to_base<S>(pyramid, detail::cast<S>(found.x), level);
  match.level = level;
  match.correlation = found.correlation;
  return match;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
