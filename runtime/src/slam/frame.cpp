// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/frame.hpp"

#include <algorithm>
#include <cmath>

namespace dynslam::runtime {

int FeatureGrid::clamp_column(float x) const {
  return std::clamp(static_cast<int>(std::floor(x / kCell)), 0, columns_ - 1);
}

int FeatureGrid::clamp_row(float y) const {
  return std::clamp(static_cast<int>(std::floor(y / kCell)), 0, rows_ - 1);
}

void FeatureGrid::build(std::span<const Feature> features, int width, int height) {
  columns_ = std::max(1, static_cast<int>(std::ceil(static_cast<float>(width) / kCell)));
  rows_ = std::max(1, static_cast<int>(std::ceil(static_cast<float>(height) / kCell)));
  start_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  index_.resize(features.size());
  const auto cell_of = [&](const Feature& f) {
    return static_cast<std::size_t>(clamp_row(f.y) * columns_ + clamp_column(f.x));
  };
  for (const Feature& f : features) ++start_[cell_of(f) + 1];
  for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
  std::vector<int> next(start_.begin(), start_.end() - 1);
  for (std::size_t i = 0; i < features.size(); ++i) {
    index_[static_cast<std::size_t>(next[cell_of(features[i])]++)] = static_cast<int>(i);
  }
}

}  // namespace dynslam::runtime
