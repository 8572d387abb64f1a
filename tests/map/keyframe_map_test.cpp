// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/keyframe_map.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

template <class S>
FeatureFrame<S> frame_that_sees(const std::vector<int>& points, S x) {
  FeatureFrame<S> f;
  f.T_c_w = SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(x, S(0), S(0)));
  f.point = points;
  f.features.resize(points.size());
  f.descriptors.resize(points.size());
  f.dynamic.resize(points.size());
  return f;
}

/// Keyframes that see points at random; some points are bad, some merged, some keyframes culled.
template <class S>
KeyframeMap<S> random_map(test::Rng& rng) {
  KeyframeMap<S> map;
  for (int p = 0; p < 400; ++p) (void)map.add_point({});
  for (int k = 0; k < 30; ++k) {
    std::vector<int> seen;
    for (int p = 10 * k; p < 10 * k + 100; ++p) {
      if (rng.chance(0.7)) seen.push_back(rng.chance(0.1) ? -1 : p);
    }
    (void)map.add_keyframe(frame_that_sees<S>(seen, S(k)));
  }
  for (int i = 0; i < 20; ++i) {
    const int gone = rng.integer(0, 399), kept = rng.integer(0, 399);
    if (!map.point(gone).bad && !map.point(kept).bad) map.merge(gone, kept);
  }
  for (int i = 0; i < 20; ++i) map.point(rng.integer(0, 399)).bad = true;
  for (int i = 0; i < 40; ++i) map.forget(rng.integer(0, 29), rng.integer(0, 40));
  (void)map.cull_keyframes(20, 0.6, 3);
  return map;
}

/// Live points that a keyframe shows.
template <class S>
std::set<int> shown(const KeyframeMap<S>& map, const std::vector<int>& ids) {
  std::set<int> out;
  for (const int p : ids) {
    if (p >= 0 && !map.point(p).bad) out.insert(p);
  }
  return out;
}

template <class S>
std::vector<std::pair<int, int>> shared_by_all(const KeyframeMap<S>& map, const std::vector<int>& ids) {
  std::vector<std::pair<int, int>> out;
  const std::set<int> mine = shown(map, ids);
  for (const auto& k : map.keyframes()) {
    const std::set<int> theirs = shown(map, k.frame.point);
    const auto both =
        static_cast<int>(std::count_if(mine.begin(), mine.end(), [&](int p) { return theirs.count(p) > 0; }));
    out.emplace_back(both, k.id);
  }
  std::sort(out.rbegin(), out.rend());
  return out;
}

}  // namespace

TEST_CASE_TEMPLATE("the covisibility vote is the number of live points that two keyframes show", S, float,
                   double) {
  test::Rng rng("covisibility");
  for (int trial = 0; trial < 5; ++trial) {
    KeyframeMap<S> map = random_map<S>(rng);
    CHECK(std::any_of(map.keyframes().begin(), map.keyframes().end(),
                      [](const auto& k) { return k.culled(); }));
    std::vector<std::pair<int, int>> found;
    for (const auto& k : map.keyframes()) {
      for (const int at_least : {1, 15, 40}) {
        auto expected = shared_by_all(map, k.frame.point);
        std::erase_if(expected, [&](const auto& e) { return e.first < at_least || e.second == k.id; });
        map.covisible(k.id, at_least, found);
        CHECK(found == expected);
        map.covisible(k.id, at_least, found, 3);
        expected.resize(std::min<std::size_t>(expected.size(), 3));
        CHECK(found == expected);
      }
    }
  }
}

TEST_CASE_TEMPLATE("local points are those of the keyframes that share most with a frame", S, float, double) {
  test::Rng rng("local points");
  KeyframeMap<S> map = random_map<S>(rng);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<int> seen;
    for (int p = rng.integer(0, 300), last = p + 60; p < last; ++p) seen.push_back(map.present(p));
    const auto frame = frame_that_sees<S>(seen, S(0));
    auto near = shared_by_all(map, seen);
    std::erase_if(near, [](const auto& n) { return n.first < 1; });
    near.resize(std::min<std::size_t>(near.size(), 4));
    std::set<int> expected = shown(map, map.keyframes().back().frame.point);
    for (const auto& [shared, k] : near) expected.merge(shown(map, map.keyframe(k).frame.point));
    std::vector<int> ids;
    map.local_points(frame, 4, ids);
    CHECK(ids.size() == expected.size());  // each once
    CHECK(std::set<int>(ids.begin(), ids.end()) == expected);
  }
  KeyframeMap<S> none;
  std::vector<int> ids{1, 2};
  none.local_points({}, 3, ids);
  CHECK(ids.empty());
}

