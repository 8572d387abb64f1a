// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/config.hpp"
#include "dynslam/features/descriptor.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/map/feature_frame.hpp"

namespace dynslam {

/// For points whose looks are told by their descriptor alone.
struct NoPatch {};

/// A landmark, made from the depth of the keyframe that first saw it and refined by later ones.
/// @tparam Patch  what else is remembered of its looks, such as a PointPatch
template <Scalar S = double, class Patch = NoPatch>
struct MapPoint {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  Vector3 p_w = Vector3::Zero();      ///< [m]
  Vector3 viewing = Vector3::Zero();  ///< mean unit direction from camera to point, of any length
  Descriptor descriptor{};
  Patch patch;
  S information = S(0);          ///< sum of the inverse depth variances that formed p_w [1/m^2]
  float reference_distance = 0;  ///< metres at creation
  int reference_octave = 0;
  int visible = 0, found = 0;  ///< frames in which it should have been / was matched
  int on_mover = 0;            ///< frames in which its match lay on the dynamic mask
  bool bad = false;
  int merged_into = -1;        ///< the point that stands for this one now; -1: none (bad then means gone)
  std::vector<int> keyframes;  ///< observers, oldest first
};

/// A keyframe: the frame's features and the map points they observe.
template <Scalar S = double>
struct Keyframe {
  int id = 0;
  FeatureFrame<S> frame;
  int parent = -1;    ///< of a culled keyframe: the one that its pose is stored relative to
  SE3<S> T_c_parent;  ///< and its place beside that one
  [[nodiscard]] bool culled() const { return parent >= 0; }
};

/// Which points are not worth keeping.
struct PointCulling {
  int trial = 12;                 ///< frames that a point is given, in which it should have been seen
  double min_found = 0.25;        ///< of these: found less often it is not where it is said to be
  int on_mover = 3;               ///< matches on moving objects from which a point is doubted
  double max_mover_share = 0.50;  ///< of its matches: with more it belongs to a mover
};

/// Keyframes and the points they see, with the covisibility queries that tracking and mapping need. Ids are
/// positions; nothing is ever erased, culled keyframes and bad points only lose their content.
template <Scalar S = double, class Patch = NoPatch>
class KeyframeMap {
 public:
  using ScalarType = S;
  using FrameType = FeatureFrame<S>;
  using KeyframeType = Keyframe<S>;
  using PointType = MapPoint<S, Patch>;

  KeyframeMap() = default;
  /// A map as it was saved; ids are positions.
  KeyframeMap(std::vector<KeyframeType> keyframes, std::vector<PointType> points)
      : points_(std::move(points)), keyframes_(std::move(keyframes)) {}

  [[nodiscard]] std::vector<PointType>& points() { return points_; }
  [[nodiscard]] const std::vector<PointType>& points() const { return points_; }
  [[nodiscard]] const std::vector<KeyframeType>& keyframes() const { return keyframes_; }
  [[nodiscard]] PointType& point(int id) { return points_[static_cast<std::size_t>(id)]; }
  [[nodiscard]] const PointType& point(int id) const { return points_[static_cast<std::size_t>(id)]; }
  [[nodiscard]] KeyframeType& keyframe(int id) { return keyframes_[static_cast<std::size_t>(id)]; }
  [[nodiscard]] const KeyframeType& keyframe(int id) const {
    return keyframes_[static_cast<std::size_t>(id)];
  }

  /// Id of the newest keyframe; -1 when there is none.
  [[nodiscard]] int newest() const { return static_cast<int>(keyframes_.size()) - 1; }

  /// T_c_w of a keyframe, culled or not.
  [[nodiscard]] SE3<S> pose(int keyframe) const {
    const KeyframeType* k = &this->keyframe(keyframe);
    SE3<S> T;
    while (k->culled()) {
      T = T * k->T_c_parent;
      k = &this->keyframe(k->parent);
    }
    return T * k->frame.T_c_w;
  }

  /// The point that stands for `id` after merging; -1 when there is none any more.
  [[nodiscard]] int present(int id) const {
    while (id >= 0 && point(id).bad) id = point(id).merged_into;
    return id;
  }

  /// Adds a point and returns its id.
  int add_point(PointType point) {
    points_.push_back(std::move(point));
    return static_cast<int>(points_.size()) - 1;
  }

