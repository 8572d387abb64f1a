// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"

namespace dynslam {

/// Which keyframes and points BundleWindow takes.
template <std::floating_point S = double>
struct BundleWindowOptions {
  int window = 20;         ///< keyframes adjusted: the newest and those that share most points with it
  int fixed = 15;          ///< keyframes outside that see the same points, kept as they are
  int min_sights = 2;      ///< of a point to take part
  S outlier_chi2 = S(16);  ///< squared normalised error beyond which a sight is removed from the map
};

/// The surroundings of the newest keyframe as a problem for bundle_adjust.
///
/// `collect` copies what it needs and `apply` writes the outcome back; what lies between uses the copy alone,
/// so that it may run on another thread while the map goes on. Memory is kept from window to window.
template <std::floating_point S = double>
class BundleWindow {
 public:
  explicit BundleWindow(const BundleWindowOptions<S>& options = {}) : options_(options) {}

  /// Copies the newest keyframe, its `window` - 1 nearest ones by covisibility and the points they see. The
  /// world's first keyframe is never adjusted.
  /// @param window  keyframes adjusted; 0: as the options say
  template <class Patch>
  void collect(const KeyframeMap<S, Patch>& map, const DepthNoise<S>& noise, int window = 0) {
    newest_ = map.newest();
    point_count_ = map.points().size();
    choose_keyframes(map, window > 0 ? window : options_.window);
    choose_points(map);
    copy_sights(map, noise);
  }

  /// What collect() found, for bundle_adjust; valid until the next call. Observations are sorted by point. A
  /// sight of a point behind its camera is among them: it does not count, and apply() removes it.
  [[nodiscard]] BundleProblem<S> problem() { return {poses_, fixed_, points_, observations_}; }

  /// Writes the adjusted poses and points into the map, and takes out the sights that they contradict. Later
  /// keyframes and points follow the newest keyframe of the window.
  /// @param camera  that of the problem
  /// @return the correction D of the newest keyframe's pose, new T_c_w = old T_c_w D, which everything
  ///         else that was placed relative to it since has to follow
  template <CameraModel Camera, class Patch>
  SE3<S> apply(const Camera& camera, KeyframeMap<S, Patch>& map) const {
    const SE3<S> before = map.keyframe(newest_).frame.T_c_w;
    for (std::size_t i = 0; i < keyframe_ids_.size(); ++i)
      map.keyframe(keyframe_ids_[i]).frame.T_c_w = poses_[i];
    for (std::size_t j = 0; j < point_ids_.size(); ++j) map.point(point_ids_[j]).p_w = points_[j];
    for (std::size_t k = 0; k < observations_.size(); ++k) {
      const auto& o = observations_[k];
      const S e = bundle_chi2(camera, poses_[static_cast<std::size_t>(o.pose)],
                              points_[static_cast<std::size_t>(o.point)], o);
      // Infinite behind the camera: such a sight goes whatever the bound.
      if (e > options_.outlier_chi2 || !std::isfinite(e)) map.forget(sights_[k].keyframe, sights_[k].feature);
    }
    const SE3<S> D = before.inverse() * map.keyframe(newest_).frame.T_c_w;
    const SE3<S> D_inverse = D.inverse();
    for (int k = newest_ + 1; k <= map.newest(); ++k) {
      SE3<S>& T = map.keyframe(k).frame.T_c_w;
      T = T * D;
    }
    for (std::size_t p = point_count_; p < map.points().size(); ++p)
      map.points()[p].p_w = D_inverse * map.points()[p].p_w;
    return D;
  }

 private:
  struct Sight {
    int keyframe, feature;
  };

