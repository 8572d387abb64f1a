// SPDX-License-Identifier: BSD-3-Clause
// Files of cameras: dynslam's own, ROS' and OpenCV's, and what is wrong with them.
#include <doctest/doctest.h>

#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/persistence.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "error_text.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions;

namespace {

CameraConfig camera_of_text(const std::string& text) {
  std::istringstream in(text);
  return parse_camera(in, "c");
}
std::string camera_error(const std::string& text) {
  return error_of([&] { (void)camera_of_text(text); });
}

const std::string kOwn = "width = 640\nheight = 480\nfx = 500\nfy = 505\ncx = 320\ncy = 240\n";

/// What camera_calibration and camera drivers write.
std::string ros(const std::string& model, const std::string& coefficients, int count) {
  return "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
         "  data: [500.0, 0.0, 320.0,\n         0.0, 505.0, 240.0,\n         0.0, 0.0, 1.0]\n"
         "distortion_model: " +
         model + "\ndistortion_coefficients:\n  rows: 1\n  cols: " + std::to_string(count) + "\n  data: [" +
         coefficients +
         "]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
         "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [400, 0, 300, 0, 0, 400, 200, 0, 0, 0, 1, 0]\n";
}

void check_intrinsics(const CameraConfig& camera) {
  CHECK(camera.width == 640);
  CHECK(camera.height == 480);
  CHECK(camera.model.pinhole() == Pinhole<double>(500, 505, 320, 240));
}

}  // namespace

TEST_CASE("a file of one's own names the lens' model, and only the coefficients that it has") {
  const CameraConfig plain = camera_of_text(kOwn);
  check_intrinsics(plain);
  CHECK(plain.model.is_ideal());
  CHECK(plain.depth_units_per_metre == 5000);
  CHECK(plain.name == "c");
  CHECK(camera_of_text(kOwn + "name = \"head\" # of a robot\n").name == "head");
  const std::string five = "k1 = -0.2\nk2 = 0.05\np1 = 0.001\np2 = -0.002\nk3 = 0.01\n";
  const BrownConrady<double> lens(-0.2, 0.05, 0.001, -0.002, 0.01);
  CHECK(camera_of_text(kOwn + five).model.brown_conrady()->coefficients() == lens.coefficients());
  CHECK(camera_of_text(kOwn + five + "model = brown_conrady\n").model.brown_conrady()->coefficients() ==
        lens.coefficients());
  const auto eight = camera_of_text(kOwn + five + "model = rational\nk4 = 0.3\nk5 = 0.2\nk6 = 0.1\n");
  CHECK(eight.model.brown_conrady()->coefficients() ==
        BrownConrady<double>(-0.2, 0.05, 0.001, -0.002, 0.01, 0.3, 0.2, 0.1).coefficients());
  const auto fisheye =
      camera_of_text(kOwn + "model = kannala_brandt\nk1 = -0.02\nk2 = 0.005\nk3 = -0.002\nk4 = 0.0003\n");
  check_intrinsics(fisheye);
  REQUIRE(fisheye.model.kannala_brandt() != nullptr);
  CHECK(fisheye.model.kannala_brandt()->coefficients() == Eigen::Vector4d(-0.02, 0.005, -0.002, 0.0003));
  CHECK(camera_of_text(kOwn + "model = pinhole\n").model.is_ideal());

  CHECK(camera_error(kOwn + "model = fov\n") ==
        "c: model 'fov' is none of pinhole, brown_conrady, rational, kannala_brandt");
  // Four coefficients of a fisheye or a fraction's: nothing is guessed.
  CHECK(camera_error(kOwn + "k1 = 0.1\nk4 = 0.1\n") ==
        "c: 'k4' is not a number of model brown_conrady: say model = rational or model = kannala_brandt");
  CHECK(mentions(camera_error(kOwn + "model = kannala_brandt\np1 = 0\n"),
                 "'p1' is not a number of model kannala"));
  CHECK(mentions(camera_error(kOwn + "model = pinhole\nk1 = 0\n"), "'k1' is not a number of model pinhole"));
  // A fisheye's numbers with the model forgotten: most of the image would be nowhere.
  CHECK(mentions(camera_error(kOwn + "k1 = -40\n"),
                 "% of the image without a viewing ray: wrong coefficients"));
  // r / (1 + ...) that creeps towards the rim: rays of 89 degrees.
  CHECK(mentions(
      camera_error("width = 640\nheight = 480\nfx = 200\nfy = 200\ncx = 320\ncy = 240\nmodel = rational\n"
                   "k1 = 0.02\nk4 = 1\nk5 = 0.02\n"),
      "c: the distortion l"));
}

