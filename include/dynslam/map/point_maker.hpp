// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/config.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/map/keyframe_map.hpp"

namespace dynslam {

/// Which features become points of the map.
template <std::floating_point S>
struct PointMakerOptions {
  S max_depth = S(8);      ///< farther depth makes no points [m]; noise grows with z^2, weights follow
  float spacing = 6.0F;    ///< pixels: a second point beside a tracked one tells nothing new
  int enough_known = 200;  ///< features on known static surfaces from which on others make no points
  bool average =
      false;  ///< points become the mean of what keyframes measure; where nothing else adjusts them
  DepthNoise<S> depth_noise{S(0.004), S(0.008)};  ///< of that mean, and of new points
  // Seen from elsewhere a point looks different, and its patch is cut anew:
  S nearer = S(0.75), farther = S(1.33);  ///< at this share of the distance
  S aside_cosine = S(0.94);               ///< from this far around it: 20 degrees
  S turned = S(0.35);                     ///< with the camera turned by so much [rad]
};

/// Makes the map points of a new keyframe from the depth of its features, and keeps those it sees up to date.
/// A feature whose pixel has no ray (beyond the field of a lens) has no depth to go by.
/// @tparam Camera  of the pixels Feature::x, y: the ideal pinhole, or any other in whose pixels they are
template <std::floating_point S, CameraOf<S> Camera = Pinhole<S>>
class PointMaker {
 public:
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  /// @param width, height  of the recorded images [px]
  PointMaker(const Camera& camera, int width, int height, const PointMakerOptions<S>& options = {})
      : camera_(camera),
        options_(options),
        columns_(static_cast<int>(static_cast<float>(width) / options.spacing) + 1),
        rows_(static_cast<int>(static_cast<float>(height) / options.spacing) + 1) {}

  /// All features may make points.
  void trust_all(const FeatureFrame<S>& frame) { trusted_.assign(frame.features.size(), 1); }

  /// Only features on surfaces that are known to have stayed may make points, where there are enough of them:
  /// a mover that has just come into view is not found yet, and newly seen parts have to wait until they are
  /// known.
  /// @param verified  verified(u, v) -> bool: the surface at a recorded pixel was seen in the same place long
  /// before
  template <class Verified>
  void trust(const FeatureFrame<S>& frame, Verified&& verified) {
    trust_all(frame);
    int known = 0;
    for (std::size_t i = 0; i < frame.features.size(); ++i) {
      trusted_[i] = verified(frame.features[i].u, frame.features[i].v) ? 1 : 0;
      known += frame.dynamic[i] == 0 && (frame.point[i] >= 0 || trusted_[i] != 0) ? 1 : 0;
    }
    if (known < options_.enough_known) trust_all(frame);
  }

  /// Makes points for the trusted features of `frame`, the map's next keyframe, whose pose is final; trust()
  /// or trust_all() comes first.
  /// @param pyramid  of the frame's image, for patches
  /// @return number of features with a point, outside the dynamic flags
  template <class Map, ImagePyramidLike P>
  int make(Map& map, const P& pyramid, FeatureFrame<S>& frame) {
    DYNSLAM_ASSERT(trusted_.size() == frame.features.size(), "every feature is trusted or not");
    occupy(frame);
    const SE3<S> T_w_c = frame.T_c_w.inverse();
    int tracked = 0;
    for (std::size_t i = 0; i < frame.features.size(); ++i) {
      const Feature& f = frame.features[i];
      if (frame.dynamic[i] != 0) continue;
      const std::optional<Vector3> p_c = measured(f);
      if (frame.point[i] >= 0) {
        ++tracked;
        update(map, map.point(frame.point[i]), f, p_c, T_w_c, pyramid);
        continue;
      }
      if (!p_c || trusted_[i] == 0 || occupied_[cell_of(f)] != 0) continue;
      occupied_[cell_of(f)] = 1;
      frame.point[i] = map.add_point(point(map, frame, i, *p_c, T_w_c, pyramid));
      ++tracked;
    }
    return tracked;
  }

 private:
  [[nodiscard]] std::size_t cell_of(const Feature& f) const {
    return static_cast<std::size_t>(static_cast<int>(f.v / options_.spacing) * columns_ +
                                    static_cast<int>(f.u / options_.spacing));
  }

