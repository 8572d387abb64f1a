// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/frame_pipe.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "error_text.hpp"

using namespace dynslam;

namespace {

const std::string kPipeHead =
    "dynslam-frames 1\nwidth=80 height=64 fx=70 fy = 70 cx= 40  cy =32 depth_units_per_metre=1000\n";

/// A frame as docs/mask-stream.md lays it out, byte by byte.
std::string frame_bytes(std::int64_t ns, int colour_code, int depth_code, const std::string& colour,
                        const std::string& depth, const std::string& mark = "FRME") {
  std::string bytes = mark;
  for (int i = 0; i < 8; ++i) bytes += static_cast<char>(ns >> (8 * i) & 0xFF);
  bytes += static_cast<char>(colour_code);
  bytes += static_cast<char>(depth_code);
  bytes += std::string(2, '\0');
  for (const std::size_t size : {colour.size(), depth.size()})
    for (int i = 0; i < 4; ++i) bytes += static_cast<char>(size >> (8 * i) & 0xFF);
  return bytes + colour + depth;
}

std::string raw(const cv::Mat& image) {
  return {image.ptr<char>(), image.total() * image.elemSize()};
}

std::string encoded(const char* extension, const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  REQUIRE(cv::imencode(extension, image, bytes));
  return {bytes.begin(), bytes.end()};
}

struct PipeImages {
  cv::Mat bgr = cv::Mat(64, 80, CV_8UC3), grey = cv::Mat(64, 80, CV_8UC1),
          millimetres = cv::Mat(64, 80, CV_16UC1), metres = cv::Mat(64, 80, CV_32FC1);
  PipeImages() {
    cv::RNG random(7);
    for (cv::Mat* image : {&bgr, &grey, &millimetres}) random.fill(*image, cv::RNG::UNIFORM, 0, 255);
    random.fill(metres, cv::RNG::UNIFORM, 0.5, 4.0);
  }
};

bool same_pixels(const cv::Mat& a, const cv::Mat& b) {
  return a.type() == b.type() && a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0;
}

/// Why a stream is refused.
std::string pipe_refusal(const std::string& bytes) {
  std::istringstream in(bytes);
  return test::error_of([&] {
    runtime::FramePipe pipe(in, "standard input");
    while (pipe.next()) {
    }
  });
}

}  // namespace

TEST_CASE("frames of a pipe are read whatever their encoding") {
  const PipeImages images;
  cv::Mat rgb;
  cv::cvtColor(images.bgr, rgb, cv::COLOR_BGR2RGB);
  const std::int64_t t = 1305031102175304000;
  std::istringstream in(
      kPipeHead + frame_bytes(t, 0, 0, raw(images.bgr), raw(images.millimetres)) +
      frame_bytes(t + 1, 1, 1, raw(rgb), raw(images.metres)) +
      frame_bytes(t + 2, 2, 2, raw(images.grey), encoded(".png", images.millimetres)) +
      frame_bytes(t + 3, 3, 2, encoded(".png", images.bgr), encoded(".png", images.millimetres)));
  runtime::FramePipe pipe(in, "standard input");
  CHECK(pipe.camera().width == 80);
  CHECK(pipe.camera().depth_units_per_metre == 1000);
  for (int i = 0; i < 4; ++i) {
    CAPTURE(i);
    const auto frame = pipe.next();
    REQUIRE(frame.has_value());
    CHECK(frame->ns == t + i);
    CHECK(same_pixels(frame->image, i == 2 ? images.grey : images.bgr));
    CHECK(same_pixels(frame->depth, i == 1 ? images.metres : images.millimetres));
  }
  CHECK_FALSE(pipe.next().has_value());
  CHECK(pipe.frames() == 4);
  std::istringstream named("dynslam-frames 1\nfr3\n");
  CHECK(runtime::FramePipe(named, "standard input").camera().width == 640);
}

