// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <future>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"
#include "dynslam/runtime/slam/local_map.hpp"

namespace dynslam::runtime {

struct LocalBundleOptions {
  int window = 10;           ///< keyframes adjusted: the newest and those that share most points with it
  int fixed = 15;            ///< keyframes outside that see the same points, kept as they are
  int min_sights = 2;        ///< of a point to take part
  double nu = 5.0;           ///< t-distribution of the residuals
  double outlier_chi2 = 16;  ///< sights beyond are removed from the map
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
      : camera_(camera), options_(options) {}
  LocalBundle(const LocalBundle&) = delete;  // its thread uses the members
  LocalBundle& operator=(const LocalBundle&) = delete;

  /// Copies the newest keyframe and its surroundings, or those of `window` keyframes where that is given.
  void collect(const LocalMap& map, const DepthNoise<double>& noise, int window = 0);
  /// What collect() found; valid until the next call.
  [[nodiscard]] BundleProblem<double> problem() { return {poses_, fixed_, points_, observations_}; }
  /// Collects and starts the adjustment.
  void start(const LocalMap& map, const DepthNoise<double>& noise, int window = 0);
  [[nodiscard]] bool pending() const { return running_.valid(); }
  /// Waits for the result and writes it into the map.
  /// @return the correction D of the newest keyframe's pose, new T_c_w = old T_c_w D, which everything
  ///         that was placed relative to it since has to follow (later keyframes and points already do)
  SE3<double> apply(LocalMap& map);

 private:
  struct Sight {
    int keyframe, feature;
  };

  Pinhole<double> camera_;
  LocalBundleOptions options_;
  std::vector<int> keyframe_ids_, point_ids_, local_point_;
  int newest_ = 0;
  std::size_t point_count_ = 0;
  std::vector<SE3<double>> poses_;
  std::vector<std::uint8_t> fixed_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<BundleObservation<double>> observations_;
  std::vector<Sight> sights_;  // of observations_
  std::vector<int> votes_;
  BundleWorkspace<double> workspace_;
  std::future<BundleResult<double>> running_;  // last: its thread uses the members above
};

}  // namespace dynslam::runtime
