// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/mask_faults.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "error_text.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

std::vector<cv::Mat> masks(const test::WalkingSequence& walking, MaskFault fault, std::uint64_t seed = 1) {
  MaskFaultOptions options;
  options.sequence = walking.path;
  options.out = walking.path / "faults";
  options.fault = fault;
  options.seed = seed;
  write_mask_faults(options, [](std::size_t, std::size_t) {});
  std::vector<cv::Mat> result;
  for (const FrameRecord& frame : load_sequence(walking.path).frames)
    result.push_back(cv::imread((options.out / (frame.stamp + ".png")).string(), cv::IMREAD_UNCHANGED));
  return result;
}

double share(const cv::Mat& mask) {
  return cv::countNonZero(mask) / static_cast<double>(mask.total());
}
bool same(const cv::Mat& a, const cv::Mat& b) {
  return cv::countNonZero(a != b) == 0;
}

}  // namespace

TEST_CASE("faulty masks are as wrong as their name says, and the same in every run") {
  const std::size_t n = 12;
  const test::WalkingSequence walking(static_cast<int>(n));
  std::filesystem::remove_all(walking.path / "dynamic_mask");
  const auto object = masks(walking, MaskFault::object_always);
  REQUIRE(object.size() == n);
  CHECK(share(object[n / 2]) == doctest::Approx(0.25).epsilon(0.1));
  CHECK(share(object[0]) > 0.1);  // it stays in the room, and so in view
  const auto third = masks(walking, MaskFault::object_third),
             half = masks(walking, MaskFault::object_second_half);
  const auto late = masks(walking, MaskFault::late), mirrored = masks(walking, MaskFault::mirrored);
  const auto shifted = masks(walking, MaskFault::shifted), cover = masks(walking, MaskFault::cover);
  const auto empty = masks(walking, MaskFault::empty);
  for (std::size_t i = 0; i < n; ++i) {
    CAPTURE(i);
    CHECK(share(third[i]) == (i % 3 == 0 ? share(object[i]) : 0));
    CHECK(share(half[i]) == (i < n / 2 ? 0 : share(object[i])));
    CHECK(same(late[i], object[i < 5 ? 0 : i - 5]));
    CHECK(same(shifted[i].colRange(40, 640), object[i].colRange(0, 600)));
    CHECK(same(mirrored[i].col(17), object[i].col(640 - 1 - 17)));
    CHECK(share(cover[i]) == doctest::Approx(0.9));
    CHECK(share(empty[i]) == 0);
  }
  const auto blobs = masks(walking, MaskFault::blobs), again = masks(walking, MaskFault::blobs);
  const auto others = masks(walking, MaskFault::blobs, 2);
  for (std::size_t i = 0; i < n; ++i) CHECK(same(blobs[i], again[i]));
  CHECK(!same(blobs[0], blobs[1]));
  CHECK(!same(blobs[0], others[0]));
  for (const auto name : kMaskFaultNames) CHECK(parse_mask_fault(name).has_value());
  CHECK(!parse_mask_fault("late ").has_value());

  (void)masks(walking, MaskFault::cover);
  const MaskShares shares = mask_shares(walking.path / "faults");
  CHECK(shares.frames == n);
  CHECK(shares.mean == doctest::Approx(0.9));
  CHECK(shares.worst == doctest::Approx(0.9));
  std::filesystem::remove(walking.path / "groundtruth.txt");
  CHECK_THROWS_AS((void)masks(walking, MaskFault::late), InputError);
}

TEST_CASE("masks for want of a true one, masks of nothing and masks that were there are counted") {
  const test::TumFixture tum(4);
  MaskFaultOptions options;
  options.sequence = tum.path;
  options.out = tum.path / "faults";
  const auto write = [&](MaskFault fault) {
    options.fault = fault;
    return write_mask_faults(options, [](std::size_t, std::size_t) {});
  };
  CHECK(write(MaskFault::object_always).no_truth);
  const std::filesystem::path truth = tum.path / "dynamic_mask";
  std::filesystem::create_directories(truth);
  const cv::Mat moves(64, 64, CV_8UC1, cv::Scalar(255));
  write_image(truth / "another.png", moves);
  CHECK(test::mentions(test::error_of([&] { (void)write(MaskFault::shifted); }),
                       "dynamic_mask: has no mask of any frame of the sequence: 1.000000.png and the like"));
  CHECK(write(MaskFault::cover).masks == 4);  // for which no true mask is needed
  write_image(truth / "1.000000.png", moves);
  write_image(options.out / "mine.png", moves);
  const MaskFaultReport report = write(MaskFault::shifted);
  CHECK(report.masks == 4);
  CHECK(report.marked == 1);
  CHECK(report.without_truth == 3);
  CHECK_FALSE(report.no_truth);
  CHECK(report.replaced == 4);
  CHECK(report.left == 1);
  CHECK(write(MaskFault::empty).marked == 0);
}
