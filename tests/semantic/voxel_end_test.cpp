// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/voxel_end.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "dynslam/semantic/scan_voxels.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

template <std::size_t N>
using LabelCount = std::integral_constant<std::size_t, N>;

}  // namespace

TEST_CASE_TEMPLATE("a scan's votes follow the samples however many labels share a voxel", N, LabelCount<17>,
                   LabelCount<40>, LabelCount<256>) {
  constexpr std::size_t kCount = N::value;
  test::Rng rng("shared votes");
  const auto votes_of = [](const std::vector<int>& samples) {
    BasicScanVoxels<kCount> scan{VoxelGrid(0.1)};
    const Eigen::Vector3d p(0.05, 0.05, 0.05);
    for (std::size_t l = 0; l < samples.size(); ++l)
      for (int k = 0; k < samples[l]; ++k) scan.add_end(p, static_cast<std::uint16_t>(l), {});
    scan.finish();
    const ScanBlock& block = scan.block(scan.order()[0]);
    LabelHistogram<kCount> labels;
    scan.end(block, ScanVoxels::index_in_block(pack(*scan.grid().key(p)))).vote(labels);
    return labels;
  };
  // Fault: 17 labels with a seventeenth each rounded to no vote at all, and no label.
  const auto even = votes_of(std::vector<int>(kCount, 1));
  CHECK(even.total() == 8);
  CHECK(even.top() == 1);
  CHECK(even == votes_of(std::vector<int>(kCount, 3)));
  std::vector<int> one_more(kCount, 1);
  one_more.back() = 2;
  CHECK(votes_of(one_more).top() == kCount - 1);
  CHECK(votes_of(one_more).total() == 8);
  CHECK(votes_of({4, 0, 4}).top() == 2);  // 0 is no label
  CHECK(votes_of({9, 0, 8}).top() == 0);
  CHECK(votes_of({0, 8, 9}).top() == 2);

  for (int trial = 0; trial < 300; ++trial) {
    std::vector<int> samples(kCount + 1, 0);  // the last is of a label that the map has not
    const int present = rng.integer(1, static_cast<int>(kCount));
    int total = 0;
    for (int k = 0; k < present; ++k) {
      const int n = rng.integer(1, 12);
      samples[static_cast<std::size_t>(rng.integer(0, static_cast<int>(kCount)))] += n;
      total += n;
    }
    const auto labels = votes_of(samples);
    const int others = samples[kCount];
    CHECK(labels.total() <= 8);
    CHECK(labels.total() >= (others == 0 ? 8 : 7 - 8 * others / total));
    std::size_t most = 0;
    for (std::size_t i = 0; i < kCount; ++i) {
      const int votes = labels.votes(static_cast<std::uint8_t>(i));
      if (9 * samples[i] > total) CHECK(votes > 0);
      if (samples[i] == 0) CHECK(votes == 0);
      for (std::size_t j = 0; j < kCount; ++j)
        if (samples[i] > samples[j]) CHECK(votes >= labels.votes(static_cast<std::uint8_t>(j)));
      if (samples[i] > samples[most]) most = i;
    }
    const bool only = std::count(samples.begin(), samples.end() - 1, samples[most]) == 1;
    if (only && samples[most] > others) CHECK(labels.top() == most);
  }
}

TEST_CASE("a label beyond those of a map is none, not another one") {
  BasicScanVoxels<256> scan{VoxelGrid(0.1)};
  const Eigen::Vector3d p(0.05, 0.05, 0.05);
  scan.add_end(p, 257, {});  // was 1
  scan.finish();
  LabelHistogram<256> labels;
  scan.end(scan.block(scan.order()[0]), ScanVoxels::index_in_block(pack(*scan.grid().key(p)))).vote(labels);
  CHECK(labels.empty());
}
