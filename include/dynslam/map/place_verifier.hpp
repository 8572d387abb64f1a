// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/features/descriptor.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/features/guided_match.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/optim/absolute_pose.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// When PlaceVerifier believes that an image was taken at a place it knows.
template <std::floating_point S = double>
struct PlaceOptions {
  int min_matches = 15;         ///< by descriptor, before geometry is asked
  int min_inliers = 30;         ///< points that fit one pose in the end
  S min_agreement = S(0.5);     ///< of the depths measured where its points should be and not hidden
  int neighbours = 5;           ///< keyframes around the candidate whose points are searched, too
  int neighbour_shared = 15;    ///< points in common that make a keyframe one of those
  S nu = S(5);                  ///< t-distribution of the refinement
  int proposed_distance = 60;   ///< Hamming distance of a match by descriptor alone, at most
  double proposed_ratio = 0.9;  ///< and its share of the second best's: repeated structure proves nothing
  int expected_distance = 80;   ///< where the geometry limits the search
  S search_sigmas = S(6);       ///< half side of that search, in standard deviations of a corner ...
  S max_search_sigma = S(4);    ///< ... each of 1 to so many pixels
  int rounds = 2;               ///< of searching from the pose and refining it
  S depth_slack = S(0.05);      ///< share of the distance by which a measured depth may differ ...
  S depth_slack_sigmas = S(3);  ///< ... beside so many standard deviations
  std::uint64_t seed = 1;       ///< of the samples; a frame's index is added
};

/// Whether a place was recognised, or what spoke against it.
enum class PlaceStatus : std::uint8_t {
  found,
  too_few_matches,  ///< the descriptors, or the points searched from the pose, agree too seldom
  no_pose,          ///< no three matches give a pose that others confirm
  too_few_inliers,
  contradicted  ///< the depth image looks through the points, or shows none of them
};

/// A frame's pose in the part of the map that a keyframe shows.
template <std::floating_point S = double>
struct PlaceResult {
  PlaceStatus status = PlaceStatus::too_few_matches;
  SE3<S> T_c_w;                                                        ///< identity on failure
  Eigen::Matrix<S, 6, 6> covariance = Eigen::Matrix<S, 6, 6>::Zero();  ///< of a left increment of T_c_w
  std::vector<std::pair<int, int>> matches;                            ///< feature, map point
  [[nodiscard]] bool ok() const { return status == PlaceStatus::found; }
};

/// Decides by geometry whether a frame shows the place that a keyframe shows (relocalisation, loop closing).
///
/// @tparam Camera       the one of Feature::x, y
/// @tparam ImageCamera  the one of the depth image, with its lens
template <DifferentiableCamera Camera, CameraModel ImageCamera = Camera>
class PlaceVerifier {
 public:
  using S = typename Camera::ScalarType;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  static_assert(std::floating_point<S> && std::same_as<S, typename ImageCamera::ScalarType>);

  PlaceVerifier(const Camera& camera, const ImageCamera& image_camera, const DepthNoise<S>& noise,
                const PlaceOptions<S>& options = {})
      : camera_(camera), image_camera_(image_camera), noise_(noise), options_(options) {}