TEST_CASE("ROS' camera_info is read with each of its models, in millimetres") {
  const CameraConfig camera = camera_of_text(ros("plumb_bob", "-0.2, 0.05, 0.001, -0.002, 0.01", 5));
  check_intrinsics(camera);  // of the raw image, not of the projection matrix
  CHECK(camera.name == "head");
  CHECK(camera.depth_units_per_metre == 1000);
  CHECK(camera.invalid_depth == 0);
  CHECK(camera.model.brown_conrady()->coefficients() ==
        BrownConrady<double>(-0.2, 0.05, 0.001, -0.002, 0.01).coefficients());
  const auto rational =
      camera_of_text(ros("rational_polynomial", "-0.2, 0.05, 1e-3, -2.0e-03, 0.01, .3, 0.2, 0.1", 8));
  CHECK(rational.model.brown_conrady()->coefficients() ==
        BrownConrady<double>(-0.2, 0.05, 0.001, -0.002, 0.01, 0.3, 0.2, 0.1).coefficients());
  const auto fisheye = camera_of_text(ros("equidistant", "-0.02, 0.005, -0.002, 0.0003", 4));
  REQUIRE(fisheye.model.kannala_brandt() != nullptr);
  CHECK(fisheye.model.kannala_brandt()->coefficients() == Eigen::Vector4d(-0.02, 0.005, -0.002, 0.0003));
  CHECK(camera_of_text(ros("plumb_bob", "0, 0, 0, 0, 0, 0, 0, 0", 8)).model.is_ideal());

  // What the file cannot say otherwise, beside it.
  const auto more = camera_of_text(ros("plumb_bob", "0, 0, 0, 0", 4) +
                                   "depth_units_per_metre: 4000  # of this driver\ninvalid_depth: 65535\n"
                                   "depth_time_offset: 0.02\nreadout_time: -0.02\n"
                                   "depth_noise: time_of_flight\n"
                                   "depth_noise_base: 0.002\ndepth_noise_linear: 0.001\n");
  CHECK(more.depth_units_per_metre == 4000);
  CHECK(more.invalid_depth == 65535);
  CHECK(more.depth_time_offset == 0.02);
  CHECK(more.readout_time == -0.02);
  REQUIRE(more.depth_noise);
  CHECK(*more.depth_noise == DepthNoise<double>::time_of_flight(0.002, 0.001));
}

TEST_CASE("messages as ROS 1 and ROS 2 print them are cameras, too") {
  const CameraConfig one = camera_of_text(
      "header: \n  seq: 12\n  stamp: \n    secs: 7\n    nsecs: 5\n  frame_id: \"camera: left\"\n"
      "height: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\nD: [-0.2, 0.05, 0.001, -0.002, 0.01]\n"
      "K: [500.0, 0.0, 320.0, 0.0, 505.0, 240.0, 0.0, 0.0, 1.0]\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
      "binning_x: 0\nbinning_y: 0\nroi: \n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n"
      "  do_rectify: False\n---\nheight: 1\n");
  check_intrinsics(one);
  CHECK(one.model.brown_conrady()->coefficients()(4) == 0.01);
  const CameraConfig two = camera_of_text(
      "---\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\nd:\n- -0.2\n- 0.05\n- 0.001\n- -0.002\n- "
      "0.01\n"
      "k:\n- 500.0\n- 0.0\n- 320.0\n- 0.0\n- 505.0\n- 240.0\n- 0.0\n- 0.0\n- 1.0\n");
  check_intrinsics(two);
  CHECK(two.model.brown_conrady()->coefficients() == one.model.brown_conrady()->coefficients());
}

