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
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/features/patch_search.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/pyramid.hpp"

namespace dynslam {

/// A keypoint for which a point is known.
template <std::floating_point S>
struct ReferenceKeypoint {
  Eigen::Matrix<S, 2, 1> x;  ///< recorded pixel
  S depth;                   ///< [m]; keypoints without a valid one are left out
  S scale = S(1);            ///< pixels of the image per pixel of the level on which it was found
  bool masked = false;       ///< on something that moved or may move: its matches are marked
};

/// Options of ReferenceKeyframe.
struct ReferenceOptions {
  int points = 400;        ///< keypoints that are used at most; more make the weights hardly better
  double max_depth = 5.0;  ///< beyond, depth is too noisy to judge [m]
  int levels = 4;  ///< of the pyramid that is searched: a mover may be 8 * 8 pixels from where expected
  double at_rest_px = 1.0;    ///< from where the pose expects it: found there, it needs no search
  double confirmed_px = 1.0;  ///< between what the search found and its patch: one and the same
  double border_px = 8.0;     ///< nearer to the image's border a patch is cut off
  double min_in_view = 0.8;   ///< share of its keypoints; with fewer in view it is stale: what has come
                              ///< into view since it knows nothing of
  double min_found = 0.3;     ///< share of its keypoints; with fewer found again it is stale
  int pause = 3;              ///< frames after which a keypoint that was not to be found is searched again
  PatchMatchOptions match;
  PatchSearchOptions search;
};

/// Keypoints of an earlier frame that are found again in later ones.
template <std::floating_point S>
class ReferenceKeyframe {
 public:
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Pyramid = HalvingPyramid<std::uint8_t>;

  [[nodiscard]] bool empty() const { return points_.empty(); }
  [[nodiscard]] std::size_t size() const { return points_.size(); }
  [[nodiscard]] const SE3<S>& T_c_w() const { return T_c_w_; }
  [[nodiscard]] ImageView<const std::uint8_t> gray() const { return pyramid_.image(0); }
  /// Keypoints that track() expected inside the image the last time.
  [[nodiscard]] std::size_t in_view() const { return in_view_; }
  /// Share of those at rest that track() expected inside the image and found, the last time: where it is
  /// small, something has come before them. 1 where none was expected.
  [[nodiscard]] double resting_found() const {
    return resting_ == 0 ? 1.0 : static_cast<double>(resting_found_) / static_cast<double>(resting_);
  }

  void place(const SE3<S>& T_c_w) { T_c_w_ = T_c_w; }

  /// Takes the keypoints of a frame, static and dynamic alike, thinned evenly where there are too many.
  template <CameraModel C>
  void set(const C& camera, const Pyramid& pyramid, std::span<const ReferenceKeypoint<S>> keypoints,
           const SE3<S>& T_c_w, const ReferenceOptions& options) {
    pyramid_ = pyramid;
    T_c_w_ = T_c_w;
    points_.clear();
    usable_.clear();
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      if (is_valid_depth(keypoints[i].depth) && keypoints[i].depth < S(options.max_depth))
        usable_.push_back(i);
    }
    const std::size_t n = std::min(static_cast<std::size_t>(options.points), usable_.size());
    for (std::size_t k = 0; k < n; ++k) {
      const auto& keypoint = keypoints[usable_[k * usable_.size() / n]];
      const auto p = camera.unproject(keypoint.x, keypoint.depth);
      const double octave = std::log2(std::max(1.0, static_cast<double>(keypoint.scale)));
      const int level = std::min(pyramid.size() - 1, static_cast<int>(std::lround(octave)));
      Point point{keypoint.x, p.value_or(Vector3::Zero()), cut_patch<S>(pyramid, keypoint.x, level),
                  keypoint.masked};
      if (p && point.patch.level >= 0) points_.push_back(point);
    }
    in_view_ = points_.size();
    resting_ = resting_found_ = 0;
  }

