// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/voxel_block.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

template <std::size_t N>
using LabelCount = std::integral_constant<std::size_t, N>;

}  // namespace

TEST_CASE_TEMPLATE("a block keeps log-odds and votes as voxels of their own would, and its summary", N,
                   LabelCount<1>, LabelCount<8>, LabelCount<80>) {
  constexpr std::size_t kLabels = N::value;
  const VoxelGrid grid(1.0);
  const LogOddsParams<float> params;
  test::Rng rng("voxel block");
  VoxelBlock<float, kLabels> block;
  std::vector<LabelHistogram<kLabels>> scratch;
  CellSummary<float, kLabels> summary;
  std::array<LogOddsCell<float>, 512> cells;
  std::array<LabelHistogram<kLabels>, 512> votes;
  int forgotten = 0;
  for (int scan_number = 0; scan_number < 60; ++scan_number) {
    BasicScanVoxels<kLabels> scan(grid);
    const double hit_share = scan_number % 3 == 0 ? 0.5 : 0.05;  // surfaces come and go
    for (std::size_t i = 0; i < 512; ++i) {
      VoxelKey key{{32768, 32768, 32768}};
      for (std::size_t a = 0; a < 3; ++a)
        key[a] = static_cast<std::uint16_t>(key[a] + scan.offset_in_block(i)[a]);
      const Eigen::Vector3d centre = grid.centre(key);
      if (rng.uniform(0, 1) < hit_share) {
        scan.add_end(key, static_cast<std::uint8_t>(rng.integer(0, int(kLabels) - 1)), {},
                     static_cast<float>(rng.uniform(0.2, 1)));
      } else if (rng.uniform(0, 1) < 0.4) {
        scan.carve(centre, Eigen::Vector3d(centre + Eigen::Vector3d(0, 0, 1)));
      }
    }
    scan.finish();
    const ScanBlock& from = scan.block(scan.order()[0]);
    block.fuse(scan, from, params, summary, scratch);
    for (std::size_t i = 0; i < 512; ++i) {
      const bool hit = (from.hit[i / 64] >> (i % 64) & 1) != 0,
                 miss = (from.miss[i / 64] >> (i % 64) & 1) != 0;
      if (hit) cells[i].update(scan.end(from, i).weight * params.hit, params);
      if (miss) cells[i].update(params.miss, params);
      const bool occupied = cells[i].state(params) == Occupancy::occupied;
      if (hit && occupied) scan.end(from, i).vote(votes[i]);
      if (!occupied && !votes[i].empty()) {
        ++forgotten;
        votes[i].clear();
      }
    }
  }
  CellSummary<float, kLabels> expected;
  for (std::size_t i = 0; i < 512; ++i) {
    CAPTURE(i);
    CHECK(block.log_odds(i) == cells[i].log_odds());
    CHECK(block.state(i) == cells[i].state(params));
    CHECK(block.state(i, 0) == cells[i].state(params));
    CHECK(block.labels(i) == votes[i]);
    if (cells[i].state(params) == Occupancy::unknown) continue;
    expected.observe(cells[i].log_odds());
    expected.count(votes[i]);
  }
  CHECK(summary.log_odds == expected.log_odds);
  CHECK(summary.votes == expected.votes);
  CHECK(forgotten > 100);
}
