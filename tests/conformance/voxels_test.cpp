// SPDX-License-Identifier: BSD-3-Clause
#include "voxels.hpp"

#include "dynslam/semantic/cell_tree.hpp"
#include "dynslam/semantic/log_odds.hpp"
#include "dynslam/semantic/scan_retention.hpp"
#include "dynslam/semantic/voxel.hpp"
#include "dynslam/semantic/voxel_block.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"

using namespace dynslam;

namespace {

test::Record<double> reference() {
  VoxelBlockMap<double> map{VoxelGrid(0.1)};
  return test::store_results<double>(map);
}

}  // namespace

TEST_CASE_TEMPLATE("every store answers every question, with any number of labels", Store,
                   VoxelBlockMap<float>, VoxelBlockMap<double>, VoxelBlockMap<float, 1>,
                   VoxelBlockMap<double, 80>, VoxelBlockMap<float, 256>, test::ListStore) {
  Store by_doubles{VoxelGrid(0.1)}, by_floats{VoxelGrid(0.1)};
  test::check_same(test::store_results<double>(by_doubles), reference(), 1e-12);
  test::check_same(test::store_results<float>(by_floats), reference(), 1e-5);
}

TEST_CASE_TEMPLATE("a keyframe of any camera becomes a scan and voxels", Camera,
                   DYNSLAM_CONFORMANCE_CAMERAS) {
  static const auto expected = test::scan_results<Pinhole<double>, double>();
  test::check_same(test::scan_results<Camera, float>(), expected, 0);
  test::check_same(test::scan_results<Camera, double>(), expected, 0);
}

TEST_CASE_TEMPLATE("of one view three scans are kept where three are allowed", S, float, double) {
  struct Scan {
    SE3<S> T_w_c;
    ScanRank rank;
  };
  std::vector<Scan> scans;
  for (int k = 0; k < 5; ++k) {
    scans.emplace_back();
    retire_scans(scans, 3);
    (void)drop_retired(scans, scans.size());
  }
  CHECK(scans.size() == 3);
}

TEST_CASE_TEMPLATE("voxels and their summaries count alike", S, float, double) {
  const LogOddsParams<S> params;
  LogOddsCell<S> cell;
  CHECK(cell.state(params) == Occupancy::unknown);
  cell.update(params.hit, params);
  CHECK(static_cast<double>(cell.probability()) == doctest::Approx(0.7).epsilon(1e-6));
  CHECK(static_cast<double>(bayes_update(S(0.7), S(0.5), S(0.5))) == doctest::Approx(0.7).epsilon(1e-6));
  CHECK(static_cast<double>(log_odds_to_probability(probability_to_log_odds(S(0.3)))) ==
        doctest::Approx(0.3).epsilon(1e-6));
  const auto count = [&]<std::size_t N>() {
    SemanticVoxel<S, N> voxel;
    voxel.hit(0, params);
    voxel.hit(static_cast<std::uint8_t>(N - 1), params);
    voxel.miss(params);
    CHECK(voxel.labels.total() == 2);
    CellSummary<S, N> summary, above;
    summary.observe(voxel.occupancy.log_odds());
    summary.count(voxel.labels);
    above.add(summary);
    CHECK(above.occupied(params));
    CHECK(above.describe(params).state == Occupancy::occupied);
    CellTree<S, N> tree;
    const VoxelKey key{{32768, 32768, 32768}};
    {
      typename CellTree<S, N>::Update update(tree);
      update.leaf(key).summary = summary;
      update.finish();
    }
    CHECK(tree.find(key, 5) != nullptr);
    BasicScanVoxels<N> scan{VoxelGrid(1.0)};
    scan.add_end(key, static_cast<std::uint16_t>(N - 1), {});
    scan.finish();
    VoxelBlock<S, N> block;
    CellSummary<S, N> of_block;
    std::vector<LabelHistogram<N>> scratch;
    block.fuse(scan, scan.block(scan.order()[0]), params, of_block, scratch);
    CHECK(block.state(0) == Occupancy::occupied);
    CHECK(block.summary(0, 2).votes == of_block.votes);
    LabelHistogram<N> labels(std::array<std::uint8_t, N>{});
    labels.add(0, 3);
    labels.merge(voxel.labels);
    CHECK(labels.top() == 0);
    CHECK(labels.confidence() > 0.5);
  };
  count.template operator()<1>();
  count.template operator()<8>();
  count.template operator()<80>();
  count.template operator()<256>();
}
