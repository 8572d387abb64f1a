// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/interop/octomap.hpp"

#include <doctest/doctest.h>

using namespace dynslam;

TEST_CASE("a log-odds cell and an OctoMap node agree on the same measurements") {
  const LogOddsParams<float> params;
  octomap::ColorOcTree tree(0.1);
  interop::set_parameters(tree, params);
  const octomap::point3d p(0.25F, -0.35F, 1.05F);
  CHECK(interop::occupancy(tree, p) == Occupancy::unknown);
  LogOddsCell<float> cell;
  for (const bool hit : {true,  false, false, true,  true,  true,  true,  true,  true,  false,
                         false, false, false, false, false, false, false, false, false, false}) {
    tree.updateNode(p, hit);
    cell.update(hit ? params.hit : params.miss, params);
    CHECK(static_cast<double>(tree.search(p)->getLogOdds()) ==
          doctest::Approx(static_cast<double>(cell.log_odds())).epsilon(1e-5));
    CHECK(interop::occupancy(tree, p) == cell.state(params));
  }
}

TEST_CASE("points convert to single precision without a swap") {
  const auto p = interop::to_octomap(Eigen::Vector3d(1, 2, 3));
  CHECK(p.x() == 1.0F);
  CHECK(p.y() == 2.0F);
  CHECK(p.z() == 3.0F);
}
