// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <future>
#include <type_traits>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/map/bundle_window.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// Options of LocalBundle.
struct LocalBundleOptions : BundleWindowOptions<double> {
  double nu = 5.0;  ///< t-distribution of the residuals
  BundleOptions<double> solver;
};

/// Bundle adjustment of the newest keyframes on a thread of its own.
///
/// `start` copies what it needs and `apply` writes the outcome back, both on the caller's thread; what
/// lies between depends on the copy alone. A caller that applies after a fixed number of frames
/// therefore gets the same map in every run, however busy the machine is.
class LocalBundle {
 public:
  LocalBundle(const Pinhole<double>& camera, const LocalBundleOptions& options)
      : camera_(camera), options_(options), window_(options) {}
  // The thread uses this object where it is.
  LocalBundle(const LocalBundle&) = delete;
  LocalBundle& operator=(const LocalBundle&) = delete;

  /// Copies the newest keyframe and its surroundings, or those of `window` keyframes where that is given, and
  /// starts the adjustment.
  void start(const LocalMap& map, const DepthNoise<double>& noise, int window = 0);
  [[nodiscard]] bool pending() const { return running_.valid(); }
  /// Waits for the result and writes it into the map.
  /// @return the correction of the newest keyframe's pose, see BundleWindow::apply
  SE3<double> apply(LocalMap& map);

 private:
  Pinhole<double> camera_;
  LocalBundleOptions options_;
  BundleWindow<double> window_;
  BundleWorkspace<double> workspace_;
  std::future<BundleResult<double>> running_;  // last: its thread uses the members above
};

static_assert(!std::is_move_constructible_v<LocalBundle> && !std::is_move_assignable_v<LocalBundle>);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
