// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/features/place_index.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

/// Descriptors as cameras give them: the parts take few values, some much more often than others.
struct Corners {
  test::Rng rng{"multi index"};
  std::vector<std::uint64_t> values;
  Corners() {
    for (int i = 0; i < 1000; ++i) values.push_back(rng.engine()() & 0xFFFFU);
  }
  Descriptor draw() {
    Descriptor d{};
    for (std::size_t part = 0; part < 16; ++part) {
      const double u = rng.uniform();
      d[part / 4] |= values[static_cast<std::size_t>(u * u * 1000)] << (16 * (part % 4));
    }
    return d;
  }
  std::vector<Descriptor> draw(int count) {
    std::vector<Descriptor> out;
    for (int i = 0; i < count; ++i) out.push_back(draw());
    return out;
  }
  /// The same corners from elsewhere.
  std::vector<Descriptor> seen_again(std::vector<Descriptor> of, int bits) {
    for (Descriptor& d : of) {
      for (int b = 0; b < bits; ++b)
        d[static_cast<std::size_t>(rng.integer(0, 3))] ^= 1ULL << rng.integer(0, 63);
    }
    return of;
  }
};

/// Votes of an exhaustive comparison with one keyframe.
int exhaustive(const std::vector<Descriptor>& asked, const std::vector<Descriptor>& keyframe,
               int max_distance) {
  return static_cast<int>(std::count_if(asked.begin(), asked.end(), [&](const Descriptor& a) {
    return std::any_of(keyframe.begin(), keyframe.end(),
                       [&](const Descriptor& b) { return hamming_distance(a, b) <= max_distance; });
  }));
}

int votes_of(const std::vector<std::pair<int, int>>& found, int keyframe) {
  for (const auto& [votes, k] : found) {
    if (k == keyframe) return votes;
  }
  return 0;
}

}  // namespace

TEST_CASE("the index counts what an exhaustive comparison counts") {
  Corners corners;
  PlaceIndex index;
  std::vector<std::vector<Descriptor>> keyframes;
  for (int k = 0; k < 12; ++k) {
    // Each shows half of what the one before did.
    std::vector<Descriptor> shown = corners.draw(30);
    if (k > 0) {
      const auto again = corners.seen_again(keyframes.back(), 10);
      shown.insert(shown.end(), again.begin(), again.begin() + 30);
    } else {
      const auto more = corners.draw(30);
      shown.insert(shown.end(), more.begin(), more.end());
    }
    keyframes.push_back(shown);
    index.add(k, shown, std::vector<int>(shown.size(), 1));
  }
  std::vector<std::pair<int, int>> found;
  for (int k = 0; k < 12; ++k) {
    const auto asked = corners.seen_again(keyframes[static_cast<std::size_t>(k)], 10);
    index.query(asked, {}, found);
    REQUIRE_FALSE(found.empty());
    CHECK(found.front().second == k);
    CHECK(std::is_sorted(found.rbegin(), found.rend()));
    int expected = 0, counted = 0;
    for (int other = 0; other < 12; ++other) {
      const int all = exhaustive(asked, keyframes[static_cast<std::size_t>(other)], 50);
      const int mine = votes_of(found, other);
      CHECK(mine <= all);
      expected += all;
      counted += mine;
    }
    CHECK(counted >= expected * 95 / 100);
  }
}

TEST_CASE("features without a point are not indexed, those on moving objects have no vote") {
  Corners corners;
  PlaceIndex index;
  const auto shown = corners.draw(40);
  std::vector<int> point(40, 7);
  std::fill(point.begin(), point.begin() + 10, -1);
  index.add(5, shown, point);
  std::vector<std::pair<int, int>> found;
  index.query(shown, {}, found);
  CHECK(found == std::vector<std::pair<int, int>>{{30, 5}});
  std::vector<std::uint8_t> moving(40, 0);
  std::fill(moving.end() - 12, moving.end(), 1);
  index.query(shown, moving, found);
  CHECK(found == std::vector<std::pair<int, int>>{{18, 5}});
  index.remove(5);
  index.query(shown, {}, found);
  CHECK(found.empty());
  index.remove(77);  // never there
}

TEST_CASE("an index of 10 000 keyframes answers for the oldest as one of 100 does") {
  Corners corners;
  PlaceIndex index;
  const auto first = corners.draw(60), again = corners.seen_again(first, 8);
  index.add(0, first, std::vector<int>(60, 1));
  std::vector<std::pair<int, int>> found;
  int few = 0;
  for (int k = 1; k < 10000; ++k) {
    index.add(k, corners.draw(20), std::vector<int>(20, 1));
    if (k != 100) continue;
    index.query(again, {}, found);
    few = votes_of(found, 0);
  }
  CHECK(few >= 50);
  index.query(again, {}, found);
  CHECK(found.front().second == 0);
  CHECK(votes_of(found, 0) >= few * 9 / 10);
}

TEST_CASE("removed keyframes are gone: what is left answers as if they had never been") {
  Corners corners;
  PlaceIndex index, fresh;
  const auto first = corners.draw(60), again = corners.seen_again(first, 8);
  for (PlaceIndex* one : {&index, &fresh}) one->add(0, first, std::vector<int>(60, 1));
  // Views that look much the same, as of a camera that stands: they fill the very lists of the first one.
  for (int k = 1; k < 400; ++k) {
    auto alike = corners.seen_again(first, 20);
    index.add(k, alike, std::vector<int>(60, 1));
  }
  for (int k = 1; k < 400; ++k) index.remove(k);
  CHECK(index.size() == 60);
  std::vector<std::pair<int, int>> found, expected;
  index.query(again, {}, found);
  fresh.query(again, {}, expected);
  CHECK(votes_of(expected, 0) >= 50);
  CHECK(found == expected);
  // Their memory is used again, and nothing of them is found in it.
  const auto other = corners.draw(60);
  index.add(3, other, std::vector<int>(60, 1));
  index.query(other, {}, found);
  CHECK(found.front() == std::pair(60, 3));
  index.add(3, first, std::vector<int>(60, 1));  // in the place of what it had
  CHECK(index.size() == 120);
  index.query(other, {}, found);
  CHECK(votes_of(found, 3) < 5);
}
