// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/mask_reader.hpp"

#include <doctest/doctest.h>

#include <exception>
#include <string>

#include "dynslam/runtime/io/image_io.hpp"
#include "error_text.hpp"
#include "mask_files.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions, test::two_boxes;

namespace {

const cv::Size kMaskSize(64, 48);
constexpr int kBoxPixels = 16 * 12;

}  // namespace

TEST_CASE("masks of every kind are read as what they are, or refused in a line that says what is needed") {
  for (const test::MaskFiles& kind : test::every_kind_of_mask()) {
    CAPTURE(kind.name);
    const test::TemporaryFolder folder;
    for (const char* stamp : {"1", "2"}) kind.write(folder.path / (std::string(stamp) + ".png"), kMaskSize);
    int pixels = -1;
    std::string line;
    try {
      MaskOptions options;
      options.labels = kind.labels;
      MaskSource source(folder.path, options);
      const auto masks = source.read("2", kMaskSize.width, kMaskSize.height);
      pixels = cv::countNonZero(masks->dynamic);
      line = source.describe();
      CHECK(source.marked() == (pixels > 0 ? 1 : 0));
      CHECK(cv::countNonZero(masks->dynamic == 255) == pixels);
      CHECK((masks->labels.empty() || masks->labels.type() == CV_8UC1));
      CHECK(masks->labels.empty() == !masks->instances.empty());
    } catch (const std::exception& e) {
      line = e.what();
    }
    CAPTURE(line);
    if (kind.name == "a palette that begins with white") {
      CHECK(pixels == kMaskSize.area() - 2 * kBoxPixels);
    } else if (kind.name == "a soft rim") {
      CHECK(pixels > 2 * kBoxPixels - 20);
      CHECK(pixels <= 2 * kBoxPixels);
    } else {
      CHECK(pixels == (kind.boxes < 0 ? -1 : kind.boxes * kBoxPixels));
    }
    CHECK(mentions(line, kind.line));
    CHECK(line.find('\n') == std::string::npos);
  }
}

TEST_CASE(
    "one rule holds for all masks of a folder: a file alone says nothing, and one that differs is refused") {
  const test::TemporaryFolder folder;
  const auto write = [&](const char* stamp, const cv::Mat& image) {
    write_image(folder.path / (std::string(stamp) + ".png"), image);
  };
  // Only in the fourth a person; the others have a chair alone.
  for (const char* stamp : {"1", "2", "3"}) write(stamp, two_boxes(kMaskSize, CV_8UC1, 2, 2));
  write("4", two_boxes(kMaskSize, CV_8UC1, 1, 2));
  MaskSource source(folder.path);
  CHECK(cv::countNonZero(source.read("1", 64, 48)->dynamic) == 0);
  CHECK(cv::countNonZero(source.read("1", 64, 48)->labels == 2) == 2 * kBoxPixels);
  CHECK(cv::countNonZero(source.read("4", 64, 48)->dynamic) == kBoxPixels);
  CHECK(source.files() == 3);
  CHECK(source.marked() == 1);
  write("5", two_boxes(kMaskSize, CV_8UC1, 1, 200));
  CHECK(mentions(error_of([&] { (void)source.read("5", 64, 48); }),
                 "has the value 200, unlike the other masks"));
  write("6", two_boxes(kMaskSize, CV_16UC1, 1, 2));
  CHECK(mentions(error_of([&] { (void)source.read("6", 64, 48); }), "is stored as 16-bit grey, unlike"));
  write("7", cv::Mat::zeros(kMaskSize, CV_16UC1));
  CHECK(cv::countNonZero(source.read("7", 64, 48)->dynamic) == 0);  // nothing is nothing, however stored
  MaskSource mixed(folder.path);
  CHECK(mentions(error_of([&] { (void)mixed.read("1", 64, 48); }),
                 "holds masks of several kinds (8-bit grey and 16-bit grey)"));
}

TEST_CASE("what is marked in one late file alone decides, however many empty ones come before it") {
  const test::TemporaryFolder folder;
  for (int i = 10; i < 60; ++i)
    write_image(folder.path / (std::to_string(i) + ".png"),
                two_boxes(kMaskSize, CV_8UC1, 0, i == 57 ? 15 : 0));
  MaskSource source(folder.path);
  CHECK(cv::countNonZero(source.read("10", 64, 48)->dynamic) == 0);
  CHECK(mentions(source.describe(), "masks of 0 and 15"));
  CHECK(cv::countNonZero(source.read("57", 64, 48)->dynamic) == kBoxPixels);
}

TEST_CASE("masks that cannot be read are named; missing ones are counted") {
  const test::TemporaryFolder folder;
  write_image(folder.path / "1.png", two_boxes(kMaskSize, CV_8UC1, 255, 255));
  write_image(folder.path / "2.png", cv::Mat::zeros(4, 4, CV_8UC1));
  test::write_file(folder.path / "3.png", "");
  write_image(folder.path / "4.png", cv::Mat::zeros(8000, 8000, CV_8UC1));
  MaskSource source(folder.path);
  CHECK(mentions(error_of([&] { (void)source.read("2", 64, 48); }), "2.png: is 4x4, the images are 64x48"));
  CHECK(mentions(error_of([&] { (void)source.read("3", 64, 48); }), "3.png: is empty"));
  CHECK(mentions(error_of([&] { (void)source.read("4", 64, 48); }), "is 8000x8000"));
  CHECK(cv::countNonZero(source.read("1", 64, 48)->dynamic) == 2 * kBoxPixels);
  CHECK_FALSE(source.read("absent", 64, 48));
  CHECK(source.missing() == 1);
  CHECK(mentions(error_of([&] { MaskSource absent(folder.path / "absent"); }), "does not exist"));
}

TEST_CASE("the map has a label for four classes beside its own, and keeps those that it had") {
  MapClasses classes;
  CHECK(classes.add("chair") == 2);
  CHECK(classes.add("monitor") == 3);
  CHECK(classes.add("pallet") == 4);
  CHECK(classes.add("pallet") == 4);
  CHECK(classes.name(4) == "pallet");
  CHECK(classes.name(5) == "label 5");
  CHECK(with_classes(classes, {"door", "cup", "box"}).name(7) == "box");
  CHECK_THROWS_WITH_AS((void)with_classes(classes, {"a", "b", "c", "d"}),
                       doctest::Contains("no label left for the class 'd'"), UsageError);
  CHECK_THROWS_WITH_AS((void)classes.add("a\nb"), doctest::Contains("no name that is a line of text"),
                       UsageError);
  CHECK(classes.set(4, "pallet"));
  CHECK_FALSE(classes.set(4, "door"));
  CHECK_FALSE(classes.set(5, "pallet"));  // one label a class
  CHECK_FALSE(classes.set(2, "table"));
}
