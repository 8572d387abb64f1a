// SPDX-License-Identifier: BSD-3-Clause
// Which keyframe shows this place, among 100, 1000 and 10000 of 200 descriptors each, beside OpenCV's LSH
// index and a look at all of them. The image has another view of one keyframe's descriptors, which has to
// win.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/features2d.hpp>
#endif
#include "dynslam/features/place_index.hpp"
#include "support/descriptors.hpp"
#include "support/named.hpp"

namespace {

using namespace dynslam;

constexpr std::size_t kPerKeyframe = 200;
constexpr int kMaxDistance = 50;

/// Descriptors of all keyframes, one after the other, and an image that shows the place of one.
struct Places {
  std::vector<Descriptor> descriptors, image;
  int shown;
};

const Places& places(int keyframes) {
  static std::map<int, Places> made;
  const auto [at, is_new] = made.try_emplace(keyframes);
  if (is_new) {
    Places& out = at->second;
    bench::Random random(23);
    out.descriptors = bench::random_descriptors(random, kPerKeyframe * static_cast<std::size_t>(keyframes));
    out.shown = keyframes / 3;
    for (std::size_t k = 0; k < kPerKeyframe; ++k)
      out.image.push_back(bench::seen_again(
          random, out.descriptors[kPerKeyframe * static_cast<std::size_t>(out.shown) + k], 25));
  }
  return at->second;
}

/// @param query  query() -> (votes, keyframe) of the winner
template <class Query>
void time_query(benchmark::State& state, int keyframes, const Query& query) {
  const std::pair<int, int> winner = query();
  state.counters["votes"] = winner.first;
  if (winner.second != places(keyframes).shown || winner.first < static_cast<int>(kPerKeyframe / 2)) {
    state.SkipWithError("another place");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(query());
}

void ours(benchmark::State& state, int keyframes) {
  static int kept = 0;  // the index of 10000 keyframes is large: one at a time
  static std::unique_ptr<PlaceIndex> index;
  const Places& in = places(keyframes);
  if (kept != keyframes) {
    index = std::make_unique<PlaceIndex>();
    kept = keyframes;
    const std::vector<int> point(kPerKeyframe, 0);
    for (int k = 0; k < keyframes; ++k) {
      const auto first = kPerKeyframe * static_cast<std::size_t>(k);
      index->add(k, std::span(in.descriptors).subspan(first, kPerKeyframe), point);
    }
  }
  std::vector<std::pair<int, int>> out;
  time_query(state, keyframes, [&] {
    index->query(in.image, {}, out);
    return out.empty() ? std::pair(0, -1) : out.front();
  });
}

void look_at_all(benchmark::State& state, int keyframes) {
  const Places& in = places(keyframes);
  time_query(state, keyframes, [&] {
    std::pair<int, int> best(0, -1);
    for (int k = 0; k < keyframes; ++k) {
      int votes = 0;
      const auto first = in.descriptors.begin() + static_cast<std::ptrdiff_t>(kPerKeyframe) * k;
      for (const Descriptor& d : in.image) {
        votes +=
            std::any_of(first, first + kPerKeyframe,
                        [&](const Descriptor& other) { return hamming_distance(d, other) <= kMaxDistance; })
                ? 1
                : 0;
      }
      best = std::max(best, std::pair(votes, k));
    }
    return best;
  });
}

#ifdef DYNSLAM_BENCH_OPENCV
/// The nearest descriptor of each votes for its keyframe.
void opencv_lsh(benchmark::State& state, int keyframes) {
  cv::setNumThreads(1);
  const Places& in = places(keyframes);
  const auto matrix = [](const std::vector<Descriptor>& d) {
    return cv::Mat(static_cast<int>(d.size()), 32, CV_8UC1, const_cast<Descriptor*>(d.data()));
  };
  // Table number, key size, level of probing: as OpenCV's tutorial has them for ORB.
  cv::FlannBasedMatcher matcher(cv::makePtr<cv::flann::LshIndexParams>(6, 12, 1));
  matcher.add(std::vector<cv::Mat>{matrix(in.descriptors)});
  matcher.train();
  const cv::Mat image = matrix(in.image);
  std::vector<cv::DMatch> matches;
  time_query(state, keyframes, [&] {
    matcher.match(image, matches);
    std::vector<int> votes(static_cast<std::size_t>(keyframes), 0);
    for (const cv::DMatch& m : matches) {
      if (m.distance <= kMaxDistance) ++votes[static_cast<std::size_t>(m.trainIdx) / kPerKeyframe];
    }
    const auto most = std::max_element(votes.begin(), votes.end());
    return std::pair(*most, static_cast<int>(most - votes.begin()));
  });
}
#endif

const bool registered = [] {
  for (const int keyframes : {100, 1000, 10000}) {
    const std::string what = "place_query/" + std::to_string(keyframes);
    bench::add(what, "256bit", "dynslam", [=](benchmark::State& s) { ours(s, keyframes); });
    if (keyframes > 1000) continue;  // the rivals take a minute to build or seconds to ask
    bench::add(what, "256bit", "scalar", [=](benchmark::State& s) { look_at_all(s, keyframes); });
#ifdef DYNSLAM_BENCH_OPENCV
    bench::add(what, "256bit", "opencv_lsh", [=](benchmark::State& s) { opencv_lsh(s, keyframes); });
#endif
  }
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
