// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/features/multi_index.hpp"

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
    for (int i = 0; i < 3000; ++i) values.push_back(rng.engine()() & 0xFFFFU);
  }
  Descriptor draw() {
    Descriptor d{};
    for (std::size_t part = 0; part < 16; ++part) {
      const double u = rng.uniform();
      d[part / 4] |= values[static_cast<std::size_t>(u * u * 3000)] << (16 * (part % 4));
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

TEST_CASE("features without a point are not indexed, those on movers have no vote") {
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