  /// The window's keyframes first, then those that hold it.
  template <class Patch>
  void choose_keyframes(const KeyframeMap<S, Patch>& map, int window) {
    using Map = KeyframeMap<S, Patch>;
    keyframe_ids_.clear();
    poses_.clear();
    fixed_.clear();
    window_ = 0;
    if (newest_ < 0) return;
    votes_.assign(map.keyframes().size(), 0);
    map.count_shared(map.keyframe(newest_).frame.point, votes_);
    Map::rank(
        votes_, 1, window - 1, [&](int k) { return k != newest_ && k != 0; }, ranked_);
    for (const auto& [shared, k] : ranked_) keyframe_ids_.push_back(k);
    if (newest_ != 0) keyframe_ids_.push_back(newest_);
    window_ = keyframe_ids_.size();
    votes_.assign(map.keyframes().size(), 0);
    for (const int k : keyframe_ids_) map.count_shared(map.keyframe(k).frame.point, votes_);
    const auto outside = [&](int k) {
      return std::find(keyframe_ids_.begin(), keyframe_ids_.end(), k) == keyframe_ids_.end();
    };
    Map::rank(votes_, 1, options_.fixed, outside, ranked_);
    for (const auto& [shared, k] : ranked_) keyframe_ids_.push_back(k);

    for (const int k : keyframe_ids_) {
      fixed_.push_back(poses_.size() < window_ ? 0 : 1);
      poses_.push_back(map.keyframe(k).frame.T_c_w);
    }
    if (ranked_.empty() && window_ > 1) fixed_[0] = 1;  // the gauge
  }

  /// Points of the window with enough sights among the chosen keyframes, in the order of their ids.
  template <class Patch>
  void choose_points(const KeyframeMap<S, Patch>& map) {
    std::vector<int>& sights_of = local_point_;
    sights_of.assign(point_count_, 0);
    for (std::size_t i = 0; i < keyframe_ids_.size(); ++i) {
      for (const int p : map.keyframe(keyframe_ids_[i]).frame.point) {
        if (p < 0 || map.point(p).bad) continue;
        int& sights = sights_of[static_cast<std::size_t>(p)];
        if (i < window_ || sights > 0) ++sights;
      }
    }
    point_ids_.clear();
    points_.clear();
    first_.clear();
    std::size_t total = 0;
    for (std::size_t p = 0; p < point_count_; ++p) {
      if (sights_of[p] < options_.min_sights) {
        sights_of[p] = -1;
        continue;
      }
      first_.push_back(total);
      total += static_cast<std::size_t>(sights_of[p]);
      sights_of[p] = static_cast<int>(point_ids_.size());
      point_ids_.push_back(static_cast<int>(p));
      points_.push_back(map.points()[p].p_w);
    }
    observations_.resize(total);
    sights_.resize(total);
  }

  template <class Patch>
  void copy_sights(const KeyframeMap<S, Patch>& map, const DepthNoise<S>& noise) {
    for (std::size_t i = 0; i < keyframe_ids_.size(); ++i) {
      const FeatureFrame<S>& frame = map.keyframe(keyframe_ids_[i]).frame;
      for (std::size_t f = 0; f < frame.point.size(); ++f) {
        if (frame.point[f] < 0) continue;
        const int j = local_point_[static_cast<std::size_t>(frame.point[f])];
        if (j < 0) continue;
        const std::size_t at = first_[static_cast<std::size_t>(j)]++;
        const PoseObservation<S> o = observe(frame.features[f], map.point(frame.point[f]).p_w, noise);
        observations_[at] = {static_cast<int>(i), j, o.x, o.depth, o.inv_sigma_px2, o.inv_sigma_z2};
        sights_[at] = {keyframe_ids_[i], static_cast<int>(f)};
      }
    }
  }

  BundleWindowOptions<S> options_;
  int newest_ = -1;
  std::size_t point_count_ = 0, window_ = 0;
  std::vector<int> keyframe_ids_, point_ids_;
  std::vector<int> local_point_;  // per map point: its place in points_, -1: not there
  std::vector<SE3<S>> poses_;
  std::vector<std::uint8_t> fixed_;
  std::vector<Eigen::Matrix<S, 3, 1>> points_;
  std::vector<BundleObservation<S>> observations_;
  std::vector<Sight> sights_;       // of observations_
  std::vector<std::size_t> first_;  // per point: where its next observation goes
  std::vector<int> votes_;
  std::vector<std::pair<int, int>> ranked_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
