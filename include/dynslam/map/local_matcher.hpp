// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/features/feature_placer.hpp"
#include "dynslam/features/guided_match.hpp"
#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/map/keyframe_map.hpp"

namespace dynslam {

/// Options of LocalMatcher.
template <std::floating_point S>
struct LocalMatchOptions {
  int max_distance =
      100;  ///< Hamming distance of a match: generous, for the geometry limits the search already
  float last_ratio = 0.9F;   ///< see GuidedQuery::ratio; near the last frame's points few others are alike
  float local_ratio = 0.8F;  ///< and among all points of the local map
  int keyframes = 12;        ///< neighbours whose points are searched
  float patch_sigma = 0.5F;  ///< pixels of its level: accuracy of a match by patch; a corner has 1
  S min_cosine = S(0.5);     ///< between the directions from which a point was seen and is: 60 degrees
  S straight_cosine = S(0.998);   ///< from which on the pose says best where it is: 3.6 degrees
  float straight_radius = 3.75F;  ///< searched around a point seen as before [pixels of its level]
  float oblique_radius = 6.0F;    ///< and of one seen more from the side
  float corner_radius = 2.0F;     ///< around what a patch found, for the corner that is the same thing [same]
  int corner_octaves = 2;         ///< and levels that may lie between the two
};

/// Matches points of the map with the features of a frame: first those of the last frame near where they are
/// expected, then all of the local map, by their patches where these are found and by descriptor otherwise.
///
/// A point whose patch is found where no corner is gets a feature of its own. Such features stand behind the
/// extracted ones and mean nothing once they have lost their point: drop_unmatched() removes them then.
/// @tparam C  the camera as recorded; matching by descriptor goes by the ideal pinhole pixels of Feature::x,
/// y
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
class LocalMatcher {
 public:
  using S = typename C::ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  /// @param scales  of the pyramid levels on which features are found, against level 0: 1, s, s^2, ...
  LocalMatcher(const C& camera, int width, int height, std::span<const float> scales,
               const LocalMatchOptions<S>& options = {})
      : placer_(camera, width, height), options_(options), scales_(scales.begin(), scales.end()) {
    DYNSLAM_ASSERT(!scales_.empty(), "level 0 has scale 1");
  }

  [[nodiscard]] FeaturePlacer<C>& placer() { return placer_; }
  [[nodiscard]] const FeaturePlacer<C>& placer() const { return placer_; }

  /// Says that a frame has as yet its extracted features alone.
  void begin(const FeatureFrame<S>& frame) { extracted_ = frame.features.size(); }

  /// Takes all matches back, and with them the features that stand for a point only.
  void clear(FeatureFrame<S>& frame) const {
    std::fill(frame.point.begin(), frame.point.end(), -1);
    drop_unmatched(frame);
  }

  /// Removes the features that were added for points which the frame does not match after all.
  void drop_unmatched(FeatureFrame<S>& frame) const {
    std::size_t kept = extracted_;
    for (std::size_t i = extracted_; i < frame.features.size(); ++i) {
      if (frame.point[i] < 0) continue;
      frame.features[kept] = frame.features[i];
      frame.descriptors[kept] = frame.descriptors[i];
      frame.point[kept] = frame.point[i];
      frame.dynamic[kept] = frame.dynamic[i];
      ++kept;
    }
    frame.features.resize(kept);
    frame.descriptors.resize(kept);
    frame.point.resize(kept);
    frame.dynamic.resize(kept);
  }

  /// Matches what the last frame saw, anew, near where it is expected.
  /// @param T_c_w   expected pose
  /// @param radius  of the search [pixels of the feature's level]
  /// @return number of matches
  template <class Map>
  int match_last(const Map& map, const FeatureFrame<S>& last, const SE3<S>& T_c_w, float radius,
                 FeatureFrame<S>& frame) {
    clear(frame);
    distance_.assign(frame.features.size(), kNoMatch);
    int matches = 0;
    for (std::size_t i = 0; i < last.features.size(); ++i) {
      if (i + kAhead < last.features.size() && last.point[i + kAhead] >= 0) {
        const auto& later = map.point(last.point[i + kAhead]);
        detail::prefetch(&later.p_w);
        detail::prefetch(&later.bad);
      }
      const int id = map.present(last.point[i]);
      if (id < 0 || last.dynamic[i] != 0) continue;
      const auto x = placer_.pinhole().project(T_c_w * map.point(id).p_w);
      if (!x) continue;
      const Feature& f = last.features[i];
      const GuidedMatch found =
          guided_match(frame.view(), last.descriptors[i],
                       {static_cast<float>(x->x()), static_cast<float>(x->y()), radius * scale(f.octave),
                        f.octave - 1, f.octave + 1, options_.max_distance, options_.last_ratio});
      if (!found.ok()) continue;
      const auto at = static_cast<std::size_t>(found.feature);
      if (found.distance >= distance_[at]) continue;
      if (frame.point[at] < 0) ++matches;
      frame.point[at] = id;
      distance_[at] = found.distance;
    }
    return matches;
  }

