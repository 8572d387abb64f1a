// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <numbers>

#include "dynslam/geometry/se3.hpp"

namespace dynslam {

/// When two scans show the same.
template <std::floating_point S = double>
struct ViewOptions {
  S translation = S(0.1);                              ///< metres: a twentieth of the view at 2 m
  S rotation = S(5) * std::numbers::pi_v<S> / S(180);  ///< rad: a twelfth of the view of a lens of 60 degrees
};

/// Whether scans from these places show the same.
template <std::floating_point S>
[[nodiscard]] bool same_view(const SE3<S>& a, const SE3<S>& b, const ViewOptions<S>& options = {}) {
  return (a.translation() - b.translation()).norm() < options.translation &&
         (a.so3() * b.so3().inverse()).log().norm() < options.rotation;
}

/// What a map remembers of a scan, to tell when it is not needed any more.
struct ScanRank {
  int later = 0;         ///< scans of the same view that have come since
  bool retired = false;  ///< not needed: to be dropped
};

/// Retires scans for the newest one, so that a view has `per_view` of them at most, however often it is seen:
/// the first, which shows what later ones may have had hidden, and the last, which show what is there now.
/// Any map whose voxels are clamped has forgotten the others (the defaults of LogOddsParams: after four
/// hits).
/// @param scans     oldest first, with members T_w_c and rank
/// @param per_view  2 or more; 0: all are kept
template <class Scans>
void retire_scans(Scans& scans, int per_view) {
  if (per_view == 0 || scans.empty()) return;
  const auto& newest = scans.back();
  for (std::size_t i = 0; i + 1 < scans.size(); ++i) {
    auto& scan = scans[i];
    if (scan.rank.retired || !same_view(scan.T_w_c, newest.T_w_c) || ++scan.rank.later < per_view - 1)
      continue;
    for (std::size_t k = 0; k < i && !scan.rank.retired; ++k)
      scan.rank.retired = !scans[k].rank.retired && same_view(scans[k].T_w_c, scan.T_w_c);
  }
}

/// Frees the retired ones among the first `count` scans. @return how many they were
template <class Scans>
std::size_t drop_retired(Scans& scans, std::size_t count) {
  const auto end = scans.begin() + static_cast<typename Scans::difference_type>(count);
  const auto kept = std::remove_if(scans.begin(), end, [](const auto& scan) { return scan.rank.retired; });
  const auto dropped = static_cast<std::size_t>(end - kept);
  scans.erase(kept, end);
  return dropped;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
