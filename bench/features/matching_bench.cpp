// SPDX-License-Identifier: BSD-3-Clause
// A thousand descriptors of one image against a thousand of another: all pairs, and those within 40 pixels of
// where each is expected (search by projection), beside OpenCV's brute-force matcher (in the second case with
// a mask of the pairs, made once) and bytes counted by a table. Every best match is the one that a look at
// all pairs finds.
#include <benchmark/benchmark.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/features2d.hpp>
#endif
#include "dynslam/features/guided_match.hpp"
#include "support/descriptors.hpp"
#include "support/named.hpp"

namespace {

using namespace dynslam;

constexpr int kFeatures = 1000;
constexpr float kRadius = 40;

struct Images {
  std::vector<Feature> before, now;
  std::vector<Descriptor> descriptors_before, descriptors_now;
  FeatureGrid grid;
  std::vector<int> best_of_all, best_near;
};

bool near(const Feature& a, const Feature& b) {
  return b.x >= a.x - kRadius && b.x <= a.x + kRadius && b.y >= a.y - kRadius && b.y <= a.y + kRadius;
}

const Images& images() {
  static const Images made = [] {
    Images out;
    bench::Random random(17);
    out.descriptors_before = bench::random_descriptors(random, kFeatures);
    for (const Descriptor& d : out.descriptors_before) {
      Feature f;
      f.x = f.u = static_cast<float>(random.uniform(20, 620));
      f.y = f.v = static_cast<float>(random.uniform(20, 460));
      out.before.push_back(f);
      f.x = f.u = f.x + static_cast<float>(random.uniform(-15, 15));
      f.y = f.v = f.y + static_cast<float>(random.uniform(-15, 15));
      out.now.push_back(f);
      out.descriptors_now.push_back(bench::seen_again(random, d, 30));
    }
    out.grid.build(out.now, 640, 480);
    for (std::size_t i = 0; i < kFeatures; ++i) {
      std::array<int, 2> best{-1, -1}, least{1000, 1000};
      for (std::size_t j = 0; j < kFeatures; ++j) {
        int distance = 0;
        for (std::size_t w = 0; w < 4; ++w)
          distance += std::popcount(out.descriptors_before[i][w] ^ out.descriptors_now[j][w]);
        for (std::size_t c = 0; c < 2; ++c) {
          if (distance >= least[c] || (c == 1 && !near(out.before[i], out.now[j]))) continue;
          least[c] = distance;
          best[c] = static_cast<int>(j);
        }
      }
      out.best_of_all.push_back(best[0]);
      out.best_near.push_back(best[1]);
    }
    return out;
  }();
  return made;
}

/// @param match  match(best): fills the best match of each
template <class Match>
void time_match(benchmark::State& state, const std::vector<int>& expected, const Match& match) {
  std::vector<int> best(kFeatures);
  match(best);
  if (best != expected) {
    state.SkipWithError("other matches");
    return;
  }
  for (auto _ : state) {
    match(best);
    benchmark::DoNotOptimize(best.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kFeatures);
}

/// @param distance  of two descriptors
template <class Distance>
void all_pairs(benchmark::State& state, const Distance& distance) {
  const auto &before = images().descriptors_before, &now = images().descriptors_now;
  time_match(state, images().best_of_all, [&](std::vector<int>& best) {
    for (std::size_t i = 0; i < before.size(); ++i) {
      int least = 1000;
      for (std::size_t j = 0; j < now.size(); ++j) {
        const int d = distance(before[i], now[j]);
        if (d >= least) continue;
        least = d;
        best[i] = static_cast<int>(j);
      }
    }
  });
}

int by_table(const Descriptor& a, const Descriptor& b) {
  static const auto table = [] {
    std::array<std::uint8_t, 256> counts{};
    for (unsigned k = 0; k < 256; ++k) counts[k] = static_cast<std::uint8_t>(std::popcount(k));
    return counts;
  }();
  int distance = 0;
  for (std::size_t w = 0; w < 4; ++w) {
    for (std::uint64_t x = a[w] ^ b[w]; x != 0; x >>= 8) distance += table[x & 0xFF];
  }
  return distance;
}

void guided(benchmark::State& state) {
  const Images& in = images();
  const FeatureView view{in.now, in.descriptors_now, {}, in.grid};
  time_match(state, in.best_near, [&](std::vector<int>& best) {
    for (std::size_t i = 0; i < kFeatures; ++i) {
      const GuidedQuery query{.x = in.before[i].x, .y = in.before[i].y, .radius = kRadius};
      best[i] = guided_match(view, in.descriptors_before[i], query).feature;
    }
  });
}
void guided_by_table(benchmark::State& state) {
  const Images& in = images();
  time_match(state, in.best_near, [&](std::vector<int>& best) {
    for (std::size_t i = 0; i < kFeatures; ++i) {
      int least = 1000;
      for (std::size_t j = 0; j < kFeatures; ++j) {
        if (!near(in.before[i], in.now[j])) continue;
        const int d = by_table(in.descriptors_before[i], in.descriptors_now[j]);
        if (d >= least) continue;
        least = d;
        best[i] = static_cast<int>(j);
      }
    }
  });
}

#ifdef DYNSLAM_BENCH_OPENCV
void opencv_matcher(benchmark::State& state, bool only_near) {
  cv::setNumThreads(1);
  const Images& in = images();
  const auto matrix = [](const std::vector<Descriptor>& d) {
    return cv::Mat(kFeatures, 32, CV_8UC1, const_cast<Descriptor*>(d.data()));
  };
  const cv::Mat before = matrix(in.descriptors_before), now = matrix(in.descriptors_now);
  cv::Mat mask;
  if (only_near) {
    mask.create(kFeatures, kFeatures, CV_8UC1);
    for (int i = 0; i < kFeatures; ++i) {
      for (int j = 0; j < kFeatures; ++j)
        mask.at<std::uint8_t>(i, j) =
            near(in.before[static_cast<std::size_t>(i)], in.now[static_cast<std::size_t>(j)]) ? 255 : 0;
    }
  }
  const cv::BFMatcher matcher(cv::NORM_HAMMING);
  std::vector<cv::DMatch> matches;
  time_match(state, only_near ? in.best_near : in.best_of_all, [&](std::vector<int>& best) {
    matcher.match(before, now, matches, mask);
    for (const cv::DMatch& m : matches) best[static_cast<std::size_t>(m.queryIdx)] = m.trainIdx;
  });
}
#endif

const bool registered = [] {
  constexpr const char* kAll = "matching/all_1000x1000";
  constexpr const char* kNear = "matching/guided_1000_of_1000";
  bench::add(kAll, "256bit", "dynslam", [](benchmark::State& s) { all_pairs(s, hamming_distance); });
  bench::add(kAll, "256bit", "scalar", [](benchmark::State& s) { all_pairs(s, by_table); });
  bench::add(kNear, "256bit", "dynslam", guided);
  bench::add(kNear, "256bit", "scalar", guided_by_table);
#ifdef DYNSLAM_BENCH_OPENCV
  bench::add(kAll, "256bit", "opencv", [](benchmark::State& s) { opencv_matcher(s, false); });
  bench::add(kNear, "256bit", "opencv", [](benchmark::State& s) { opencv_matcher(s, true); });
#endif
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
