// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>
#include <cstddef>

#include "dynslam/semantic/label_histogram.hpp"
#include "dynslam/semantic/log_odds.hpp"

namespace dynslam {

/// A voxel of the semantic map: occupancy (Eq 12) and votes for `N` labels.
template <std::floating_point S, std::size_t N>
struct SemanticVoxel {
  LogOddsCell<S> occupancy;
  LabelHistogram<N> labels;

  /// A measured surface point with its label lies in the voxel.
  void hit(typename LabelHistogram<N>::Label label, const LogOddsParams<S>& params) {
    occupancy.update(params.hit, params);
    labels.add(label);
  }
  /// A ray passed through the voxel.
  void miss(const LogOddsParams<S>& params) { occupancy.update(params.miss, params); }
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
