// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dynslam/features/descriptor.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/features/feature_grid.hpp"
#include "dynslam/features/guided_match.hpp"
#include "dynslam/geometry/se3.hpp"

namespace dynslam {

/// What a tracker keeps of one image: its features, what they show, and where it was taken.
template <Scalar S = double>
struct FeatureFrame {
  std::size_t index = 0;  ///< in its sequence
  double t = 0;           ///< seconds; double whatever the scalar: a float holds no time stamp
  std::vector<Feature> features;
  std::vector<Descriptor> descriptors;  ///< one per feature, as the next two
  std::vector<int> point;               ///< map point of each feature, -1: none
  std::vector<std::uint8_t> dynamic;    ///< nonzero: the feature lies on what moves
  FeatureGrid grid;
  SE3<S> T_c_w;

  /// For guided_match(), without the features on what moves. Valid while the frame is not changed.
  [[nodiscard]] FeatureView view() const& { return {features, descriptors, dynamic, grid}; }
  FeatureView view() const&& = delete;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