TEST_CASE_TEMPLATE("merged points leave one, with the observers of both", S, float, double) {
  KeyframeMap<S> map;
  for (int k = 0; k < 4; ++k) (void)map.add_point({});
  (void)map.add_keyframe(frame_that_sees<S>({0, 1}, 0));
  (void)map.add_keyframe(frame_that_sees<S>({0, 2}, 1));
  (void)map.add_keyframe(frame_that_sees<S>({3, -1}, 2));
  map.merge(2, 1);
  CHECK(map.keyframe(1).frame.point == std::vector<int>{0, 1});
  CHECK(map.point(1).keyframes == std::vector<int>{0, 1});
  CHECK(map.point(2).bad);
  map.merge(1, 0);  // both keyframes see both: each shows it once
  CHECK(map.keyframe(0).frame.point == std::vector<int>{0, -1});
  CHECK(map.keyframe(1).frame.point == std::vector<int>{0, -1});
  CHECK(map.present(2) == 0);
  map.observe(2, 1, 0);
  CHECK(map.point(0).keyframes == std::vector<int>{0, 1, 2});
  map.merge(0, 0);
  CHECK_FALSE(map.point(0).bad);
}

TEST_CASE_TEMPLATE("a keyframe that tells nothing new goes, and its pose follows its parent", S, float,
                   double) {
  KeyframeMap<S> map;
  for (int k = 0; k < 20; ++k) (void)map.add_point({});
  std::vector<int> all(20);
  for (int k = 0; k < 20; ++k) all[static_cast<std::size_t>(k)] = k;
  const std::vector<int> first(all.begin(), all.begin() + 10), second(all.begin() + 10, all.end());
  (void)map.add_keyframe(frame_that_sees<S>(first, S(0.0)));
  (void)map.add_keyframe(frame_that_sees<S>(first, S(0.1)));  // redundant
  (void)map.add_keyframe(frame_that_sees<S>(all, S(0.2)));    // alone with two others in the second half
  (void)map.add_keyframe(frame_that_sees<S>(first, S(0.3)));
  (void)map.add_keyframe(frame_that_sees<S>(all, S(0.4)));
  (void)map.add_keyframe(frame_that_sees<S>(second, S(0.5)));
  CHECK(map.cull_keyframes(4, 0.9, 2) == std::vector<int>{1});
  CHECK(map.keyframe(1).culled());
  CHECK(map.keyframe(1).frame.features.empty());
  CHECK(std::find(map.point(0).keyframes.begin(), map.point(0).keyframes.end(), 1) ==
        map.point(0).keyframes.end());
  CHECK(map.pose(1).translation().x() == doctest::Approx(0.1));
  const int parent = map.keyframe(1).parent;
  map.keyframe(parent).frame.T_c_w =
      SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(0, 1, 0)) * map.keyframe(parent).frame.T_c_w;
  CHECK(map.pose(1).translation().x() == doctest::Approx(0.1));
  CHECK(map.pose(1).translation().y() == doctest::Approx(1.0));
  CHECK(map.cull_keyframes(4, 0.9, 2).empty());
  std::vector<std::pair<int, int>> near;
  map.covisible(4, 1, near);
  CHECK(near.front() == std::pair(20, 2));
  CHECK(std::none_of(near.begin(), near.end(), [](const auto& n) { return n.second == 1; }));
}

TEST_CASE_TEMPLATE("points that are seldom found, or found on moving objects, are culled", S, float, double) {
  struct Patch {
    int grey[4] = {};
  };
  KeyframeMap<S, Patch> map;
  const auto add = [&](int visible, int found, int on_mover) {
    MapPoint<S, Patch> p;
    p.visible = visible;
    p.found = found;
    p.on_mover = on_mover;
    return map.add_point(p);
  };
  const int young = add(11, 1, 0), lost = add(12, 2, 0), kept = add(12, 3, 0), mover = add(9, 5, 3),
            doubted = add(9, 6, 3), passed = add(9, 3, 2);
  map.cull();
  for (const int id : {young, kept, doubted, passed}) CHECK_FALSE(map.point(id).bad);
  for (const int id : {lost, mover}) CHECK(map.point(id).bad);
  CHECK(map.present(lost) == -1);
}

