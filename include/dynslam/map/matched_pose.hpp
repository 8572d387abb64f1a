// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <cstddef>
#include <span>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/config.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "dynslam/optim/readout_measurement.hpp"
#include "dynslam/optim/rolling_pose.hpp"
#include "dynslam/optim/surface_weights.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// Options of MatchedPose.
template <std::floating_point S>
struct MatchedPoseOptions {
  S nu = S(5);                 ///< degrees of freedom of the t-distribution
  S min_pixel_scale = S(0.4);  ///< how much better than stated the pixel noise may turn out
  /// Sensor noise, and the time between colour and depth image.
  DepthNoise<S> depth_noise{S(0.004), S(0.008)};
};

/// The pose that a frame's matches with the map say, those on its dynamic flags left out.
/// @tparam Camera  of the pixels Feature::x, y: the ideal pinhole, or any other in whose pixels they are
template <std::floating_point S, DifferentiableCameraOf<S> Camera = Pinhole<S>>
class MatchedPose {
 public:
  explicit MatchedPose(const Camera& camera, const MatchedPoseOptions<S>& options = {})
      : camera_(camera), options_(options) {}

  /// Collects what the matches tell. The calls below that take no map go by the last collection.
  template <class Map>
  void gather(const Map& map, const FeatureFrame<S>& frame) {
    observations_.clear();
    feature_.clear();
    constexpr std::size_t kAhead = 8;
    for (std::size_t i = 0; i < frame.features.size(); ++i) {
      if (i + kAhead < frame.features.size() && frame.point[i + kAhead] >= 0)
        detail::prefetch(&map.point(frame.point[i + kAhead]).p_w);
      if (frame.point[i] < 0 || frame.dynamic[i] != 0) continue;
      observations_.push_back(
          observe(frame.features[i], map.point(frame.point[i]).p_w, options_.depth_noise));
      feature_.push_back(static_cast<int>(i));
    }
  }

  /// The pose that most matches agree on, see pose_consensus().
  /// @param image_size  [px] where matches count by the surface that they stand for; nullptr: all alike
  [[nodiscard]] SE3<S> consensus(const SE3<S>& T_c_w_predicted, std::span<const SE3<S>> alternatives,
                                 const PoseConsensusOptions<S>& options, const Eigen::Vector2i* image_size) {
    weights_.clear();
    if (image_size != nullptr)
      surface_weights<S>(image_size->x(), image_size->y(), T_c_w_predicted, observations_, {}, weights_);
    return pose_consensus<S>(camera_, observations_, weights_, T_c_w_predicted, alternatives, options,
                             consensus_)
        .T_c_w;
  }

  /// Drops the matches whose squared normalised error is `max_chi2` or more.
  void keep_consistent(const SE3<S>& T_c_w, S max_chi2, FeatureFrame<S>& frame) const {
    for (std::size_t k = 0; k < observations_.size(); ++k) {
      if (observation_chi2(camera_, T_c_w, observations_[k]) >= max_chi2)
        frame.point[static_cast<std::size_t>(feature_[k])] = -1;
    }
  }

  /// Mean squared normalised error of the matches, each counted as `max_chi2` at most.
  [[nodiscard]] S mean_chi2(const SE3<S>& T_c_w, S max_chi2) const {
    S sum = S(0);
    for (const PoseObservation<S>& o : observations_)
      sum += std::min(observation_chi2(camera_, T_c_w, o), max_chi2);
    return observations_.empty() ? S(0) : sum / static_cast<S>(observations_.size());
  }

  /// Has optimize() estimate how the camera turned while it read its rows, beyond what the features were
  /// placed for (optimize_rolling_pose()). Not for a camera that reads them all at once.
  /// @param shutter  that the features were placed for
  void set_rows(const RollingShutter<S>& shutter, const TurnPrior<S>& prior) {
    shutter_ = shutter;
    prior_ = prior;
  }
  /// All rows are where the features were placed; the default.
  void set_rows_known() { shutter_ = {}; }

  /// Collects, optimises from `start` (optimize_pose()) and drops the matches that are outliers then.
  template <class Map>
  PoseResult<S> optimize(const Map& map, const SE3<S>& start, FeatureFrame<S>& frame) {
    gather(map, frame);
    PoseOptions<S> options;
    options.min_pixel_scale = options_.min_pixel_scale;
    const auto kernel = TDistribution<S>::with_dimension(options_.nu, 1);
    const std::span<const PoseObservation<S>> observations(observations_);
    if (shutter_.moves()) {
      share_.clear();
      for (const int i : feature_)
        share_.push_back(shutter_.share(static_cast<S>(frame.features[static_cast<std::size_t>(i)].v)));
    }
    const PoseResult<S> result =
        shutter_.moves() ? optimize_rolling_pose(camera_, observations, std::span<const S>(share_), start,
                                                 prior_, options, kernel, workspace_)
                         : optimize_pose(camera_, observations, start, options, kernel, workspace_);
    for (std::size_t k = 0; k < observations_.size(); ++k) {
      if (workspace_.inlier[k] == 0) frame.point[static_cast<std::size_t>(feature_[k])] = -1;
    }
    return result;
  }

  /// Adds the inliers of the last optimize() to a measurement.
  /// @param T_c_w   its result
  /// @param speed   see ReadoutMeasurement::begin_image()
  /// @param height  of the image [px]
  void measure_readout(const FeatureFrame<S>& frame, const SE3<S>& T_c_w, const Eigen::Matrix<S, 6, 1>& speed,
                       int height, ReadoutMeasurement<S>& out) const {
    const S middle = S(height - 1) / S(2);
    out.begin_image(frame.t, T_c_w, speed);
    for (std::size_t k = 0; k < observations_.size(); ++k) {
      if (workspace_.inlier[k] == 0) continue;
      const auto v = static_cast<S>(frame.features[static_cast<std::size_t>(feature_[k])].v);
      out.observe(camera_, observations_[k], workspace_.weight[k], (v - middle) / S(height - 1));
    }
    out.end_image();
  }

 private:
  Camera camera_;
  MatchedPoseOptions<S> options_;
  std::vector<PoseObservation<S>> observations_;
  std::vector<int> feature_;  // of observations_
  std::vector<S> weights_;    // of observations_ in the consensus
  std::vector<S> share_;      // of observations_: their rows
  RollingShutter<S> shutter_;
  TurnPrior<S> prior_;
  PoseWorkspace<S> workspace_;
  PoseConsensusWorkspace consensus_;
};

template <DifferentiableCamera Camera>
MatchedPose(const Camera&) -> MatchedPose<typename Camera::ScalarType, Camera>;
template <DifferentiableCamera Camera>
MatchedPose(const Camera&, const MatchedPoseOptions<typename Camera::ScalarType>&)
    -> MatchedPose<typename Camera::ScalarType, Camera>;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