TEST_CASE("what cv::FileStorage writes is read, YAML and XML") {
  const cv::Mat K = (cv::Mat_<double>(3, 3) << 500, 0, 320, 0, 505, 240, 0, 0, 1);
  for (const char* ending : {".yml", ".xml"}) {
    CAPTURE(ending);
    const auto written = [&](const cv::Mat& d, bool fisheye) {
      cv::FileStorage out(ending, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
      out << "calibration_time"
          << "Tue 01 Jan 2030 10:00:00"
          << "image_width" << 640 << "image_height" << 480;
      out << "flags" << 0 << "views"
          << "["
          << "a.png"
          << "b.png"
          << "]";
      out.writeComment("of a chessboard: 9 x 6");
      if (fisheye) out << "fisheye_model" << 1;
      out << "camera_matrix" << K << "distortion_coefficients" << d << "avg_reprojection_error" << 0.25;
      out << "invalid_depth" << 65535;
      return camera_of_text(out.releaseAndGetString());
    };
    const CameraConfig five = written((cv::Mat_<double>(5, 1) << -0.2, 0.05, 0.001, -0.002, 1e-7 / 3), false);
    check_intrinsics(five);
    CHECK(five.model.brown_conrady()->coefficients() ==
          BrownConrady<double>(-0.2, 0.05, 0.001, -0.002, 1e-7 / 3).coefficients());
    CHECK(five.invalid_depth == 65535);
    CHECK(five.depth_units_per_metre == 1000);
    const cv::Mat many = (cv::Mat_<double>(1, 8) << -0.2, 0.05, 0.001, -0.002, 0.01, 0.3, 0.2, 0.1);
    CHECK(written(many, false).model.brown_conrady()->is_rational());
    const CameraConfig fisheye = written((cv::Mat_<double>(4, 1) << -0.02, 0.005, -0.002, 0.0003), true);
    REQUIRE(fisheye.model.kannala_brandt() != nullptr);
    CHECK(fisheye.model.kannala_brandt()->coefficients() == Eigen::Vector4d(-0.02, 0.005, -0.002, 0.0003));
    // Four without a word are two radial and two tangential, as in all of OpenCV but cv::fisheye.
    const CameraConfig four = written((cv::Mat_<double>(4, 1) << -0.02, 0.005, -0.002, 0.0003), false);
    REQUIRE(four.model.brown_conrady() != nullptr);
    CHECK(four.model.brown_conrady()->coefficients()(2) == -0.002);
  }
}

TEST_CASE("what is wrong with a calibration file is said in one line, with its place") {
  const std::string good = ros("plumb_bob", "0, 0, 0, 0, 0", 5);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const auto at = text.find(from);
    REQUIRE(at != std::string::npos);
    return camera_error(text.replace(at, from.size(), to));
  };
  CHECK(camera_error(good).empty());
  CHECK(changed("image_width: 640\n", "") == "c: 'width' is missing");
  CHECK(changed("image_width: 640", "image_width: wide") ==
        "c:1: 'wide' of image_width is not a finite number");
  CHECK(changed("image_width: 640", "image_width: [640, 480]") == "c:1: image_width is not one number");
  CHECK(changed("camera_matrix", "matrix") == "c: 'camera_matrix' (or 'K') is missing");
  CHECK(changed("0.0, 0.0, 1.0]\nd", "0.0, 1.0]\nd") == "c:7: camera_matrix.data has 8 numbers, not 9");
  CHECK(changed("data: [500.0, 0.0,", "data: [500.0, 3.0,") ==
        "c:7: camera_matrix.data is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  CHECK(changed("data: [500.0", "data: [0.0") == "c: fx and fy must be positive");  // not calibrated
  CHECK(changed("data: [500.0", "data: [1e300") ==
        "c: fx and fy must be at most a thousand widths of the image");
  CHECK(changed("plumb_bob", "double_sphere") ==
        "c:10: distortion_model 'double_sphere' is none of plumb_bob, rational_polynomial, equidistant, "
        "fisheye");
  CHECK(changed("0, 0, 0, 0, 0]", "0, 0, 0, 0, 0, 0.5]") ==
        "c:14: distortion_coefficients.data has 6 coefficients, brown_conrady takes 5");
  CHECK(changed("0, 0, 0, 0, 0]", "0, 0, 0, 0, .nan]") ==
        "c:14: '.nan' of distortion_coefficients.data is not a finite number");
  CHECK(changed("1.0]\nd", "1.0\nd") != "");
  CHECK(changed("image_height", "  tall\nimage_height") == "c:2: expected 'key: value'");
  CHECK(changed("  rows: 3", "\trows: 3") == "c:5: tabs cannot indent YAML");
  CHECK(camera_error(good + "depth_unit: 1000\n") == "c:23: unknown key 'depth_unit'");
  CHECK(camera_error(good + "invalid_depth: 1\ninvalid_depth: 2\n") == "c:24: 'invalid_depth' once more");
  CHECK(camera_error(kOwn + "fx = 501\n") == "c:7: 'fx' once more");
  CHECK(camera_error(good + "binning_x: 2\n") ==
        "c:23: binning_x is 2: write the camera of the images as they are, without binning or region of "
        "interest");
  CHECK(camera_error(good + "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n") ==
        "c:23: 'K' once more, after 'camera_matrix.data' in line 7");
  CHECK(camera_error("%YAML:1.0\n- 3\n") == "c:2: a list without a name");
  CHECK(camera_error("a: [1, 2\nb: 3\n") == "c:1: the bracket that opens here is not closed");
  CHECK(camera_error("a: [1] 2\n") == "c:1: expected the end of the line behind the bracket");
  CHECK(camera_error("a: [\"1]\n") == "c:1: a quote is not closed");
  CHECK(camera_error("<opencv_storage>\n<a>1</b>\n") == "c:2: </b> closes what is not open");
  CHECK(camera_error("<opencv_storage>\n<a>1") == "c:2: <a> is not closed");
  CHECK(camera_error("<opencv_storage>\n<a") == "c:2: '>' is missing behind this");
  CHECK(camera_error("<opencv_storage></opencv_storage>") == "c: 'camera_matrix' (or 'K') is missing");
  // However deep values are nested, the stack does not grow.
  std::string deep = "<opencv_storage>", indented;
  for (int k = 0; k < 100000; ++k) deep += "<a>";
  for (std::size_t k = 0; k < 50; ++k) indented += std::string(k, ' ') + "a:\n";
  CHECK(camera_error(deep) == "c:1: is nested too deep for a calibration");
  CHECK(camera_error(indented) == "c:33: is nested too deep for a calibration");
  CHECK(camera_error("a: " + std::string(100000, '[')) == "c:1: the bracket that opens here is not closed");
}

TEST_CASE("depth noise of a camera is one of three models with its numbers") {
  const auto noise = [](const std::string& text) { return camera_of_text(kOwn + text).depth_noise; };
  CHECK_FALSE(noise(""));
  REQUIRE(noise("depth_noise = structured_light\n"));
  CHECK(*noise("depth_noise = structured_light\n") == DepthNoise<double>());
  CHECK(noise("depth_noise = structured_light\ndepth_noise_base = 0.002\ndepth_noise_quad = 0.003\n")
            ->sigma(2) == doctest::Approx(0.014));
  // 5 cm between the imagers, 500 px: a tenth of a pixel is 16 mm at 2 m.
  CHECK(noise("depth_noise = stereo\nbaseline = 0.05\ndisparity_noise = 0.1\ndepth_noise_base = 0.001\n")
            ->sigma(2) == doctest::Approx(0.001 + 0.016));
  CHECK(
      noise("depth_noise = stereo\nbaseline = 0.05\ndisparity_noise = 0.1\nstereo_focal = 250\n")->sigma(2) ==
      doctest::Approx(0.001 + 0.032));
  CHECK(noise("depth_noise = time_of_flight\ndepth_noise_base = 0.005\ndepth_noise_linear = 0.001\n")
            ->sigma(3) == doctest::Approx(0.008));
  const auto wrong = [](const std::string& text) { return camera_error(kOwn + text); };
  CHECK(wrong("depth_noise = laser\n") ==
        "c: depth_noise 'laser' is none of structured_light, stereo, time_of_flight");
  CHECK(wrong("baseline = 0.05\n") ==
        "c: 'baseline' needs depth_noise = structured_light, stereo or time_of_flight");
  CHECK(wrong("depth_noise = stereo\nbaseline = 0.05\n") == "c: 'disparity_noise' is missing");
  CHECK(wrong("depth_noise = stereo\nbaseline = 0\ndisparity_noise = 0.1\n") ==
        "c: baseline must be from 0.001 to 100 m");
  CHECK(wrong("depth_noise = time_of_flight\ndepth_noise_linear = -1\n") ==
        "c: depth_noise_linear must not be negative");
  CHECK(wrong("depth_noise = time_of_flight\nbaseline = 0.05\n") ==
        "c: 'baseline' is not a number of depth_noise time_of_flight");
}

TEST_CASE("a folder's camera file may be YAML or XML; of two, none is taken") {
  const test::TumFixture tum(3);
  std::filesystem::remove(tum.path / "camera.txt");
  test::write_file(tum.path / "camera.yaml",
                   "image_width: 64\nimage_height: 64\nK: [60, 0, 32, 0, 61, 32, 0, 0, 1]\n"
                   "depth_units_per_metre: 5000\ndepth_time_offset: 0.001\n");
  const Sequence sequence = load_sequence(tum.path);
  CHECK(camera_of(sequence).model.pinhole().fy() == 61);
  CHECK(sequence.frames.front().t_depth == doctest::Approx(sequence.frames.front().t_rgb - 0.001));
  test::write_file(tum.path / "camera.txt", kOwn);
  CHECK(
      mentions(error_of([&] { (void)load_sequence(tum.path); }), "has camera.txt and camera.yaml: keep one"));
}

TEST_CASE("ETH3D's four numbers are a camera with the size of the sequence's images") {
  const test::TumFixture tum(3);
  const test::TemporaryFolder folder;
  const std::string file = (folder.path / "calibration.txt").string();
  test::write_file(file, "# fx fy cx cy\n60.5 61 32 31.5\n");
  SequenceOptions options;
  options.camera = file;
  const CameraConfig camera = camera_of(load_sequence(tum.path, options), file);
  CHECK(camera.width == 64);
  CHECK(camera.height == 64);
  CHECK(camera.model.pinhole() == Pinhole<double>(60.5, 61, 32, 31.5));
  CHECK(camera.depth_units_per_metre == 5000);
  test::write_file(file, "60.5 61 32 31.5\n60 61 32 32\n");
  CHECK(mentions(error_of([&] { (void)camera_of(load_sequence(tum.path, options), file); }),
                 "calibration.txt:2: expected the end after fx fy cx cy"));
}

TEST_CASE("each preset loads, says where it is from, and is the camera that it names") {
  // The one path into the source tree that all tests of the runtime know.
  const std::filesystem::path presets =
      std::filesystem::path(DYNSLAM_FUZZ_CORPUS) / "../../../examples/cameras";
  int loaded = 0;
  for (const auto& entry : std::filesystem::directory_iterator(presets)) {
    CAPTURE(entry.path().string());
    const CameraConfig camera = load_camera(entry.path().string());
    const std::string text = read_file(entry.path());
    CHECK((mentions(text, "https://") || mentions(text, "Typical: ")));
    const auto p = camera.model.unproject({camera.width / 2.0, camera.height / 2.0}, 1.0);
    REQUIRE(p);
    CHECK(p->head<2>().norm() < 0.1);
    CHECK((camera.depth_noise || mentions(text, "https://")));
    if (camera.depth_noise) {
      CHECK(camera.depth_noise->sigma(2) > 0.002);
      CHECK(camera.depth_noise->sigma(2) < 0.02);
    }
    ++loaded;
  }
  CHECK(loaded == 10);
  for (const char* name : {"fr1", "fr2", "fr3", "bonn"}) {
    CAPTURE(name);
    const CameraConfig known = load_camera(name);
    const std::string file = (name[0] == 'b' ? "" : "tum_") + std::string(name) + ".txt";
    const CameraConfig preset = load_camera((presets / file).string());
    CHECK(preset.name == known.name);
    CHECK(preset.model.pinhole() == known.model.pinhole());
    CHECK(preset.model.brown_conrady()->coefficients() == known.model.brown_conrady()->coefficients());
    CHECK(preset.depth_units_per_metre == known.depth_units_per_metre);
    CHECK(preset.depth_time_offset == known.depth_time_offset);
    CHECK(preset.readout_time == known.readout_time);
    CHECK(known.readout_time > 0);
  }
  CHECK(load_camera((presets / "azure_kinect.txt").string()).model.brown_conrady()->is_rational());
}
