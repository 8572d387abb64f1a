// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <cstdint>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/image_view.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/map/feature_frame.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/track/last_frame.hpp"

namespace dynslam {

/// A pose of the frame at hand, frame.T_c_w, and what was matched for it.
template <std::floating_point S>
struct PoseEstimate {
  FeatureFrame<S> frame;
  Eigen::Matrix<S, 6, 6> covariance = Eigen::Matrix<S, 6, 6>::Zero();  ///< of a left increment
  int inliers = 0;
  /// Of the camera while its rows are read, beyond the motion since the last frame [rad].
  Eigen::Matrix<S, 3, 1> turn = Eigen::Matrix<S, 3, 1>::Zero();

  void take(const PoseResult<S>& pose) {
    frame.T_c_w = pose.T_c_w;
    covariance = pose.covariance;
    inliers = pose.inliers;
  }
};

/// What the pose of a frame is found from: the map, the last frame, and its own images.
template <class Map, ImagePyramidLike P, DepthImage D>
struct PoseEvidence {
  using S = typename Map::ScalarType;
  Map& map;  ///< matching counts there how often points were seen
  const LastFrame<S>& last;
  const P& pyramid;
  const D& depth;  ///< [m]
  FrameTime time;
  ImageView<const std::uint8_t> left_out{};  ///< nonzero: what patches find there is not used; may be empty

  [[nodiscard]] SE3<S> motion_to(const SE3<S>& T_c_w) const { return T_c_w * last.frame().T_c_w.inverse(); }
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