  /// Descriptors propose matches with the keyframe's points, three of them a pose (absolute_pose); the
  /// points around the keyframe are searched from there, and what fits is refined. Two places may hold
  /// the same poster, so what else the map has in view must not be seen through by `depth`.
  /// @param depth  the frame's depth image [m]
  template <class Patch, DepthImage Depth>
  [[nodiscard]] PlaceResult<S> verify(KeyframeMap<S, Patch>& map, const FeatureFrame<S>& frame,
                                      const Depth& depth, int keyframe) {
    PlaceResult<S> result;
    propose(map, frame, map.keyframe(keyframe).frame);
    if (!enough(options_.min_matches)) return result;
    observe_matches(map, frame);
    AbsolutePoseOptions<S> options;
    options.seed = options_.seed + frame.index;
    const auto start =
        absolute_pose(camera_, std::span<const PoseObservation<S>>(observations_), options, absolute_);
    result.status = PlaceStatus::no_pose;
    if (!start.ok() || start.inliers < options_.min_matches / 2) return result;
    PoseResult<S> pose = refine(map, frame, start.T_c_w);
    for (int round = 0; round < options_.rounds; ++round) {
      search(map, frame, keyframe, pose.T_c_w);
      result.status = PlaceStatus::too_few_matches;
      if (!enough(options_.min_matches)) return result;
      pose = refine(map, frame, pose.T_c_w);
    }
    result.status = PlaceStatus::too_few_inliers;
    if (!enough(options_.min_inliers)) return result;
    result.status = PlaceStatus::contradicted;
    if (agreement(map, depth, pose.T_c_w) < options_.min_agreement) return result;
    result.status = PlaceStatus::found;
    result.T_c_w = pose.T_c_w;
    result.covariance = pose.covariance;
    result.matches = matches_;
    return result;
  }

 private:
  [[nodiscard]] bool enough(int count) const { return static_cast<int>(matches_.size()) >= count; }

  /// Matches by descriptor alone: every point of the keyframe with every feature.
  template <class Patch>
  void propose(const KeyframeMap<S, Patch>& map, const FeatureFrame<S>& frame,
               const FeatureFrame<S>& keyframe) {
    start_matching(frame);
    for (std::size_t j = 0; j < keyframe.features.size(); ++j) {
      const int id = keyframe.point[j];
      if (id < 0 || map.point(id).bad) continue;
      int best = -1, distance = kDescriptorBits + 1, second = distance;
      for (std::size_t i = 0; i < frame.features.size(); ++i) {
        if (frame.dynamic[i] != 0) continue;
        const int d = hamming_distance(keyframe.descriptors[j], frame.descriptors[i]);
        if (d < distance) {
          second = distance;
          distance = d;
          best = static_cast<int>(i);
        } else if (d < second) {
          second = d;
        }
      }
      if (best < 0 || distance > options_.proposed_distance || distance > options_.proposed_ratio * second)
        continue;
      if (distance >= distance_of_feature_[static_cast<std::size_t>(best)]) continue;
      std::erase_if(matches_, [&](const auto& m) { return m.first == best; });
      distance_of_feature_[static_cast<std::size_t>(best)] = distance;
      matches_.emplace_back(best, id);
    }
  }

  /// Matches of the points around the keyframe, where the pose says that they are.
  template <class Patch>
  void search(KeyframeMap<S, Patch>& map, const FeatureFrame<S>& frame, int keyframe, const SE3<S>& T_c_w) {
    map.covisible(keyframe, options_.neighbour_shared, around_, options_.neighbours);
    around_.insert(around_.begin(), {0, keyframe});
    start_matching(frame);
    searched_.clear();
    tried_.assign(map.points().size(), 0);
    for (const auto& [shared, k] : around_) {
      for (const int id : map.keyframe(k).frame.point) {
        if (id < 0 || tried_[static_cast<std::size_t>(id)] != 0 || map.point(id).bad) continue;
        tried_[static_cast<std::size_t>(id)] = 1;
        searched_.push_back(id);
        find(map.point(id).p_w, map.point(id).descriptor, frame, id, T_c_w);
      }
    }
    for (std::size_t i = 0; i < point_of_feature_.size(); ++i) {
      if (point_of_feature_[i] >= 0) matches_.emplace_back(static_cast<int>(i), point_of_feature_[i]);
    }
  }

