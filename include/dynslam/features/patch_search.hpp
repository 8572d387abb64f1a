// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <concepts>
#include <optional>

#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/image/pyramid.hpp"

namespace dynslam {

/// Options of search_patch().
struct PatchSearchOptions {
  /// On each level. A coarse level may look less alike than the patch itself: a mover covers only a part of
  /// it.
  PatchAlignmentOptions<float> alignment{
      .max_iterations = 12, .tolerance = 0.05F, .max_shift = 8.0F, .min_correlation = 0.6F};
  float min_gradient = 8.0F;  ///< see PatchMatchOptions; a level without texture is passed over
};

/// Searches a point of a reference image in the present one from the coarsest level of their pyramids to the
/// finest, by inverse-compositional alignment of an 8 x 8 template on each (Baker and Matthews 2004). Both
/// pyramids have the same levels.
/// @param x      pixel in the reference image, level 0
/// @param warp   change of an offset in the reference image to the present one (2 x 2, see patch_warp)
/// @param start  where the search begins, level 0
/// @return where the finest levels found it, to about a pixel (confirm it with match_patch); nullopt where
///         no level did
template <std::floating_point S, ImagePyramidLike P, ImagePyramidLike Q>
[[nodiscard]] std::optional<Eigen::Matrix<S, 2, 1>> search_patch(
    const P& reference, const Eigen::Matrix<S, 2, 1>& x, const Eigen::Matrix<S, 2, 2>& warp, const Q& present,
    const Eigen::Matrix<S, 2, 1>& start, const PatchSearchOptions& options = {}) {
  using detail::PatchTemplate;
  const S determinant = detail::determinant(warp);
  if (!(determinant > S(0))) return std::nullopt;
  const Eigen::Matrix2f to_reference = detail::cast<float>(detail::inverse(warp, determinant));
  std::array<float, static_cast<std::size_t>(PatchTemplate::kBordered * PatchTemplate::kBordered)> bordered;
  PatchTemplate patch;
  Eigen::Matrix<S, 2, 1> found = start;
  bool any = false;
  for (int level = std::min(reference.size(), present.size()) - 1; level >= 0; --level) {
    const auto& image = reference.image(level);
    const Eigen::Vector2f centre = detail::cast<float>(to_level<S>(reference, x, level));
    if (!detail::sample_template(image, centre, to_reference, bordered) ||
        !patch.set(bordered, options.min_gradient))
      continue;
    const auto aligned = patch.align(
        present.image(level), detail::cast<float>(to_level<S>(present, found, level)), options.alignment);
    if (!aligned.ok()) continue;
    found = to_base<S>(present, detail::cast<S>(aligned.x), level);
    any = true;
  }
  return any ? std::optional(found) : std::nullopt;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
