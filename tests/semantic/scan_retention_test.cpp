// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/scan_retention.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

template <class S>
struct Scan {
  int number;
  SE3<S> T_w_c;
  ScanRank rank = {};
};

template <class S>
SE3<S> at(S x, S turn) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  return {SO3<S>::exp(Vector3(S(0), turn, S(0))), Vector3(x, S(0), S(0))};
}

/// The numbers of what is left.
template <class S>
std::vector<int> left(const std::vector<Scan<S>>& scans) {
  std::vector<int> numbers;
  for (const auto& scan : scans) {
    if (!scan.rank.retired) numbers.push_back(scan.number);
  }
  return numbers;
}

}  // namespace

TEST_CASE_TEMPLATE("of a view the first scan and the last ones are kept", S, float, double) {
  CHECK(same_view(at<S>(S(0), S(0)), at<S>(S(0.09), S(0.08))));
  CHECK_FALSE(same_view(at<S>(S(0), S(0)), at<S>(S(0.11), S(0))));
  CHECK_FALSE(same_view(at<S>(S(0), S(0)), at<S>(S(0), S(0.09))));
  std::vector<Scan<S>> scans;
  const auto come = [&](S x, int per_view) {
    scans.push_back({static_cast<int>(scans.size()), at<S>(x, S(0))});
    retire_scans(scans, per_view);
  };
  for (const double x : {0.0, 5.0, 0.01, 0.02, 0.03}) come(S(x), 4);
  CHECK(left(scans) == std::vector<int>{0, 1, 2, 3, 4});
  come(S(0.04), 4);
  CHECK(left(scans) == std::vector<int>{0, 1, 3, 4, 5});
  CHECK(drop_retired(scans, 2) == 0);  // those behind wait
  CHECK(drop_retired(scans, 3) == 1);
  CHECK(scans.size() == 5);
  CHECK(left(scans) == std::vector<int>{0, 1, 3, 4, 5});
  for (int k = 0; k < 5; ++k) come(S(0), 0);  // all are kept
  CHECK(left(scans).size() == 10);
}

TEST_CASE_TEMPLATE("a camera that goes about a room for ever has so many scans and no more", S, float,
                   double) {
  test::Rng rng("scan retention");
  std::vector<Scan<S>> scans;
  std::size_t then = 0;
  for (int k = 0; k < 8000; ++k) {
    scans.push_back({k, at<S>(S(rng.uniform(0.0, 1.5)), S(rng.uniform(-0.25, 0.25)))});
    retire_scans(scans, 4);
    (void)drop_retired(scans, scans.size());
    if (k == 3000) then = scans.size();
  }
  CHECK(then < 600);
  CHECK(scans.size() <= then + then / 10);
  // Each view is still there, by its first scan or by one like it.
  for (int k = 0; k < 100; ++k) {
    const SE3<S> place = at<S>(S(rng.uniform(0.0, 1.5)), S(rng.uniform(-0.25, 0.25)));
    const auto seen = std::count_if(scans.begin(), scans.end(),
                                    [&](const auto& scan) { return same_view(scan.T_w_c, place); });
    CHECK(seen >= 1);
  }
}
