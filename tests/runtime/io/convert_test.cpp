// SPDX-License-Identifier: BSD-3-Clause
// A sequence of any format as a TUM folder: what is read of it is what was read of the original.
#include "dynslam/runtime/io/convert.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <sstream>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "error_text.hpp"
#include "format_fixtures.hpp"

namespace {

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions, test::TemporaryFolder;
namespace fs = std::filesystem;

Sequence original_of(const test::FormatFixture& fixture) {
  SequenceOptions options;
  options.rate = test::kFilmRate;
  return load_sequence(fixture.root, options);
}

CameraConfig read_back(const CameraConfig& camera) {
  std::istringstream in(camera_text(camera));
  return parse_camera(in, "camera.txt");
}

/// Largest distance between the pixels of two cameras for the same rays [px].
double apart(const AnyCamera<double>& a, const AnyCamera<double>& b) {
  double most = 0;
  for (double x = -0.5; x <= 0.5; x += 0.125) {
    for (double y = -0.4; y <= 0.4; y += 0.1) {
      const auto p = a.project({x, y, 1}), q = b.project({x, y, 1});
      REQUIRE(p.has_value() == q.has_value());
      if (p) most = std::max(most, (*p - *q).norm());
    }
  }
  return most;
}

}  // namespace

TEST_CASE("every format becomes a TUM folder with the same images, times, camera and ground truth") {
  for (const char* name : test::kFormatNames) {
    CAPTURE(name);
    const test::FormatFixture fixture(name);
    const Sequence before = original_of(fixture);
    const CameraConfig camera = camera_of(before);
    const TemporaryFolder out;
    const ConvertReport report = convert_sequence(before, camera, out.path / "tum");
    CHECK(report.broken.empty());
    const Sequence after = load_sequence(out.path / "tum");
    CHECK(after.format == "tum");
    REQUIRE(after.frames.size() == before.frames.size());
    CHECK(report.written == before.frames.size());
    const CameraConfig written = camera_of(after);
    CHECK(apart(written.model, camera.model) == 0);
    CHECK(written.depth_units_per_metre == camera.depth_units_per_metre);
    for (std::size_t i = 0; i < after.frames.size(); ++i) {
      CHECK(std::abs(after.frames[i].t_rgb - before.frames[i].t_rgb) < 1e-6);
      CHECK(std::abs(after.frames[i].t_depth - before.frames[i].t_depth) < 1e-6);
    }
    const std::size_t k = 10;
    const RgbdFrame a = decode_frame(before.frames[k], k, camera),
                    b = decode_frame(after.frames[k], k, written);
    CHECK(cv::norm(a.bgr, b.bgr, cv::NORM_INF) == 0);
    std::size_t valid = 0, same = 0;
    for (int v = 0; v < a.depth.rows; ++v) {
      for (int u = 0; u < a.depth.cols; ++u) {
        const float y = a.depth.at<float>(v, u), z = b.depth.at<float>(v, u);
        CHECK(std::isnan(y) == std::isnan(z));
        valid += y > 0 ? 1 : 0;
        same += y > 0 && std::abs(y - z) <= 0.5F / static_cast<float>(camera.depth_units_per_metre) ? 1 : 0;
      }
    }
    CHECK(valid > a.depth.total() / 4);
    CHECK(same == valid);
    REQUIRE(after.groundtruth.size() == before.groundtruth.size());
    for (std::size_t i = 0; i < after.groundtruth.size(); ++i)
      CHECK((after.groundtruth[i].T_w_c.inverse() * before.groundtruth[i].T_w_c).log().norm() < 1e-6);
  }
}

TEST_CASE("images are scaled and frames left out on request, and the camera goes with them") {
  const test::FormatFixture fixture("tum");
  const Sequence before = original_of(fixture);
  const CameraConfig camera = camera_of(before);
  const TemporaryFolder out;
  ConvertOptions options;
  options.size = {320, 240};
  options.every = 3;
  CHECK(convert_sequence(before, camera, out.path / "half", options).written ==
        (before.frames.size() + 2) / 3);
  const Sequence after = load_sequence(out.path / "half");
  CHECK(after.frames[1].t_rgb == doctest::Approx(before.frames[3].t_rgb));
  const CameraConfig half = camera_of(after);
  CHECK(half.width == 320);
  CHECK(half.height == 240);
  // Where a point is seen: the corners of the images, at -0.5, stay corners.
  const Eigen::Vector3d p(0.2, -0.1, 1.5);
  const Eigen::Vector2d whole = *camera.model.project(p), scaled = *half.model.project(p);
  CHECK((scaled.array() + 0.5).matrix().isApprox((whole.array() + 0.5).matrix() / 2, 1e-12));
  const RgbdFrame a = decode_frame(before.frames[3], 0, camera), b = decode_frame(after.frames[1], 0, half);
  // Colour is averaged, depth is one of the four pixels.
  const cv::Vec3b mean = b.bgr.at<cv::Vec3b>(100, 150);
  cv::Vec3d sum(0, 0, 0);
  for (int k = 0; k < 4; ++k) sum += cv::Vec3d(a.bgr.at<cv::Vec3b>(200 + k / 2, 300 + k % 2));
  CHECK(cv::norm(cv::Vec3d(mean) - sum / 4) < 1.5);
  int found = 0, valid = 0;
  for (int v = 0; v < 240; ++v) {
    for (int u = 0; u < 320; ++u) {
      const float z = b.depth.at<float>(v, u);
      if (!(z > 0)) continue;
      ++valid;
      bool one = false;
      for (int k = 0; k < 4; ++k) one = one || a.depth.at<float>(2 * v + k / 2, 2 * u + k % 2) == z;
      found += one ? 1 : 0;
    }
  }
  CHECK(valid > 1000);
  CHECK(found == valid);
}

