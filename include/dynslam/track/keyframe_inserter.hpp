// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/features/place_index.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/map/covering_keyframe.hpp"
#include "dynslam/map/keyframe_policy.hpp"
#include "dynslam/map/loop_closer.hpp"
#include "dynslam/map/point_maker.hpp"

namespace dynslam {

/// Options of KeyframeInserter.
template <std::floating_point S>
struct KeyframeInserterOptions {
  KeyframeOptions<S> policy;
  CoverageOptions<S> coverage;
  PointMakerOptions<S> points;
  LoopOptions<S> loops;
  bool close_loops = true;
  DepthNoise<S> depth_noise{S(0.004), S(0.008)};  ///< of loops
  /// Whether the first keyframe makes points of what its flags suspect, too: nothing is known yet to move,
  /// and they are used once they have stayed where they are for a while.
  bool first_points_of_all = true;
  std::size_t bad_points = 1000;  ///< beside as many as live ones, from which they are freed: half a megabyte
};

/// What became of a frame that was to be kept.
template <std::floating_point S>
struct KeyframeInsertion {
  std::optional<int> keyframe;         ///< its id; empty: one of the map shows the same
  std::optional<LoopClosing<S>> loop;  ///< closed with it: what is stored relative to the map follows its D
};

/// Makes tracked frames keyframes of the map: decides which, makes their points, and closes loops.
/// @tparam C  the camera as recorded
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
class KeyframeInserter {
 public:
  using S = typename C::ScalarType;
  using Frame = FeatureFrame<S>;
  using Options = KeyframeInserterOptions<S>;

  /// @param width, height  of the images [px]
  KeyframeInserter(const Pinhole<S>& pinhole, const C& camera, int width, int height,
                   const Options& options = {})
      : options_(options),
        width_(width),
        height_(height),
        points_(pinhole, width, height, options.points),
        loops_(pinhole, camera, options.depth_noise, options.loops) {}

  /// Whether a tracked frame is to be kept. @param inliers  its matches that fit its pose
  template <class Map>
  [[nodiscard]] bool wants(const Map& map, const Frame& frame, int inliers) const {
    KeyframeEvidence<S> seen;
    seen.frames = static_cast<int>(frame.index - last_index_);
    if (last_t_) seen.frames = frames_of_30_hz(seen.frames, frame.t - *last_t_);
    seen.inliers = inliers;
    seen.points_then = tracked_;
    seen.T_c_keyframe = frame.T_c_w * map.pose(map.newest()).inverse();
    return wants_keyframe(seen, options_.policy);
  }

  /// Keeps a frame: as a new keyframe, or as seen again by one that shows the same. Ids of points may change.
  /// @param depth    of the frame [m]
  /// @param matches  of the frame with the map
  /// @param trust    trust(PointMaker&, frame): says which features may make points, see PointMaker
  /// @param frame    its matches and pose are those of the keyframe afterwards
  template <class Map, ImagePyramidLike P, DepthImage D, class Trust>
  KeyframeInsertion<S> insert(Map& map, PlaceIndex& places, const P& pyramid, const D& depth, int matches,
                              Trust&& trust, Frame& frame) {
    free_bad_points(map, frame);
    KeyframeInsertion<S> result;
    const int known = covering_keyframe(map, frame, options_.coverage, votes_);
    if (known < 0) {
      result = add(map, places, pyramid, depth, trust, frame);
    } else {
      (void)map.add_seen_again(frame, known);
      map.cull();
      tracked_ = matches;
    }
    note(frame);
    return result;
  }

  /// Makes a frame the first keyframe of an empty map, without its depth image.
  template <class Map, ImagePyramidLike P>
  void begin(Map& map, PlaceIndex& places, const P& pyramid, Frame& frame) {
    tracked_ = make_first_points(map, pyramid, frame);
    frame.grid.build(frame.features, width_, height_);
    const int id = map.add_keyframe(frame);
    places.add(id, frame);
    note(frame);
  }

  /// Features of the last keyframe with a match, those it made included; of a frame that one of the map stood
  /// for, its matches.
  [[nodiscard]] int tracked() const { return tracked_; }

 private:
  template <class Map>
  void free_bad_points(Map& map, Frame& frame) const {
    if (map.points().size() <= options_.bad_points + 2 * static_cast<std::size_t>(live_points(map))) return;
    const std::vector<int> ids = map.drop_bad_points();
    for (int& p : frame.point) p = p >= 0 ? ids[static_cast<std::size_t>(p)] : -1;
  }

  template <class Map, class P, class D, class Trust>
  KeyframeInsertion<S> add(Map& map, PlaceIndex& places, const P& pyramid, const D& depth, Trust& trust,
                           Frame& frame) {
    if (map.keyframes().empty()) {
      tracked_ = make_first_points(map, pyramid, frame);
    } else {
      trust(points_, frame);
      tracked_ = points_.make(map, pyramid, frame);
    }
    frame.grid.build(frame.features, width_, height_);
    KeyframeInsertion<S> result;
    const int id = map.add_keyframe(frame);
    result.keyframe = id;
    map.cull();
    if (options_.close_loops) result.loop = loops_.close(map, places, id, depth);
    if (result.loop) {
      frame.T_c_w = map.keyframe(id).frame.T_c_w;
      frame.point = map.keyframe(id).frame.point;
    }
    places.add(id, map.keyframe(id).frame);
    return result;
  }

  /// @return number of features with a point that are not flagged
  template <class Map, class P>
  int make_first_points(Map& map, const P& pyramid, Frame& frame) {
    const std::vector<std::uint8_t> suspected = frame.dynamic;
    if (options_.first_points_of_all) std::fill(frame.dynamic.begin(), frame.dynamic.end(), std::uint8_t(0));
    points_.trust_all(frame);
    points_.make(map, pyramid, frame);
    frame.dynamic = suspected;
    int tracked = 0;
    for (std::size_t i = 0; i < frame.point.size(); ++i)
      tracked += frame.point[i] >= 0 && frame.dynamic[i] == 0 ? 1 : 0;
    return tracked;
  }

  void note(const Frame& frame) {
    last_index_ = frame.index;
    last_t_ = frame.t;
  }

  Options options_;
  int width_, height_;
  PointMaker<S> points_;
  LoopCloser<Pinhole<S>, C> loops_;
  std::vector<int> votes_;
  std::size_t last_index_ = 0;    // of the frame that was kept last
  std::optional<double> last_t_;  // empty until there is one [s]
  int tracked_ = 0;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
