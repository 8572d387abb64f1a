// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/features/guided_match.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

/// Features all over an image and a little beyond its borders, whose descriptors are of few kinds.
struct Picture {
  std::vector<Feature> features;
  std::vector<Descriptor> descriptors;
  std::vector<std::uint8_t> ignored;
  FeatureGrid grid;

  explicit Picture(test::Rng& rng, int width = 640, int height = 480) {
    for (int i = 0; i < 1500; ++i) {
      Feature f;
      f.x = static_cast<float>(rng.uniform(-30, width + 30.0));
      f.y = static_cast<float>(rng.uniform(-30, height + 30.0));
      f.octave = rng.integer(0, 5);
      features.push_back(f);
      descriptors.push_back(variant(rng));
      ignored.push_back(rng.chance(0.1) ? 1 : 0);
    }
    grid.build(features, width, height);
  }
  static Descriptor variant(test::Rng& rng) {
    Descriptor d{};
    for (int bit = rng.integer(0, 60); bit > 0; --bit)
      d[static_cast<std::size_t>(rng.integer(0, 3))] |= 1ULL << rng.integer(0, 63);
    return d;
  }
  [[nodiscard]] FeatureView view() const { return {features, descriptors, ignored, grid}; }
};

/// The same by looking at every feature: (accepted, smallest distance).
template <class Accept>
std::pair<bool, int> exhaustive(const FeatureView& image, const Descriptor& descriptor,
                                const GuidedQuery& query, Accept&& accept) {
  int best = -1, distance = 257;
  std::vector<std::pair<int, int>> sorted;  // distance, octave
  for (std::size_t i = 0; i < image.features.size(); ++i) {
    const Feature& f = image.features[i];
    if (std::abs(f.x - query.x) > query.radius || std::abs(f.y - query.y) > query.radius) continue;
    if (f.octave < query.min_octave || f.octave > query.max_octave || image.ignored[i] != 0 ||
        !accept(static_cast<int>(i)))
      continue;
    const int d = hamming_distance(descriptor, image.descriptors[i]);
    sorted.emplace_back(d, f.octave);
    if (d < distance) {
      distance = d;
      best = static_cast<int>(i);
    }
  }
  if (best < 0 || distance > query.max_distance) return {false, distance};
  std::sort(sorted.begin(), sorted.end());
  // Of equals it is open which one counts as the best.
  if (sorted.size() > 1 && sorted[1].first == distance) return {query.ratio >= 1, distance};
  if (sorted.size() < 2 || sorted[1].second != sorted[0].second) return {true, distance};
  return {static_cast<float>(distance) <= query.ratio * static_cast<float>(sorted[1].first), distance};
}

}  // namespace

TEST_CASE("the grid visits what lies in the square, and nothing else") {
  test::Rng rng("feature grid");
  const Picture picture(rng);
  for (int trial = 0; trial < 300; ++trial) {
    const auto x = static_cast<float>(rng.uniform(-100, 740)), y = static_cast<float>(rng.uniform(-100, 580)),
               radius = static_cast<float>(rng.uniform(0, 60));
    std::vector<int> found, expected;
    picture.grid.for_each_near(picture.features, x, y, radius, [&](int i) { found.push_back(i); });
    for (std::size_t i = 0; i < picture.features.size(); ++i) {
      const Feature& f = picture.features[i];
      if (f.x >= x - radius && f.x <= x + radius && f.y >= y - radius && f.y <= y + radius)
        expected.push_back(static_cast<int>(i));
    }
    std::sort(found.begin(), found.end());
    CHECK(found == expected);
  }
}

TEST_CASE("a grid without features, and coordinates that are no pixels, are harmless") {
  FeatureGrid grid;
  int visits = 0;
  grid.for_each_near({}, 1, 1, 5, [&](int) { ++visits; });
  std::vector<Feature> features(3);
  features[0].x = -1e30F;
  features[1].x = std::nanf("");
  features[2].y = 1e30F;
  grid.build(features, 640, 480);
  grid.for_each_near(features, 1e30F, -1e30F, 5, [&](int) { ++visits; });
  grid.for_each_near(features, std::nanf(""), 0, 5, [&](int) { ++visits; });
  CHECK(visits == 0);
}

TEST_CASE("guided matching finds what an exhaustive search finds") {
  test::Rng rng("guided match");
  const Picture picture(rng);
  int accepted = 0, refused = 0, ambiguous = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    GuidedQuery query;
    query.x = static_cast<float>(rng.uniform(-20, 660));
    query.y = static_cast<float>(rng.uniform(-20, 500));
    query.radius = static_cast<float>(rng.uniform(1, 40));
    if (rng.chance(0.5)) {
      query.min_octave = rng.integer(0, 4);
      query.max_octave = query.min_octave + 1;
    }
    query.max_distance = rng.chance(0.3) ? 10 : 60;
    query.ratio = rng.chance(0.5) ? 0.8F : 1.0F;
    const Descriptor wanted = Picture::variant(rng);
    const int step = rng.integer(1, 3);
    const auto accept = [&](int i) { return i % step == 0; };
    const GuidedMatch match = guided_match(picture.view(), wanted, query, accept);
    const auto [ok, distance] = exhaustive(picture.view(), wanted, query, accept);
    CHECK(match.distance == distance);
    if (match.feature >= 0) {
      const auto i = static_cast<std::size_t>(match.feature);
      CHECK(hamming_distance(wanted, picture.descriptors[i]) == distance);
      CHECK(accept(match.feature));
      CHECK(picture.ignored[i] == 0);
    }
    // Two equal ones of different octaves are one corner; which of the octaves meets first is the grid's.
    if (match.ok() == ok) {
      ++(ok ? accepted : refused);
    } else {
      ++ambiguous;
      CHECK(query.ratio < 1);
    }
  }
  CHECK(accepted > 300);
  CHECK(refused > 300);
  CHECK(ambiguous < 100);
}

TEST_CASE("of two alike in one octave neither is certain; of neighbouring octaves they are one corner") {
  std::vector<Feature> features(2);
  features[1].x = 1;
  std::vector<Descriptor> descriptors(2);
  descriptors[0][0] = 0x0F;
  descriptors[1][0] = 0x1F;
  FeatureGrid grid;
  grid.build(features, 64, 48);
  GuidedQuery query;
  query.radius = 3;
  query.ratio = 0.75F;
  const Descriptor wanted{};
  CHECK_FALSE(guided_match({features, descriptors, {}, grid}, wanted, query).ok());
  features[1].octave = 1;
  const GuidedMatch match = guided_match({features, descriptors, {}, grid}, wanted, query);
  CHECK(match.ok());
  CHECK(match.feature == 0);
  CHECK(match.distance == 4);
  query.max_distance = 3;
  CHECK_FALSE(guided_match({features, descriptors, {}, grid}, wanted, query).ok());
}

TEST_CASE_TEMPLATE("what a feature tells of the pose carries its accuracies", S, float, double) {
  Feature f;
  f.x = 12;
  f.y = 34;
  f.depth = 2;
  f.sigma = 0.5F;
  const DepthNoise<S> noise{S(0.01), S(0)};
  const Eigen::Matrix<S, 3, 1> p(1, 2, 3);
  const PoseObservation<S> o = observe(f, p, noise);
  CHECK(o.x == Eigen::Matrix<S, 2, 1>(12, 34));
  CHECK(o.p_w == p);
  CHECK(o.inv_sigma_px2 == doctest::Approx(4));
  CHECK(o.inv_sigma_z2 == doctest::Approx(1e4));
  f.depth = 0;
  CHECK(observe(f, p, noise).inv_sigma_z2 == S(0));
}
