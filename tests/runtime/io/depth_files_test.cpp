// SPDX-License-Identifier: BSD-3-Clause
// Depth in arrays of numpy, TIFF and OpenEXR: as numpy and OpenCV write them.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "error_text.hpp"
#include "format_fixtures.hpp"
#include "io/mask_image.hpp"

namespace {

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions, test::TemporaryFolder;
namespace fs = std::filesystem;

/// A file of numpy: head and values.
void write_array(const fs::path& file, const std::string& descr, const std::string& order,
                 const std::string& shape, const std::string& values) {
  std::string head =
      fmt::format("{{'descr': '{}', 'fortran_order': {}, 'shape': {}, }}", descr, order, shape);
  head.append(127 - 10 - head.size(), ' ');
  head += '\n';
  std::ofstream(file, std::ios::binary)
      << std::string("\x93NUMPY\x01\x00", 8) << static_cast<char>(head.size()) << '\0' << head << values;
}

template <class Value>
std::string bytes_of(std::initializer_list<Value> values) {
  return {reinterpret_cast<const char*>(values.begin()), values.size() * sizeof(Value)};
}

std::string error_of_reading(const fs::path& file) {
  return error_of([&] { (void)read_image(file, cv::IMREAD_UNCHANGED); });
}

}  // namespace

TEST_CASE("arrays of numpy are read in the types that depth comes in") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "d.npy";
  write_array(file, "<f4", "False", "(2, 3)", bytes_of({1.F, 2.F, 3.F, 4.F, 5.F, 6.F}));
  const cv::Mat floats = read_image(file, cv::IMREAD_UNCHANGED);
  REQUIRE(floats.type() == CV_32FC1);
  REQUIRE(floats.size() == cv::Size(3, 2));
  CHECK(floats.at<float>(1, 0) == 4);
  write_array(file, "<f8", "True", "(2, 3, 1)", bytes_of({1., 4., 2., 5., 3., 6.}));
  CHECK(cv::norm(read_image(file, cv::IMREAD_UNCHANGED), floats, cv::NORM_INF) == 0);
  write_array(file, "<f2", "False", "(1, 2)", bytes_of<std::uint16_t>({0x3C00, 0x4200}));  // 1 and 3
  const cv::Mat halves = read_image(file, cv::IMREAD_UNCHANGED);
  REQUIRE(halves.type() == CV_32FC1);
  CHECK(halves.at<float>(0, 1) == 3);
  write_array(file, "<u2", "False", "(1, 2)", bytes_of<std::uint16_t>({500, 65535}));
  const cv::Mat whole = read_image(file, cv::IMREAD_UNCHANGED);
  REQUIRE(whole.type() == CV_16UC1);
  CHECK(whole.at<std::uint16_t>(0, 1) == 65535);
}

TEST_CASE("an array that is no depth image is one error that says what it holds") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "d.npy";
  const auto error = [&](const char* descr, const char* shape, const std::string& values) {
    write_array(file, descr, "False", shape, values);
    return error_of_reading(file);
  };
  const std::string six = bytes_of({1.F, 2.F, 3.F, 4.F, 5.F, 6.F});
  CHECK(mentions(error("<f4", "(2, 4)", six), "d.npy: is truncated"));
  CHECK(mentions(error(">f4", "(2, 3)", six), "holds numbers of type '>f4'"));
  CHECK(mentions(error("|O", "(2, 3)", six), "holds numbers of type '|O'"));
  CHECK(mentions(error("<f4", "(6,)", six), "has the shape (6,)"));
  CHECK(mentions(error("<f4", "(1, 2, 3)", six), "has the shape (1, 2, 3)"));
  CHECK(mentions(error("<f4", "(9999, 9999)", six), "is truncated"));
  CHECK(mentions(error("<f4", "(-2, 3)", six), "has the shape"));
  std::ofstream(file, std::ios::binary) << std::string("\x93NUMPY\x01\x00\xFF\xFF", 10);
  CHECK(mentions(error_of_reading(file), "is truncated"));
}

