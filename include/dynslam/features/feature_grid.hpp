// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "dynslam/features/feature.hpp"

namespace dynslam {

/// Keypoints bucketed on a regular grid over the image for search by projection.
class FeatureGrid {
 public:
  /// About a match's radius: larger cells hold more features to refuse, smaller ones more cells to visit.
  static constexpr float kCell = 20.0F;  // pixels

  /// @param width, height  image size in pixels; features outside are clamped into the border cells
  void build(std::span<const Feature> features, int width, int height) {
    columns_ = std::max(1, static_cast<int>(std::ceil(static_cast<float>(width) / kCell)));
    rows_ = std::max(1, static_cast<int>(std::ceil(static_cast<float>(height) / kCell)));
    start_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
    index_.resize(features.size());
    const auto cell_of = [&](const Feature& f) {
      return static_cast<std::size_t>(cell(f.y, rows_) * columns_ + cell(f.x, columns_));
    };
    for (const Feature& f : features) ++start_[cell_of(f) + 1];
    for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
    std::vector<int> next(start_.begin(), start_.end() - 1);
    for (std::size_t i = 0; i < features.size(); ++i)
      index_[static_cast<std::size_t>(next[cell_of(features[i])]++)] = static_cast<int>(i);
  }

  /// Calls `visit(index)` for each feature in a square of half side `radius` pixels around (x, y), by cells,
  /// within a cell in the order of the features.
  /// @param features  those that the grid was built of, unmoved, with or without more behind them
  template <class Visit>
  void for_each_near(std::span<const Feature> features, float x, float y, float radius, Visit&& visit) const {
    if (start_.empty()) return;
    const int c0 = cell(x - radius, columns_), c1 = cell(x + radius, columns_);
    const int r0 = cell(y - radius, rows_), r1 = cell(y + radius, rows_);
    for (int r = r0; r <= r1; ++r) {
      for (int c = c0; c <= c1; ++c) {
        const auto at = static_cast<std::size_t>(r * columns_ + c);
        for (int k = start_[at]; k < start_[at + 1]; ++k) {
          const int i = index_[static_cast<std::size_t>(k)];
          const Feature& f = features[static_cast<std::size_t>(i)];
          if (f.x >= x - radius && f.x <= x + radius && f.y >= y - radius && f.y <= y + radius) visit(i);
        }
      }
    }
  }

 private:
  /// Column or row of a coordinate among `count`. Clamped as a float: the cell of a pixel far outside is no
  /// int, and that of NaN is the first one.
  [[nodiscard]] static int cell(float x, int count) {
    const float at = std::floor(x / kCell), last = static_cast<float>(count - 1);
    return at > 0.0F ? static_cast<int>(std::min(at, last)) : 0;
  }

  int columns_ = 0, rows_ = 0;
  std::vector<int> start_, index_;  // CSR: features of cell i are index_[start_[i] .. start_[i + 1])
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