TEST_CASE_TEMPLATE("a frame that shows what a keyframe shows keeps its place beside it, and nothing else", S,
                   float, double) {
  KeyframeMap<S> map;
  for (int k = 0; k < 10; ++k) (void)map.add_point({});
  (void)map.add_keyframe(frame_that_sees<S>({0, 1, 2, 3}, S(0)));
  const int again = map.add_seen_again(frame_that_sees<S>({0, 1, 2}, S(0.1)), 0);
  CHECK(again == 1);
  CHECK(map.newest() == 1);
  CHECK(map.standing(again) == 0);
  CHECK(map.standing(0) == 0);
  CHECK(map.standing(-1) == -1);
  CHECK(map.keyframe(again).culled());
  CHECK(map.keyframe(again).frame.features.empty());
  CHECK(map.point(0).keyframes == std::vector<int>{0});
  CHECK(live_keyframes(map) == 1);
  map.keyframe(0).frame.T_c_w =
      SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(0, 1, 0)) * map.keyframe(0).frame.T_c_w;
  CHECK(map.pose(again).translation().x() == doctest::Approx(0.1));
  CHECK(map.pose(again).translation().y() == doctest::Approx(1.0));
  // Beside one that hangs itself; and what is searched around the newest is what its keyframe shows.
  CHECK(map.standing(map.add_seen_again(frame_that_sees<S>({}, S(0.2)), again)) == 0);
  CHECK(map.pose(2).translation().x() == doctest::Approx(0.2));
  std::vector<int> ids;
  map.local_points(frame_that_sees<S>({}, S(0)), 3, ids);
  CHECK(ids == std::vector<int>{0, 1, 2, 3});
}

TEST_CASE_TEMPLATE("bad points are freed, and every id that is left names the point that it named", S, float,
                   double) {
  test::Rng rng("keyframe map bad points");
  KeyframeMap<S> map = random_map<S>(rng);
  for (int p = 0; p < 400; ++p) {
    map.point(p).reference_distance = static_cast<float>(p);  // its name
    if (p < 250) map.point(p).bad = true;
  }
  const KeyframeMap<S> before = map;
  const std::vector<int> now = map.drop_bad_points();
  REQUIRE(now.size() == 400);
  CHECK(live_points(map) == live_points(before));
  CHECK(map.points().size() == static_cast<std::size_t>(live_points(before)));
  int merged = 0;
  for (int p = 0; p < 400; ++p) {
    const int stands = before.present(p), id = now[static_cast<std::size_t>(p)];
    CHECK((id < 0) == (stands < 0));
    if (id >= 0) CHECK(map.point(id).reference_distance == static_cast<float>(stands));
    merged += stands >= 0 && stands != p ? 1 : 0;
  }
  CHECK(merged > 0);
  for (const auto& k : map.keyframes()) {
    const auto& was = before.keyframe(k.id).frame.point;
    REQUIRE(k.frame.point.size() == was.size());
    for (std::size_t i = 0; i < was.size(); ++i) {
      const bool live = was[i] >= 0 && before.present(was[i]) >= 0;
      CHECK(k.frame.point[i] == (live ? now[static_cast<std::size_t>(was[i])] : -1));
    }
  }
  std::vector<int> ids, votes(map.keyframes().size(), 0);
  map.local_points(map.keyframe(map.newest()).frame, 12, ids);  // and the map goes on
  CHECK(!ids.empty());
}