  void occupy(const FeatureFrame<S>& frame) {
    occupied_.assign(static_cast<std::size_t>(columns_ * rows_), 0);
    for (std::size_t i = 0; i < frame.features.size(); ++i) {
      if (frame.point[i] >= 0 && frame.dynamic[i] == 0) occupied_[cell_of(frame.features[i])] = 1;
    }
  }

  /// What a feature shows, in the camera's frame; nullopt without a depth, or one too far to be of use, and
  /// for a pixel that is none: a point's mean would keep NaN for good.
  [[nodiscard]] std::optional<Vector3> measured(const Feature& f) const {
    if (!(f.depth > 0 && static_cast<S>(f.depth) <= options_.max_depth)) return std::nullopt;
    if (!std::isfinite(f.x) || !std::isfinite(f.y)) return std::nullopt;
    return camera_.unproject({static_cast<S>(f.x), static_cast<S>(f.y)}, static_cast<S>(f.depth));
  }

  template <class Map, class Point, ImagePyramidLike P>
  void update(const Map& map, Point& p, const Feature& f, const std::optional<Vector3>& p_c,
              const SE3<S>& T_w_c, const P& pyramid) const {
    p.viewing += (p.p_w - T_w_c.translation()).normalized();
    if (p_c && options_.average) {
      const S information = options_.depth_noise.information(static_cast<S>(f.depth));
      p.p_w = (p.information * p.p_w + information * (T_w_c * *p_c)) / (p.information + information);
      p.information += information;
    }
    if (p_c && needs_patch(map, p, T_w_c)) cut(map, p, f, pyramid);
  }

  template <class Map, ImagePyramidLike P>
  [[nodiscard]] typename Map::PointType point(const Map& map, const FeatureFrame<S>& frame, std::size_t i,
                                              const Vector3& p_c, const SE3<S>& T_w_c,
                                              const P& pyramid) const {
    const Feature& f = frame.features[i];
    typename Map::PointType p;
    p.p_w = T_w_c * p_c;
    p.viewing = (p.p_w - T_w_c.translation()).normalized();
    p.descriptor = frame.descriptors[i];
    p.information = options_.depth_noise.information(static_cast<S>(f.depth));
    p.reference_distance = static_cast<float>((p.p_w - T_w_c.translation()).norm());
    p.reference_octave = f.octave;
    p.visible = p.found = 1;
    cut(map, p, f, pyramid);
    return p;
  }

  template <class Map, class Point>
  [[nodiscard]] bool needs_patch(const Map& map, const Point& p, const SE3<S>& T_w_c) const {
    if (p.patch.level < 0) return true;
    const SE3<S> T_ref_w = map.pose(p.patch.keyframe);
    const Vector3 before = p.p_w - T_ref_w.inverse().translation(), now = p.p_w - T_w_c.translation();
    const S ratio = now.norm() / before.norm();
    if (ratio < options_.nearer || ratio > options_.farther ||
        now.dot(before) < options_.aside_cosine * now.norm() * before.norm())
      return true;
    return (T_ref_w.so3() * T_w_c.so3()).log().norm() > options_.turned;
  }

  template <class Map, class Point, ImagePyramidLike P>
  void cut(const Map& map, Point& p, const Feature& f, const P& pyramid) const {
    PointPatch patch =
        cut_patch<S>(pyramid, Eigen::Matrix<S, 2, 1>(static_cast<S>(f.u), static_cast<S>(f.v)), f.octave);
    if (patch.level < 0) return;
    patch.keyframe = map.newest() + 1;  // the one being made
    patch.ideal = Eigen::Vector2f(f.x, f.y);
    patch.depth = f.depth;
    p.patch = patch;
  }

  Camera camera_;
  PointMakerOptions<S> options_;
  int columns_, rows_;                  // of the grid on which points keep their distance
  std::vector<std::uint8_t> occupied_;  // per cell
  std::vector<std::uint8_t> trusted_;   // per feature
};

template <CameraModel Camera>
PointMaker(const Camera&, int, int) -> PointMaker<typename Camera::ScalarType, Camera>;
template <CameraModel Camera>
PointMaker(const Camera&, int, int, const PointMakerOptions<typename Camera::ScalarType>&)
    -> PointMaker<typename Camera::ScalarType, Camera>;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