  /// Finds the keypoints in the present image. Most are where the pose says: a patch looks there first. Only
  /// what is not there is searched, from where it was last seen beside the expected place, then over the
  /// pyramid's levels; what that finds must look like the patch.
  /// @param prior    a-priori mask of the image's size, or of 0 x 0: its matches are marked
  /// @param matches  out
  template <DifferentiableCamera C, LabelImage M>
  void track(const C& camera, const Pyramid& present, const SE3<S>& T_c_w, const M& prior,
             const ReferenceOptions& options, std::vector<KeypointMatch<S>>& matches) {
    matches.clear();
    matched_.clear();
    in_view_ = resting_ = resting_found_ = 0;
    if (points_.empty()) return;
    const SE3<S> T_cur_ref = T_c_w * T_c_w_.inverse();
    const Eigen::Matrix<S, 3, 3> R = T_cur_ref.rotation_matrix();
    const S border = S(options.border_px);
    const S right = S(present.image(0).width()) - border, bottom = S(present.image(0).height()) - border;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      Point& point = points_[i];
      const Vector3 p_c = T_cur_ref * point.p_ref;
      const auto x = camera.project(p_c);
      if (!x || !(x->x() >= border && x->y() >= border && x->x() < right && x->y() < bottom)) continue;
      ++in_view_;
      const std::size_t rests = point.masked ? 0 : 1;
      resting_ += rests;
      const auto warp = patch_warp(camera, point.p_ref, p_c, R);
      if (!warp) continue;
      const auto found = find(point, present, *warp, *x, options);
      if (!found) continue;
      resting_found_ += rests;
      const int u = static_cast<int>(std::lround(found->x())), v = static_cast<int>(std::lround(found->y()));
      const bool inside = u >= 0 && v >= 0 && u < present.image(0).width() && v < present.image(0).height();
      const bool masked = point.masked || (inside && prior.width() > 0 && prior(u, v) != 0);
      if (!inside) continue;
      matches.push_back({point.x, point.p_ref, *found, masked});
      matched_.push_back(i);
    }
  }

  /// Whether match k of the last track() was found to move: if so, its matches are marked from then on, until
  /// they are found at rest. What has most of the keypoints would be the measure of what is static.
  void mark(std::size_t k, bool moves) { points_[matched_[k]].masked = moves; }

 private:
  struct Point {
    Vector2 x;      // recorded pixel
    Vector3 p_ref;  // in its camera's frame [m]
    PointPatch patch;
    bool masked = false;               // when it was taken or last judged
    Vector2 offset = Vector2::Zero();  // from the expected place, when it was searched and found last
    int pause = 0;                     // frames for which it is not searched
  };

  [[nodiscard]] std::optional<Vector2> find(Point& point, const Pyramid& present,
                                            const Eigen::Matrix<S, 2, 2>& warp, const Vector2& expected,
                                            const ReferenceOptions& options) const {
    const auto at_rest = match_patch<S>(present, point.patch, warp, expected, options.match);
    if (at_rest && (at_rest->x - expected).norm() < S(options.at_rest_px)) {
      point.offset.setZero();
      return at_rest->x;
    }
    if (point.pause > 0) {
      --point.pause;
      return std::nullopt;
    }
    const auto start =
        search_patch<S>(pyramid_, point.x, warp, present, Vector2(expected + point.offset), options.search);
    if (start) {
      const auto match = match_patch<S>(present, point.patch, warp, *start, options.match);
      if (match && (match->x - *start).norm() <= S(options.confirmed_px)) {
        point.offset = match->x - expected;
        return match->x;
      }
    }
    point.offset.setZero();
    point.pause = options.pause;
    return std::nullopt;
  }

  Pyramid pyramid_;
  SE3<S> T_c_w_;
  std::vector<Point> points_;
  std::vector<std::size_t> usable_, matched_;  // keypoints; points of the matches
  std::size_t in_view_ = 0, resting_ = 0, resting_found_ = 0;  // of the last track()
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