TEST_CASE_TEMPLATE("culled keyframes are dropped, and what is left is where it was and sees what it saw", S,
                   float, double) {
  test::Rng rng("keyframe map culled");
  KeyframeMap<S> map = random_map<S>(rng);
  for (int k = 0; k < 40; ++k) {  // beside live ones, and beside each other
    const int parent = rng.integer(0, map.newest());
    (void)map.add_seen_again(frame_that_sees<S>({}, S(0.1 * k)), parent);
  }
  const KeyframeMap<S> before = map;
  std::vector<bool> needed;
  for (int k = 0; k <= map.newest(); ++k) needed.push_back(rng.chance(0.3));
  const std::vector<int> now = map.drop_culled(needed);
  CHECK(live_keyframes(map) == live_keyframes(before));
  CHECK(map.newest() < before.newest());
  int last = -1;
  for (int k = 0; k <= before.newest(); ++k) {
    const int id = now[static_cast<std::size_t>(k)];
    REQUIRE((id >= 0) == (!before.keyframe(k).culled() || needed[static_cast<std::size_t>(k)]));
    if (id < 0) continue;
    CHECK(id == ++last);
    CHECK(map.keyframe(id).id == id);
    CHECK((map.pose(id) * before.pose(k).inverse()).log().norm() < S(1e-4));
    CHECK(map.keyframe(id).frame.point == before.keyframe(k).frame.point);
    if (map.keyframe(id).culled()) CHECK_FALSE(map.keyframe(map.keyframe(id).parent).culled());
  }
  for (std::size_t p = 0; p < map.points().size(); ++p) {
    if (before.points()[p].bad) continue;
    std::vector<int> observers;
    for (const int k : before.points()[p].keyframes) observers.push_back(now[static_cast<std::size_t>(k)]);
    CHECK(map.points()[p].keyframes == observers);
  }
}

TEST_CASE_TEMPLATE(
    "a map that is taken in lies where it is placed, sees what it saw, and changes nothing here", S, float,
    double) {
  test::Rng rng("append");
  const KeyframeMap<S> a = random_map<S>(rng);
  KeyframeMap<S> b = random_map<S>(rng);
  for (auto& p : b.points()) {
    p.p_w = Eigen::Matrix<S, 3, 1>(S(rng.uniform(-2, 2)), S(rng.uniform(-2, 2)), S(rng.uniform(1, 5)));
    p.viewing = p.p_w.normalized();
  }
  Eigen::Matrix<S, 6, 1> xi;
  xi << S(3), S(-1), S(0.5), S(0.4), S(-0.7), S(1.1);
  const SE3<S> T = SE3<S>::exp(xi);
  KeyframeMap<S> both = a;
  const int first = both.append(b, T), points = static_cast<int>(a.points().size());
  CHECK(first == static_cast<int>(a.keyframes().size()));
  REQUIRE(both.keyframes().size() == a.keyframes().size() + b.keyframes().size());
  REQUIRE(both.points().size() == a.points().size() + b.points().size());
  for (int k = 0; k < first; ++k) {
    CHECK(both.keyframe(k).frame.point == a.keyframe(k).frame.point);
    CHECK(both.pose(k).matrix() == a.pose(k).matrix());
  }
  for (int k = 0; k <= b.newest(); ++k) {
    CHECK(both.keyframe(first + k).id == first + k);
    CHECK(both.keyframe(first + k).culled() == b.keyframe(k).culled());
    CHECK((both.pose(first + k).matrix() - (b.pose(k) * T.inverse()).matrix()).norm() < S(1e-4));
    std::set<int> expected;
    for (const int p : shown(b, b.keyframe(k).frame.point)) expected.insert(p + points);
    CHECK(shown(both, both.keyframe(first + k).frame.point) == expected);
  }
  for (int p = 0; p < static_cast<int>(b.points().size()); ++p) {
    const auto &was = b.point(p), &now = both.point(points + p);
    CHECK((now.p_w - T * was.p_w).norm() < S(1e-4));
    CHECK(now.viewing.dot(T.so3() * was.viewing) == doctest::Approx(1).epsilon(1e-4));
    CHECK(now.bad == was.bad);
    CHECK(both.present(points + p) == (b.present(p) < 0 ? -1 : points + b.present(p)));
    for (std::size_t i = 0; i < was.keyframes.size(); ++i)
      CHECK(now.keyframes[i] == first + was.keyframes[i]);
  }
}

TEST_CASE("the image that a point's patch is from is named by its new id") {
  struct Origin {
    int keyframe = -1;
  };
  KeyframeMap<double, Origin> a, b;
  (void)a.add_keyframe(frame_that_sees<double>({}, 0.0));
  MapPoint<double, Origin> known, unknown;
  known.patch.keyframe = 0;
  (void)b.add_point(known);
  (void)b.add_point(unknown);
  (void)b.add_keyframe(frame_that_sees<double>({0, 1}, 0.0));
  CHECK(a.append(b, {}) == 1);
  CHECK(a.point(0).patch.keyframe == 1);
  CHECK(a.point(1).patch.keyframe == -1);
}