  /// Adds a keyframe (its observations are registered with the points) and returns its id.
  int add_keyframe(const FrameType& frame) {
    const int id = static_cast<int>(keyframes_.size());
    keyframes_.emplace_back();
    keyframes_.back().id = id;
    keyframes_.back().frame = frame;
    for (const int p : frame.point) {
      if (p >= 0) point(p).keyframes.push_back(id);
    }
    return id;
  }

  /// Adds a frame of which nothing is kept but its place beside a keyframe that shows the same: one that is
  /// culled from the beginning. @return its id
  int add_seen_again(const FrameType& frame, int parent) {
    KeyframeType k;
    k.id = static_cast<int>(keyframes_.size());
    k.frame.index = frame.index;
    k.frame.t = frame.t;
    k.frame.T_c_w = frame.T_c_w;
    k.parent = parent;
    k.T_c_parent = frame.T_c_w * pose(parent).inverse();
    keyframes_.push_back(std::move(k));
    return keyframes_.back().id;
  }

  /// The keyframe that holds the pose of `keyframe`: itself, or the one that it was culled for; -1 for -1.
  [[nodiscard]] int standing(int keyframe) const {
    while (keyframe >= 0 && this->keyframe(keyframe).culled()) keyframe = this->keyframe(keyframe).parent;
    return keyframe;
  }

  /// Takes in the keyframes and points of another map, whose world T_world_other places in this one's; they
  /// get the next ids, their order stays. Points that both maps have stay two.
  /// @return id of its first keyframe here
  int append(KeyframeMap other, const SE3<S>& T_world_other) {
    const int keyframes = static_cast<int>(keyframes_.size()), points = static_cast<int>(points_.size());
    const SE3<S> T_other_world = T_world_other.inverse();
    for (PointType& p : other.points_) {
      p.p_w = T_world_other * p.p_w;
      p.viewing = T_world_other.so3() * p.viewing;
      if (p.merged_into >= 0) p.merged_into += points;
      for (int& k : p.keyframes) k += keyframes;
      if constexpr (requires { p.patch.keyframe; }) {
        if (p.patch.keyframe >= 0) p.patch.keyframe += keyframes;
      }
      points_.push_back(std::move(p));
    }
    for (KeyframeType& k : other.keyframes_) {
      k.id += keyframes;
      if (k.parent >= 0) k.parent += keyframes;
      k.frame.T_c_w = k.frame.T_c_w * T_other_world;
      for (int& p : k.frame.point) p = p >= 0 ? p + points : p;
      keyframes_.push_back(std::move(k));
    }
    return keyframes;
  }

  /// Frees the bad points: ids change, their order does not.
  /// @return per old id the new one of the point that stands for it, -1: none
  std::vector<int> drop_bad_points() {
    std::vector<int> now(points_.size(), -1);
    int next = 0;
    for (std::size_t p = 0; p < points_.size(); ++p) {
      if (!points_[p].bad) now[p] = next++;
    }
    for (std::size_t p = 0; p < points_.size(); ++p) {
      const int id = present(static_cast<int>(p));
      if (id >= 0) now[p] = now[static_cast<std::size_t>(id)];
    }
    std::vector<PointType> live;
    live.reserve(static_cast<std::size_t>(next));
    for (PointType& p : points_) {
      if (!p.bad) live.push_back(std::move(p));
    }
    points_ = std::move(live);
    stamp_.clear();
    for (KeyframeType& k : keyframes_) {
      for (int& p : k.frame.point) p = p >= 0 ? now[static_cast<std::size_t>(p)] : -1;
    }
    return now;
  }