  /// Moves matched features to where the patches of their points are.
  template <class Map, ImagePyramidLike P, DepthImage D>
  void refine(const Map& map, const SE3<S>& T_c_w, const P& pyramid, const D& depth,
              FeatureFrame<S>& frame) const {
    for (std::size_t i = 0; i < frame.point.size(); ++i) {
      if (frame.point[i] < 0) continue;
      Feature& f = frame.features[i];
      const auto& p = map.point(frame.point[i]);
      const Vector2 start(static_cast<S>(f.u), static_cast<S>(f.v));
      if (p.patch.level < 0) continue;
      const Matrix3 R = turn(map, p.patch.keyframe, T_c_w);
      if (const auto match = align(p, R, T_c_w * p.p_w, start, pyramid)) move(f, *match, depth);
    }
  }

  /// Matches the points of the local map that the pose has in view, beside the matches that the frame has.
  /// Counts in the map how often points should have been and were found.
  /// @return number of new matches
  template <class Map, ImagePyramidLike P, DepthImage D>
  int match_local(Map& map, const SE3<S>& T_c_w, const P& pyramid, const D& depth, FeatureFrame<S>& frame) {
    map.local_points(frame, options_.keyframes, candidates_);
    hold(map, frame);
    forget_turns(map);
    const Vector3 centre = T_c_w.inverse().translation();
    int matches = 0;
    for (std::size_t k = 0; k < candidates_.size(); ++k) {
      if (k + kAhead < candidates_.size()) detail::prefetch_object(map.point(candidates_[k + kAhead]));
      const int id = candidates_[k];
      auto& p = map.point(id);
      const auto seen = expect(p, T_c_w, centre);
      if (!seen) continue;
      const int held = holder_[static_cast<std::size_t>(id)];
      if (held < 0) ++p.visible;
      // Its patch says where it is to a fraction of a pixel.
      const auto start = placer_.project(seen->p_c);
      const auto match = start && p.patch.level >= 0
                             ? align(p, turn_from(map, p.patch.keyframe, T_c_w), seen->p_c, *start, pyramid)
                             : std::nullopt;
      if (match) {
        matches += take_patch(p, id, held, *match, depth, frame) ? 1 : 0;
      } else if (held < 0) {
        matches += take_corner(map, id, *seen, frame) ? 1 : 0;
      }
    }
    return matches;
  }

 private:
  static constexpr int kNoMatch = kDescriptorBits + 1, kSettled = -1;
  static constexpr std::size_t kAhead = 3;  // candidates that are asked for before they are looked at

  struct Turn {
    Matrix3 R = Matrix3::Identity();
    std::uint64_t since = 0;  // the turns_known_ of which it is
  };

  /// A point as it is expected in the image.
  struct Sight {
    Vector3 p_c;  // camera frame [m]
    Vector2 x;    // ideal pixel
    S distance, cosine;
  };

  [[nodiscard]] float scale(int octave) const { return scales_[static_cast<std::size_t>(octave)]; }

  /// Notes the matches that the frame has; they are not replaced.
  template <class Map>
  void hold(Map& map, const FeatureFrame<S>& frame) {
    distance_.assign(frame.features.size(), kNoMatch);
    holder_.assign(map.points().size(), -1);
    for (std::size_t i = 0; i < frame.point.size(); ++i) {
      if (frame.point[i] < 0) continue;
      auto& p = map.point(frame.point[i]);
      holder_[static_cast<std::size_t>(frame.point[i])] = static_cast<int>(i);
      distance_[i] = kSettled;
      ++p.visible;
      ++p.found;
    }
  }

  template <class Point>
  [[nodiscard]] std::optional<Sight> expect(const Point& p, const SE3<S>& T_c_w,
                                            const Vector3& centre) const {
    const Vector3 p_c = T_c_w * p.p_w;
    const auto x = placer_.pinhole().project(p_c);
    if (!x || x->x() < S(0) || x->y() < S(0) || x->x() >= S(placer_.width()) || x->y() >= S(placer_.height()))
      return std::nullopt;
    const Vector3 ray = p.p_w - centre;
    const S distance = ray.norm();
    const S cosine = ray.dot(p.viewing) / (distance * std::max(S(1e-9), p.viewing.norm()));
    if (cosine < options_.min_cosine) return std::nullopt;
    return Sight{p_c, *x, distance, cosine};
  }

