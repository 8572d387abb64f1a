// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "dynslam/config.hpp"
#include "dynslam/features/descriptor.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/features/feature_grid.hpp"

namespace dynslam {

/// An image's features as guided_match() reads them, which have to outlive this.
struct FeatureView {
  std::span<const Feature> features;
  std::span<const Descriptor> descriptors;  ///< one per feature
  std::span<const std::uint8_t> ignored;    ///< per feature: nonzero is never matched; empty: none
  const FeatureGrid& grid;                  ///< of the features, or of the first of them

  FeatureView(std::span<const Feature> f, std::span<const Descriptor> d, std::span<const std::uint8_t> skip,
              const FeatureGrid& g)
      : features(f), descriptors(d), ignored(skip), grid(g) {}
  FeatureView(std::span<const Feature>, std::span<const Descriptor>, std::span<const std::uint8_t>,
              const FeatureGrid&&) = delete;
};

/// Where something is expected in an image, and how alike it has to be.
struct GuidedQuery {
  float x = 0, y = 0;  ///< pixel, as Feature::x, y
  float radius = 0;    ///< half side of the searched square [px]
  int min_octave = 0, max_octave = std::numeric_limits<int>::max();
  int max_distance = kDescriptorBits;  ///< Hamming
  /// The best may have at most this share of the second best's distance where both are of one octave: of two
  /// alike neither is certain. Of neighbouring octaves they are mostly one corner, found twice.
  float ratio = 1;
};

/// The feature that a search chose.
struct GuidedMatch {
  int feature = -1;  ///< the best, also where it was refused; -1: there was none
  int distance = kDescriptorBits + 1;
  bool accepted = false;
  [[nodiscard]] bool ok() const { return accepted; }
};

/// The filter that takes every feature.
struct AcceptAll {
  [[nodiscard]] constexpr bool operator()(int /*feature*/) const { return true; }
};

/// The feature most like a descriptor near where it is expected (search by projection); of equals the one
/// that FeatureGrid::for_each_near visits first.
/// @param accept  accept(feature) -> bool refuses further candidates, before their descriptors are compared
template <class Accept = AcceptAll>
[[nodiscard]] GuidedMatch guided_match(const FeatureView& image, const Descriptor& descriptor,
                                       const GuidedQuery& query, Accept&& accept = {}) {
  DYNSLAM_ASSERT(image.descriptors.size() == image.features.size() &&
                     (image.ignored.empty() || image.ignored.size() == image.features.size()),
                 "every feature has one descriptor and one flag");
  GuidedMatch best;
  int second = best.distance, best_octave = -1, second_octave = -2;
  image.grid.for_each_near(image.features, query.x, query.y, query.radius, [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    const int octave = image.features[k].octave;
    if (octave < query.min_octave || octave > query.max_octave) return;
    if ((!image.ignored.empty() && image.ignored[k] != 0) || !accept(i)) return;
    const int d = hamming_distance(descriptor, image.descriptors[k]);
    if (d < best.distance) {
      second = best.distance;
      second_octave = best_octave;
      best.distance = d;
      best_octave = octave;
      best.feature = i;
    } else if (d < second) {
      second = d;
      second_octave = octave;
    }
  });
  best.accepted = best.feature >= 0 && best.distance <= query.max_distance &&
                  (second_octave != best_octave ||
                   static_cast<float>(best.distance) <= query.ratio * static_cast<float>(second));
  return best;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