  /// Drops culled keyframes, as before a map is saved: ids change, their order does not.
  /// @param needed  per id: culled ones that stay; they hang on live ones directly from then on
  /// @return per old id the new one, -1: dropped
  std::vector<int> drop_culled(const std::vector<bool>& needed) {
    DYNSLAM_ASSERT(needed.size() == keyframes_.size(), "every keyframe is needed or not");
    std::vector<int> now(keyframes_.size(), -1);
    int next = 0;
    for (KeyframeType& k : keyframes_) {
      const auto id = static_cast<std::size_t>(k.id);
      if (!k.culled() || needed[id]) now[id] = next++;
      if (!k.culled()) continue;
      const SE3<S> T_c_w = pose(k.id);
      k.parent = standing(k.id);
      k.T_c_parent = T_c_w * keyframe(k.parent).frame.T_c_w.inverse();
    }
    std::erase_if(keyframes_, [&](const KeyframeType& k) { return now[static_cast<std::size_t>(k.id)] < 0; });
    for (KeyframeType& k : keyframes_) {
      k.id = now[static_cast<std::size_t>(k.id)];
      if (k.culled()) k.parent = now[static_cast<std::size_t>(k.parent)];
    }
    for (PointType& p : points_) {
      for (int& k : p.keyframes) k = now[static_cast<std::size_t>(k)];
      std::erase(p.keyframes, -1);
      p.bad = p.bad || p.keyframes.empty();
    }
    return now;
  }

  /// The covisibility vote: adds to votes[k] how many of the points keyframe k sees, too.
  /// @param points  ids as in Frame::point; negative ones and bad points do not count
  /// @param votes   one per keyframe
  void count_shared(std::span<const int> points, std::vector<int>& votes) const {
    DYNSLAM_ASSERT(votes.size() == keyframes_.size(), "every keyframe has a vote");
    for (const int& p : points) {
      expect_after(p, points);
      if (p < 0 || point(p).bad) continue;
      for (const int k : point(p).keyframes) ++votes[static_cast<std::size_t>(k)];
    }
  }

  /// The keyframes with at least `min_shared` votes that `eligible(keyframe)` lets through: (votes, id), most
  /// first, ties newer first, at most `count`.
  template <class Eligible>
  static void rank(const std::vector<int>& votes, int min_shared, int count, Eligible&& eligible,
                   std::vector<std::pair<int, int>>& out) {
    out.clear();
    for (int k = 0; k < static_cast<int>(votes.size()); ++k) {
      const int shared = votes[static_cast<std::size_t>(k)];
      if (shared >= min_shared && eligible(k)) out.emplace_back(shared, k);
    }
    std::sort(out.begin(), out.end(), std::greater<>());
    if (static_cast<int>(out.size()) > count) out.resize(static_cast<std::size_t>(count));
  }

  /// Keyframes that share at least `min_shared` points with a keyframe: (shared points, id), most first,
  /// ties newer first, at most `count`.
  void covisible(int keyframe, int min_shared, std::vector<std::pair<int, int>>& out,
                 int count = std::numeric_limits<int>::max()) {
    votes_.assign(keyframes_.size(), 0);
    count_shared(this->keyframe(keyframe).frame.point, votes_);
    rank(
        votes_, min_shared, count, [&](int k) { return k != keyframe; }, out);
  }

  /// Ids of the points of the `count` keyframes that share most points with `frame` (ties: newer
  /// first), and of the newest keyframe or the one that it was culled for; each id once, bad points left out.
  void local_points(const FrameType& frame, int count, std::vector<int>& ids) {
    ids.clear();
    if (keyframes_.empty()) return;
    votes_.assign(keyframes_.size(), 0);
    count_shared(frame.point, votes_);
    rank(
        votes_, 1, count, [](int) { return true; }, neighbours_);
    neighbours_.emplace_back(0, standing(newest()));
    stamp_.resize(points_.size(), 0);
    ++present_;
    for (const auto& [shared, k] : neighbours_) {
      for (const int& p : keyframe(k).frame.point) {
        expect_after(p, keyframe(k).frame.point);
        if (p < 0 || stamp_[static_cast<std::size_t>(p)] == present_ || point(p).bad) continue;
        stamp_[static_cast<std::size_t>(p)] = present_;
        ids.push_back(p);
      }
    }
  }

  /// Says that a keyframe's feature shows a point. The feature must have none yet.
  void observe(int keyframe, int feature, int id) {
    this->keyframe(keyframe).frame.point[static_cast<std::size_t>(feature)] = id;
    point(id).keyframes.push_back(keyframe);
  }

  /// Takes back that a keyframe's feature shows the point it is said to; points that nobody sees are bad.
  void forget(int keyframe, int feature) {
    int& id = this->keyframe(keyframe).frame.point[static_cast<std::size_t>(feature)];
    if (id < 0) return;
    unsee(id, keyframe);
    id = -1;
  }