  /// Finds a point by its patch, near the recorded pixel `start`.
  /// @param R  rotation from the camera that cut the patch to the present one
  template <class Point, ImagePyramidLike P>
  [[nodiscard]] std::optional<PatchMatch<S>> align(const Point& p, const Matrix3& R, const Vector3& p_c,
                                                   const Vector2& start, const P& pyramid) const {
    const Vector3 p_ref =
        placer_.pinhole().ray(p.patch.ideal.template cast<S>()) * static_cast<S>(p.patch.depth);
    const auto warp = patch_warp(placer_.pinhole(), p_ref, p_c, R);
    return warp ? match_patch<S>(pyramid, p.patch, *warp, start) : std::nullopt;
  }

  template <class Map>
  void forget_turns(const Map& map) {
    turns_.resize(map.keyframes().size());
    ++turns_known_;
  }
  /// Rotation from a keyframe's camera to the present one.
  template <class Map>
  [[nodiscard]] static Matrix3 turn(const Map& map, int keyframe, const SE3<S>& T_c_w) {
    return (T_c_w.so3() * map.pose(keyframe).so3().inverse()).matrix();
  }
  /// The same, made once per keyframe and frame: the pose of a dropped one is stored relative to others.
  template <class Map>
  [[nodiscard]] const Matrix3& turn_from(const Map& map, int keyframe, const SE3<S>& T_c_w) {
    Turn& known = turns_[static_cast<std::size_t>(keyframe)];
    if (known.since != turns_known_) {
      known.R = turn(map, keyframe, T_c_w);
      known.since = turns_known_;
    }
    return known.R;
  }

  template <DepthImage D>
  void move(Feature& f, const PatchMatch<S>& match, const D& depth) const {
    f.octave = match.level;
    f.sigma = options_.patch_sigma * scale(match.level) * placer_.stretch(match.x);
    placer_.place(f, match.x, depth);
  }

  /// Uses a point that was found by its patch. @return whether that is a new match
  template <class Point, DepthImage D>
  bool take_patch(Point& p, int id, int held, const PatchMatch<S>& match, const D& depth,
                  FeatureFrame<S>& frame) {
    Feature f;
    move(f, match, depth);
    if (!placer_.sees(f)) return false;
    if (held >= 0) {
      Feature& own = frame.features[static_cast<std::size_t>(held)];
      f.angle = own.angle;
      own = f;
      return false;
    }
    // A corner that was found right there is the same thing; without one the point stands by itself.
    const GuidedMatch corner = guided_match(
        frame.view(), p.descriptor,
        {f.x, f.y, options_.corner_radius * scale(match.level), match.level - options_.corner_octaves,
         match.level + options_.corner_octaves, options_.max_distance, 1.0F});
    const auto at = static_cast<std::size_t>(std::max(0, corner.feature));
    if (corner.ok() && frame.point[at] < 0) {
      f.angle = frame.features[at].angle;
      frame.features[at] = f;
      frame.point[at] = id;
      distance_[at] = kSettled;
    } else {
      frame.features.push_back(f);
      frame.descriptors.push_back(p.descriptor);
      frame.point.push_back(id);
      frame.dynamic.push_back(0);
      distance_.push_back(kSettled);
    }
    ++p.found;
    return true;
  }

  /// Looks for a point by its descriptor. @return whether that is a new match
  template <class Map>
  bool take_corner(Map& map, int id, const Sight& seen, FeatureFrame<S>& frame) {
    auto& p = map.point(id);
    const int octave =
        expected_octave(p.reference_octave, p.reference_distance, static_cast<float>(seen.distance));
    const float radius =
        (seen.cosine > options_.straight_cosine ? options_.straight_radius : options_.oblique_radius) *
        scale(octave);
    const GuidedMatch found =
        guided_match(frame.view(), p.descriptor,
                     {static_cast<float>(seen.x.x()), static_cast<float>(seen.x.y()), radius, octave - 1,
                      octave + 1, options_.max_distance, options_.local_ratio});
    if (!found.ok()) return false;
    const auto at = static_cast<std::size_t>(found.feature);
    if (found.distance >= distance_[at]) return false;
    const bool added = frame.point[at] < 0;
    if (!added) --map.point(frame.point[at]).found;
    frame.point[at] = id;
    distance_[at] = found.distance;
    ++p.found;
    return added;
  }

  /// Level on which a corner of level `octave` at `then` metres is found at `now` metres.
  [[nodiscard]] int expected_octave(int octave, float then, float now) const {
    if (scales_.size() < 2) return 0;
    const float levels = std::log(then / now) / std::log(scales_[1] / scales_[0]);
    return std::clamp(octave + static_cast<int>(std::lround(levels)), 0,
                      static_cast<int>(scales_.size()) - 1);
  }

  FeaturePlacer<C> placer_;
  LocalMatchOptions<S> options_;
  std::vector<float> scales_;
  std::size_t extracted_ = 0;
  std::vector<int> candidates_, distance_, holder_;
  std::vector<Turn> turns_;  // per keyframe
  std::uint64_t turns_known_ = 0;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