TEST_CASE("a background at infinity, most of the image, does not take depth in metres for millimetres") {
  const TemporaryFolder folder;
  const fs::path root = folder.path / "s";
  for (const char* name : {"color", "depth"}) fs::create_directories(root / name);
  write_image(root / "color" / "0.png", cv::Mat(64, 64, CV_8UC3, cv::Scalar::all(90)));
  cv::Mat depth(64, 64, CV_32FC1, cv::Scalar(std::numeric_limits<double>::infinity()));
  depth.rowRange(50, 64) = 2;
  test::write_npy(root / "depth" / "0.npy", depth);
  const Sequence sequence = load_sequence(root);
  REQUIRE(sequence.frames.size() == 1);
  CHECK_FALSE(sequence.frames[0].float_units);
  CHECK(sequence.notes.empty());
}

TEST_CASE("a mask of shares is dynamic from one half on") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "m.npy";
  write_array(file, "<f4", "False", "(1, 4)", bytes_of({0.F, 0.49F, 0.5F, 1.F}));
  const cv::Mat values = read_mask_image(EncodedImage(file), false).values;
  REQUIRE(values.type() == CV_8UC1);
  CHECK(cv::countNonZero(values) == 2);
  CHECK(values.at<std::uint8_t>(0, 2) == 255);
}

TEST_CASE("TIFF and OpenEXR files of floats are what OpenCV wrote, and promise no size beyond reason") {
  const TemporaryFolder folder;
  cv::Mat depth(48, 64, CV_32FC1);
  cv::randu(depth, 0.3, 5);
  for (const char* name : {"d.tiff", "d.exr"}) {
    CAPTURE(name);
    const fs::path file = folder.path / name;
    if (!cv::imwrite(file.string(), depth)) continue;  // an OpenCV without OpenEXR
    CHECK(EncodedImage(file).size() == depth.size());
    const cv::Mat read = read_image(file, cv::IMREAD_UNCHANGED);
    REQUIRE(read.type() == CV_32FC1);
    CHECK(cv::norm(read, depth, cv::NORM_INF) == 0);
    std::string content = read_file(file);
    std::ofstream(file, std::ios::binary) << content.substr(0, content.size() / 2);
    CHECK_FALSE(error_of_reading(file).empty());
  }
}

TEST_CASE("a TIFF that cannot be depth is one line with the reason, none of OpenCV's") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "d.tiff";
  const auto error = [&](const cv::Mat& image, std::size_t cut = 0) {
    REQUIRE(cv::imwrite(file.string(), image, {cv::IMWRITE_TIFF_COMPRESSION, 1}));
    if (cut > 0) fs::resize_file(file, fs::file_size(file) - cut);
    return error_of_reading(file);
  };
  CHECK(mentions(error(cv::Mat(48, 64, CV_16SC1, cv::Scalar(900))), "d.tiff: has signed numbers of 16 bits"));
  CHECK(mentions(error(cv::Mat(48, 64, CV_32SC1, cv::Scalar(900))), "d.tiff: has signed numbers of 32 bits"));
  CHECK(error(cv::Mat(48, 64, CV_16UC1, cv::Scalar(900))).empty());
  CHECK(error(cv::Mat(48, 64, CV_8UC3, cv::Scalar(9, 8, 7))).empty());
  // libtiff writes the directory first where the strips are known, or at the end.
  std::string content = read_file(file);
  std::string strips_far = content;
  REQUIRE(content.substr(0, 2) == "II");
  for (std::size_t at = 8; at + 12 <= content.size(); ++at) {  // tag 273, StripOffsets, of type LONG or SHORT
    if (content[at] == '\x11' && content[at + 1] == '\x01' &&
        (content[at + 2] == 3 || content[at + 2] == 4) && content[at + 3] == 0) {
      for (std::size_t k = 8; k < 12; ++k) strips_far[at + k] = '\x7F';
    }
  }
  REQUIRE(strips_far != content);
  std::ofstream(file, std::ios::binary) << strips_far;
  CHECK(mentions(error_of_reading(file), "d.tiff: is truncated"));
}