TEST_CASE("a damaged pipe is refused with the frame and the reason") {
  const PipeImages images;
  const std::string colour = raw(images.bgr), depth = raw(images.millimetres),
                    good = frame_bytes(1, 0, 0, colour, depth), png = encoded(".png", images.bgr);
  CHECK(pipe_refusal("") == "standard input: does not begin with the line 'dynslam-frames 1'");
  CHECK(test::mentions(pipe_refusal("\x89PNG\r\n"), "does not begin with"));
  CHECK(test::mentions(pipe_refusal("dynslam-frames 2\nfr3\n"),
                       "is a stream of version 2, this program reads version 1"));
  for (const char* lines : {"dynslam-frames 1\r\nfr3\r\n", "dynslam-frames 1\nfr3\r\n"})
    CHECK(test::mentions(pipe_refusal(lines),
                         "lines end in \\r\\n: the two before the frames end in \\n alone"));
  CHECK(pipe_refusal("dynslam-frames 1\nfr3") == "standard input: has no line with the camera");
  CHECK(test::mentions(pipe_refusal("dynslam-frames 1\nwidth=8 fx=x\n"), "standard input, camera:2: "));
  CHECK(pipe_refusal(kPipeHead + good) == "");
  CHECK(pipe_refusal(kPipeHead + good + good.substr(0, 10)) ==
        "standard input: frame 2: ends within the frame's head, after 10 of 24 bytes");
  CHECK(pipe_refusal(kPipeHead + good + good.substr(0, 100)) ==
        "standard input: frame 2: ends within the colour image, after 76 of 15360 bytes");
  CHECK(pipe_refusal(kPipeHead + good.substr(0, good.size() - 1)) ==
        "standard input: frame 1: ends within the depth image, after 10239 of 10240 bytes");
  CHECK(test::mentions(pipe_refusal(kPipeHead + good + frame_bytes(1, 0, 0, colour, depth, "FRMX")),
                       "frame 2: does not begin"));
  CHECK(test::mentions(pipe_refusal(kPipeHead + frame_bytes(1, 4, 0, colour, depth)),
                       "colour code 4 is none of 0 to 3"));
  CHECK(test::mentions(pipe_refusal(kPipeHead + frame_bytes(1, 0, 3, colour, depth)),
                       "depth code 3 is none of 0 to 2"));
  CHECK(test::mentions(pipe_refusal(kPipeHead + frame_bytes(1, 0, 0, colour + "x", depth)),
                       "the colour image has 15361 bytes, one of 80x64 has 15360"));
  CHECK(test::mentions(pipe_refusal(kPipeHead + frame_bytes(1, 3, 0, png.substr(0, png.size() - 8), depth)),
                       "frame 1: colour image: "));
  CHECK(test::mentions(
      pipe_refusal(kPipeHead +
                   frame_bytes(1, 3, 0, encoded(".png", cv::Mat(63, 80, CV_8UC3, cv::Scalar(0))), depth)),
      "the colour image is 80x63, the camera's images are 80x64"));
  CHECK(test::mentions(pipe_refusal(kPipeHead + frame_bytes(1, 0, 2, colour, encoded(".png", images.grey))),
                       "no PNG of one channel of 16 bits"));
  std::string huge = good;
  huge[12] = 3;
  std::memset(&huge[16], 0xFF, 4);
  CHECK(test::mentions(pipe_refusal(kPipeHead + huge), "has 4294967295 bytes, more than any image"));
}

TEST_CASE("masks are written as the page says, and a reader that is gone is an error") {
  std::FILE* file = std::tmpfile();
  REQUIRE(file != nullptr);
  runtime::MaskPipe masks(file);
  const cv::Mat mask = (cv::Mat_<std::uint8_t>(2, 3) << 0, 255, 0, 255, 0, 0);
  masks.put(0x0102030405060708, true, mask);
  std::string bytes(100, '\0');
  std::rewind(file);
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file));
  std::fclose(file);
  std::string expected = "dynslam-masks 1\nMASK\x08\x07\x06\x05\x04\x03\x02\x01";
  expected += std::string("\1\0\0\0\6\0\0\0", 8) + std::string("\0\xFF\0\xFF\0\0", 6);
  CHECK(bytes == expected);
  std::FILE* full = std::fopen("/dev/full", "wb");
  if (full == nullptr) return;
  CHECK(
      test::mentions(test::error_of([&] { runtime::MaskPipe{full}; }), "standard output: cannot be written"));
  std::fclose(full);
}