TEST_CASE("frames that cannot be read are left out and told; nothing is written over") {
  const test::FormatFixture fixture("tum");
  const Sequence sequence = original_of(fixture);
  const CameraConfig camera = camera_of(sequence);
  const TemporaryFolder out;
  std::ofstream(sequence.frames[4].rgb.string(), std::ios::binary) << "no image";
  const ConvertReport report = convert_sequence(sequence, camera, out.path / "new");
  CHECK(report.written == sequence.frames.size() - 1);
  REQUIRE(report.broken.size() == 1);
  CHECK(mentions(report.broken[0], sequence.frames[4].rgb.filename().string()));
  CHECK(load_sequence(out.path / "new").frames.size() == report.written);

  CHECK(mentions(error_of([&] { (void)convert_sequence(sequence, camera, out.path / "new"); }),
                 "is not an empty folder"));
  ConvertOptions tiny;
  tiny.size = {16, 16};
  CHECK_THROWS_AS((void)convert_sequence(sequence, camera, out.path / "tiny", tiny), UsageError);
  CHECK_FALSE(fs::exists(out.path / "tiny"));
  for (const FrameRecord& frame : sequence.frames) std::ofstream(frame.depth.string(), std::ios::binary) << "no image";
  CHECK(mentions(error_of([&] { (void)convert_sequence(sequence, camera, out.path / "broken"); }),
                 "cannot be read"));
}

TEST_CASE("depth images of one time stay several; one image of several frames stays one") {
  const test::TumFixture tum(5);
  Sequence before = load_sequence(tum.path);
  const CameraConfig camera = camera_of(before);
  for (std::size_t i = 0; i < before.frames.size(); ++i) {
    write_image(before.frames[i].depth, cv::Mat(64, 64, CV_16UC1, cv::Scalar(5000.0 + 1000.0 * double(i))));
    before.frames[i].t_depth = 0;
  }
  before.frames[1].depth = before.frames[0].depth;
  before.frames[4].t_depth = before.frames[2].t_rgb;
  const TemporaryFolder out;
  CHECK(convert_sequence(before, camera, out.path / "tum").written == 5);
  const Sequence after = load_sequence(out.path / "tum");
  REQUIRE(after.frames.size() == 5);
  const auto depth = [&](const Sequence& sequence, std::size_t i) {
    return decode_frame(sequence.frames[i], i, camera).depth.at<float>(32, 32);
  };
  for (std::size_t i = 0; i < 5; ++i) {
    CAPTURE(i);
    CHECK(depth(after, i) == depth(before, i));
    CHECK(std::abs(after.frames[i].t_depth - before.frames[i].t_depth) < 1e-6);
  }
  CHECK(after.frames[1].depth.string() == after.frames[0].depth.string());
  CHECK(std::distance(fs::directory_iterator(out.path / "tum" / "depth"), {}) == 4);
}

TEST_CASE("a camera's text reads back as the camera, lens and noise included") {
  CameraConfig camera;
  camera.name = "mine";
  camera.width = 848;
  camera.height = 480;
  const Pinhole<double> pinhole(421.3, 421.0, 424.6, 240.9);
  camera.depth_units_per_metre = 1000;
  camera.invalid_depth = 65535;
  camera.depth_time_offset = 0.019;
  camera.readout_time = 0.024;
  const AnyCamera<double> lenses[] = {
      pinhole, PinholeBrownConrady<double>(pinhole, BrownConrady<double>(-0.2, 0.1, 0.001, -0.002, 0.01)),
      PinholeBrownConrady<double>(pinhole, BrownConrady<double>(0.1, -0.2, 0.001, 0, 0.1, 0.05, -0.1, 0.02)),
      KannalaBrandt<double>(285, 286, 424.6, 240.9, {-0.005, 0.04, -0.04, 0.006})};
  for (const auto& lens : lenses) {
    camera.model = lens;
    const CameraConfig back = read_back(camera);
    CHECK(apart(back.model, lens) == 0);
    CHECK(back.name == "mine");
    CHECK(back.width == 848);
    CHECK(back.height == 480);
    CHECK(back.depth_units_per_metre == 1000);
    CHECK(back.invalid_depth == 65535);
    CHECK(back.depth_time_offset == 0.019);
    CHECK(back.readout_time == 0.024);
    CHECK_FALSE(back.depth_noise);
  }
  for (const auto& noise :
       {DepthNoise<double>::structured_light(0.002, 0.003), DepthNoise<double>::stereo(0.05, 421, 0.1),
        DepthNoise<double>::time_of_flight(0.004, 0.001)}) {
    camera.depth_noise = noise;
    CHECK(read_back(camera).depth_noise == noise);
  }
}

TEST_CASE("a camera's name never becomes a line of its file") {
  CameraConfig camera = load_camera("fr3");
  camera.name = "/camera\nk1 = 0.5\nreadout_time = 0.1";
  const CameraConfig read = read_back(camera);
  CHECK(read.model.is_ideal());
  CHECK(read.readout_time == camera.readout_time);
  CHECK(read.name.find('\n') == std::string::npos);
}