TEST_CASE("depth whose bytes are the channels of a PNG is in metres, and another image is one error") {
  test::FormatFixture fixture("tartanair-2");
  const fs::path file = fixture.root / "depth_lcam_front" / "000000_lcam_front_depth.png";
  const Sequence sequence = load_sequence(fixture.root);
  const CameraConfig camera = camera_of(sequence);
  // IEEE 754: 2.5 = 0x40200000, 1.1 = 0x3F8CCCCD, -1 = 0xBF800000, infinity = 0x7F800000.
  cv::Mat bgra(640, 640, CV_8UC4, cv::Scalar(0x00, 0x00, 0x20, 0x40));
  bgra.at<cv::Vec4b>(3, 4) = {0xCD, 0xCC, 0x8C, 0x3F};
  bgra.at<cv::Vec4b>(3, 5) = {0x00, 0x00, 0x80, 0xBF};
  bgra.at<cv::Vec4b>(3, 6) = {0x00, 0x00, 0x80, 0x7F};
  REQUIRE(cv::imwrite(file.string(), bgra));
  const cv::Mat depth = decode_frame(sequence.frames[0], 0, camera).depth;
  REQUIRE(depth.type() == CV_32FC1);
  CHECK(depth.at<float>(0, 0) == 2.5F);
  CHECK(depth.at<float>(639, 639) == 2.5F);
  CHECK(depth.at<float>(3, 4) == 1.1F);
  CHECK(std::isnan(depth.at<float>(3, 5)));
  CHECK(std::isnan(depth.at<float>(3, 6)));

  const auto error = [&](const cv::Mat& image) {
    REQUIRE(cv::imwrite(file.string(), image));
    return error_of([&] { (void)decode_frame(sequence.frames[0], 0, camera); });
  };
  const std::string expected =
      "000000_lcam_front_depth.png: is not an image of four 8-bit channels, the bytes of a float, ";
  CHECK(mentions(error(cv::Mat(640, 640, CV_16UC1, cv::Scalar(900))),
                 expected + "but has 16 bits and 1 channel"));
  CHECK(mentions(error(cv::Mat(640, 640, CV_8UC3, cv::Scalar::all(9))),
                 expected + "but has 8 bits and 3 channels"));
  CHECK(mentions(error(cv::Mat(480, 640, CV_8UC4, cv::Scalar::all(9))),
                 "is 640x480, the camera's images are 640x640"));
}

TEST_CASE("a folder that has the images of no version of TartanAir says which are looked for") {
  const TemporaryFolder folder;
  SequenceOptions options;
  options.format = "tartanair";
  CHECK(mentions(error_of([&] { (void)load_sequence(folder.path, options); }),
                 "has no images of this format: image_left/ and depth_left/, or image_lcam_front/ and "
                 "depth_lcam_front/"));
}

TEST_CASE("numbered depth of floats is in metres, whatever holds it; 0 and infinite are none") {
  const TemporaryFolder folder;
  const fs::path root = folder.path / "s";
  for (const char* name : {"color", "depth"}) fs::create_directories(root / name);
  std::ofstream(root / "camera.txt") << "width = 64\nheight = 64\nfx = 60\nfy = 60\ncx = 32\ncy = 32\n";
  std::ofstream truth(root / "groundtruth.txt");
  for (int i = 0; i < 3; ++i) {
    write_image(root / "color" / fmt::format("frame_{:05}.png", i),
                cv::Mat(64, 64, CV_8UC3, cv::Scalar::all(90)));
    cv::Mat depth(64, 64, CV_32FC1, cv::Scalar(1.5 + i));
    depth.at<float>(0, 0) = 0;
    depth.at<float>(0, 1) = INFINITY;
    test::write_npy(root / "depth" / fmt::format("frame_{:05}.npy", i), depth);
    truth << i << " " << i << " 0 0 0 0 0 1\n";
  }
  truth.close();
  SequenceOptions options;
  options.rate = 10;
  const Sequence sequence = load_sequence(root, options);
  REQUIRE(sequence.frames.size() == 3);
  CHECK(sequence.float_depth);
  const RgbdFrame frame = decode_frame(sequence.frames[1], 1, camera_of(sequence));
  CHECK(frame.depth.at<float>(20, 20) == 2.5F);
  CHECK(std::isnan(frame.depth.at<float>(0, 0)));
  CHECK(std::isnan(frame.depth.at<float>(0, 1)));
  // TUM's list beside them counts frames.
  REQUIRE(sequence.groundtruth.size() == 3);
  CHECK(sequence.groundtruth[2].t == doctest::Approx(0.2));
}
