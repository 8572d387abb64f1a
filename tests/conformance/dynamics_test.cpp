// SPDX-License-Identifier: BSD-3-Clause
#include "dynamics.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("what moves is found in every kind of image alike", Kind, test::ViewKind, test::PlainKind,
                   test::RowMajorKind, test::ColumnMajorKind) {
  static double expected_share = 0;
  static const auto expected =
      test::segmenter_results<test::OwnedKind, Pinhole<float>>(MotionMethod::full, expected_share);
  double share = 0;
  test::check_same(test::segmenter_results<Kind, Pinhole<float>>(MotionMethod::full, share), expected, 0);
  CHECK(share == expected_share);
  test::check_same(test::weight_results<Kind, Pinhole<float>>(),
                   test::weight_results<test::OwnedKind, Pinhole<float>>(), 0);
  int by_belief = 0, by_regions = 0, cells = 0;
  test::check_same(test::belief_results<Kind, Pinhole<float>>(by_belief, by_regions, cells),
                   test::belief_results<test::OwnedKind, Pinhole<float>>(by_belief, by_regions, cells), 0);
}

TEST_CASE_TEMPLATE("what moves is found through every camera, in float and double", Camera,
                   DYNSLAM_CONFORMANCE_EACH_CAMERA) {
  double share = 0;
  (void)test::segmenter_results<test::OwnedKind, Camera>(MotionMethod::full, share);
  CHECK(share > 0.4);
  const auto weights = test::weight_results<test::OwnedKind, Camera>();
  double right = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) right += weights.value(i);
  CHECK(right >= 0.95 * static_cast<double>(weights.size()));
  int by_belief = 0, by_regions = 0, cells = 0;
  (void)test::belief_results<test::OwnedKind, Camera>(by_belief, by_regions, cells);
  CHECK(by_belief > 0.5 * cells);
  CHECK(by_regions > 0.2 * cells);  // keypoints beside edges start no region
}
