// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cstddef>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/detail/depth_lanes.hpp"

namespace dynslam {

/// Tells whether regions are more than a share of an image's valid depth. Rows are counted only until that
/// is known: small regions, which most are, need few.
template <DepthImage D>
class ValidDepthShare {
 public:
  /// Refers to the image, which has to outlive it.
  explicit ValidDepthShare(const D& depth) : depth_(depth) {}
  explicit ValidDepthShare(const D&& depth) = delete;

  /// Whether `pixels` are more than this share; of 1 or more never.
  [[nodiscard]] bool exceeded_by(std::size_t pixels, double share) {
    if (share >= 1) return false;
    const auto limit = [&] {
      return static_cast<std::size_t>(std::max(0.0, share) * static_cast<double>(counted_));
    };
    while (pixels > limit()) {
      if (row_ == depth_.height()) return true;
      count_row(row_++);
    }
    return false;
  }

 private:
  void count_row(int v) {
    using S = typename D::Pixel;
    constexpr int kCount = detail::DepthLanes<S>::kCount;
    int u = 0;
    if constexpr (RowImage<D> && kCount > 1) {
      const S* row = depth_.row(v);
      typename detail::DepthLanes<S>::Mask sum{};
      for (; u + kCount <= depth_.width(); u += kCount)
        sum -= detail::valid_lanes<S>(detail::load_lanes(row + u));
      for (int i = 0; i < kCount; ++i) counted_ += static_cast<std::size_t>(sum[i]);
    }
    const auto z = image_row(depth_, v);
    for (; u < depth_.width(); ++u) counted_ += is_valid_depth(z[u]) ? 1U : 0U;
  }

  const D& depth_;
  int row_ = 0;  ///< that is counted next
  std::size_t counted_ = 0;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