  /// Makes `kept` stand for `gone` too: it gets the other's observers.
  void merge(int gone, int kept) {
    if (gone == kept) return;
    PointType &from = point(gone), &to = point(kept);
    for (const int k : from.keyframes) {
      auto& ids = keyframe(k).frame.point;
      const auto at = std::find(ids.begin(), ids.end(), gone);
      if (at == ids.end()) continue;
      const bool seen = std::find(to.keyframes.begin(), to.keyframes.end(), k) != to.keyframes.end();
      *at = seen ? -1 : kept;  // a keyframe shows a point once
      if (!seen) to.keyframes.push_back(k);
    }
    std::sort(to.keyframes.begin(), to.keyframes.end());
    to.visible += from.visible;
    to.found += from.found;
    from.keyframes.clear();
    from.bad = true;
    from.merged_into = kept;
  }

  /// Removes keyframes whose points `share` or more are seen by at least `witnesses` others; the pose of each
  /// is stored relative to the keyframe that shares most points with it from then on. Tries those that share
  /// points with `newest`, except the first one and the last `spare`. @return the culled ids
  std::vector<int> cull_keyframes(int newest, double share, int spare, int witnesses = 3) {
    std::vector<int> culled;
    std::vector<std::pair<int, int>> tried;
    covisible(newest, 1, tried);
    for (const auto& [shared, id] : tried) {
      if (id == 0 || id + spare > newest || !redundant(id, share, witnesses)) continue;
      covisible(id, 1, neighbours_, 1);
      if (neighbours_.empty()) continue;
      hang_on(id, neighbours_.front().second);
      culled.push_back(id);
    }
    return culled;
  }

  /// Marks points that are seldom found where they should be, or found on what moves.
  void cull(const PointCulling& options = {}) {
    for (PointType& p : points_) {
      if (p.bad) continue;
      p.bad = (p.visible >= options.trial && p.found < options.min_found * p.visible) ||
              (p.on_mover >= options.on_mover && p.on_mover > options.max_mover_share * p.found);
    }
  }

 private:
  /// Asks for what is looked at of the eighth of `points` after `p`, which is one of them.
  void expect_after(const int& p, std::span<const int> points) const {
    if (points.data() + points.size() - &p > 8 && (&p)[8] >= 0) detail::prefetch(&point((&p)[8]).bad);
  }

  void unsee(int id, int keyframe) {
    PointType& p = point(id);
    std::erase(p.keyframes, keyframe);
    if (p.keyframes.empty()) p.bad = true;
  }

  [[nodiscard]] bool redundant(int id, double share, int witnesses) const {
    int seen = 0, elsewhere = 0;
    for (const int p : keyframe(id).frame.point) {
      if (p < 0 || point(p).bad) continue;
      ++seen;
      elsewhere += static_cast<int>(point(p).keyframes.size()) > witnesses ? 1 : 0;
    }
    return seen > 0 && elsewhere >= share * seen;
  }

  void hang_on(int id, int parent) {
    KeyframeType& k = keyframe(id);
    k.T_c_parent = k.frame.T_c_w * keyframe(parent).frame.T_c_w.inverse();
    k.parent = parent;
    for (const int p : k.frame.point) {
      if (p >= 0) unsee(p, id);
    }
    FrameType bare;  // only its pose and its place in time are needed any more
    bare.index = k.frame.index;
    bare.t = k.frame.t;
    bare.T_c_w = k.frame.T_c_w;
    k.frame = std::move(bare);
  }

  std::vector<PointType> points_;
  std::vector<KeyframeType> keyframes_;
  std::vector<int> votes_;
  std::vector<std::pair<int, int>> neighbours_;
  std::vector<std::uint32_t> stamp_;  // per point: the last local_points() that gave it out
  std::uint32_t present_ = 0;
};

/// Keyframes that have not been culled.
template <Scalar S, class Patch>
[[nodiscard]] int live_keyframes(const KeyframeMap<S, Patch>& map) {
  return static_cast<int>(std::count_if(map.keyframes().begin(), map.keyframes().end(),
                                        [](const auto& k) { return !k.culled(); }));
}

/// Points that are not bad.
template <Scalar S, class Patch>
[[nodiscard]] int live_points(const KeyframeMap<S, Patch>& map) {
  return static_cast<int>(
      std::count_if(map.points().begin(), map.points().end(), [](const auto& p) { return !p.bad; }));
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
