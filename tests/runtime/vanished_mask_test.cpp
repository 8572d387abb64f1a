// SPDX-License-Identifier: BSD-3-Clause
#include <doctest/doctest.h>

#include <opencv2/core.hpp>

#include "slam/tracker_present.hpp"

using namespace dynslam::runtime;

TEST_CASE("of a mask that is gone, a piece counts, and a rim that a mover uncovers does not") {
  const TrackerOptions options;
  for (const cv::Size size : {cv::Size(640, 480), cv::Size(641, 477), cv::Size(320, 240)}) {
    CAPTURE(size.width);
    const auto part = [&](double width) {  // upright, as high as half the image
      cv::Mat mask = cv::Mat::zeros(size, CV_8UC1);
      mask(cv::Rect(size.width / 4, size.height / 4, static_cast<int>(width * size.width), size.height / 2)) =
          255;
      return mask;
    };
    const auto pieces = [&](double width, double still) {
      return vanished_pieces(part(width * options.vanished_piece), part(still * options.vanished_piece),
                             options.vanished_piece);
    };
    CHECK(pieces(0, 0).empty());
    CHECK(pieces(0.5, 0).empty());
    CHECK(pieces(3, 3).empty());
    CHECK(pieces(3, 2.5).empty());
    CHECK_FALSE(pieces(3, 1).empty());
    const cv::Mat piece = pieces(3, 0);
    REQUIRE(piece.size() == size);
    CHECK(piece.at<unsigned char>(size.height / 2, size.width / 4 + size.width / 20) == 255);
    CHECK(piece.at<unsigned char>(size.height / 2, size.width / 8) == 0);
  }
}