  void find(const Vector3& p_w, const Descriptor& descriptor, const FeatureFrame<S>& frame, int id,
            const SE3<S>& T_c_w) {
    const auto x = camera_.project(T_c_w * p_w);
    if (!x) return;
    const auto sigmas = static_cast<float>(options_.search_sigmas),
               max_sigma = static_cast<float>(options_.max_search_sigma);
    GuidedQuery query;
    query.x = static_cast<float>(x->x());
    query.y = static_cast<float>(x->y());
    query.radius = max_sigma * sigmas;
    query.max_distance = options_.expected_distance;
    // The corner may be of any scale: its own accuracy says how far off it may lie.
    const GuidedMatch match = guided_match(frame.view(), descriptor, query, [&](int i) {
      const Feature& f = frame.features[static_cast<std::size_t>(i)];
      const float reach = sigmas * std::clamp(f.sigma, 1.0F, max_sigma);
      return std::abs(f.x - query.x) <= reach && std::abs(f.y - query.y) <= reach;
    });
    if (!match.ok()) return;
    const auto best = static_cast<std::size_t>(match.feature);
    if (match.distance >= distance_of_feature_[best]) return;
    distance_of_feature_[best] = match.distance;
    point_of_feature_[best] = id;
  }

  void start_matching(const FeatureFrame<S>& frame) {
    matches_.clear();
    distance_of_feature_.assign(frame.features.size(), kDescriptorBits + 1);
    point_of_feature_.assign(frame.features.size(), -1);
  }

  template <class Patch>
  void observe_matches(const KeyframeMap<S, Patch>& map, const FeatureFrame<S>& frame) {
    observations_.clear();
    for (const auto& [feature, id] : matches_)
      observations_.push_back(
          observe(frame.features[static_cast<std::size_t>(feature)], map.point(id).p_w, noise_));
  }

  /// The pose from the matches, which lose their outliers.
  template <class Patch>
  [[nodiscard]] PoseResult<S> refine(const KeyframeMap<S, Patch>& map, const FeatureFrame<S>& frame,
                                     const SE3<S>& start) {
    observe_matches(map, frame);
    const PoseResult<S> result =
        optimize_pose(camera_, std::span<const PoseObservation<S>>(observations_), start, PoseOptions<S>{},
                      TDistribution<S>::with_dimension(options_.nu, 1), pose_);
    std::size_t kept = 0;
    for (std::size_t k = 0; k < matches_.size(); ++k) {
      if (pose_.inlier[k] != 0) matches_[kept++] = matches_[k];
    }
    matches_.resize(kept);
    return result;
  }

  /// Share of the measured depths that agree with the points last searched, seen from T_c_w; what hides a
  /// point says nothing.
  template <class Patch, DepthImage Depth>
  [[nodiscard]] S agreement(const KeyframeMap<S, Patch>& map, const Depth& depth, const SE3<S>& T_c_w) const {
    int agree = 0, seen_through = 0;
    for (const int id : searched_) {
      const Vector3 p_c = T_c_w * map.point(id).p_w;
      const auto x = image_camera_.project(p_c);
      // Compared as numbers first: a pixel far outside is no int.
      if (!x ||
          !(x->x() > S(-1) && x->y() > S(-1) && x->x() < S(depth.width()) && x->y() < S(depth.height())))
        continue;
      const int u = static_cast<int>(std::lround(x->x())), v = static_cast<int>(std::lround(x->y()));
      if (u < 0 || v < 0 || u >= depth.width() || v >= depth.height()) continue;
      const auto z = depth(u, v);
      if (!is_valid_depth(z)) continue;
      const S ahead = static_cast<S>(z) - p_c.z(),
              slack = options_.depth_slack * p_c.z() + options_.depth_slack_sigmas * noise_.sigma(p_c.z());
      seen_through += ahead > slack ? 1 : 0;
      agree += ahead <= slack && ahead >= -slack ? 1 : 0;
    }
    return agree > 0 ? static_cast<S>(agree) / static_cast<S>(agree + seen_through) : S(0);
  }

  Camera camera_;
  ImageCamera image_camera_;
  DepthNoise<S> noise_;
  PlaceOptions<S> options_;
  std::vector<std::pair<int, int>> matches_;  // feature, point
  std::vector<PoseObservation<S>> observations_;
  std::vector<int> point_of_feature_, distance_of_feature_;
  std::vector<int> searched_;  // points
  std::vector<std::uint8_t> tried_;
  std::vector<std::pair<int, int>> around_;
  AbsolutePoseWorkspace absolute_;
  PoseWorkspace<S> pose_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
