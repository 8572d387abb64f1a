// SPDX-License-Identifier: BSD-3-Clause
// What users feed the program: lists, cameras, trajectories, images, masks; good ones and broken ones.
#include <doctest/doctest.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "error_text.hpp"
#include "pose_distance.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions;
namespace fs = std::filesystem;

namespace {

void truncate(const fs::path& path, std::uintmax_t keep) {
  fs::resize_file(path, keep);
}

}  // namespace

TEST_CASE("list errors name file, line and reason") {
  const auto list = [](const std::string& text) {
    std::istringstream in(text);
    return error_of([&] { (void)parse_list(in, "rgb.txt"); });
  };
  CHECK(list("# c\n1.0 a.png\n2.0 b.png\n").empty());
  CHECK(list("1.0 a.png\n\n1.0 b.png\n") == "rgb.txt:3: the time stamp occurs twice");
  CHECK(list("2.0 a.png\n1.0 b.png\n") == "rgb.txt:2: the time stamps are not sorted");
  CHECK(mentions(list("1.0\n"), "rgb.txt:1: expected 2 columns"));
  CHECK(mentions(list("nan a.png\n"), "rgb.txt:1: 'nan' is not a time stamp"));
  CHECK(mentions(list("1.0x a.png\n"), "rgb.txt:1: '1.0x'"));
}

TEST_CASE("association lines are checked alike") {
  const auto check = [](const std::string& text) {
    std::istringstream in(text);
    return error_of([&] { (void)parse_associations(in, "associations.txt"); });
  };
  CHECK(check("1.0 a.png 1.01 b.png\n").empty());
  CHECK(mentions(check("1.0 a.png 1.01\n"), "associations.txt:1: expected 4 columns"));
  CHECK(mentions(check("1.0 a.png 1.01 b.png\n1.0 a.png 1.01 b.png\n"),
                 "associations.txt:2: the time stamp occurs twice"));
  CHECK(mentions(check("1.0 a.png inf b.png\n"), "associations.txt:1: 'inf'"));
}

TEST_CASE("trajectory errors name file, line and reason; order and repeats follow TUM's tools") {
  const auto check = [](const std::string& text) {
    std::istringstream in(text);
    return error_of([&] { (void)parse_trajectory(in, "gt.txt"); });
  };
  CHECK(check("1 0 0 0 0 0 0 1\n2, 0, 0, 0, 0, 0, 0, 1\n").empty());
  CHECK(mentions(check("1 0 0 0 0 0 1\n"), "gt.txt:1: expected 8 columns"));
  CHECK(mentions(check("#\n1 0 0 nan 0 0 0 1\n"), "gt.txt:2: 'nan' is not a finite number"));
  CHECK(mentions(check("1 0 0 0 0 0 0 0\n"), "gt.txt:1: the quaternion is zero"));
  CHECK(mentions(check("# nothing\n"), "gt.txt: holds no poses"));
  std::istringstream in("2 5 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n2 7 0 0 0 0 0 1\n");
  const auto trajectory = parse_trajectory(in, "gt.txt");
  REQUIRE(trajectory.size() == 2);
  CHECK(trajectory[0].t == 1.0);
  CHECK(trajectory[1].T_w_c.translation().x() == 7.0);
}

TEST_CASE("a written trajectory reads back, and an unwritable one is told") {
  const test::TemporaryFolder folder;
  std::vector<StampedPose<double>> out;
  for (int i = 0; i < 5; ++i) {
    out.push_back(
        {1305031102.175304 + i,
         SE3d::exp((Eigen::Matrix<double, 6, 1>() << 0.1 * i, 0.2, -0.3, 0.1, 0.4 * i, 0).finished())});
  }
  write_trajectory(folder.path / "t.txt", out);
  const auto in = read_trajectory(folder.path / "t.txt");
  REQUIRE(in.size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(in[i].t == doctest::Approx(out[i].t).epsilon(1e-15));
    CHECK(test::pose_distance(in[i].T_w_c, out[i].T_w_c) < 1e-8);
  }
  CHECK(mentions(error_of([&] { write_trajectory(folder.path / "no" / "such" / "t.txt", out); }),
                 "cannot be written"));
  CHECK(mentions(error_of([&] { (void)read_trajectory(folder.path / "absent.txt"); }),
                 "absent.txt: cannot be opened"));
}

TEST_CASE("cameras: names, files, and what is wrong with them") {
  CHECK(load_camera("fr2").depth_units_per_metre == 5208);
  CHECK(load_camera("fr1").model.brown_conrady()->coefficients()(1) == doctest::Approx(-0.953104));
  CHECK(load_camera("fr3").model.is_ideal());
  CHECK_THROWS_AS((void)load_camera("fr4"), UsageError);
  CHECK_THROWS_AS((void)load_camera(""), UsageError);
  const auto check = [](const std::string& text) {
    std::istringstream in(text);
    return error_of([&] { (void)parse_camera(in, "c.txt"); });
  };
  const std::string good = "width = 640\nheight = 480\nfx = 500\nfy = 500\ncx = 320\ncy = 240\n";
  CHECK(check(good).empty());
  CHECK(mentions(check("width = 640\n"), "c.txt: 'height' is missing"));
  CHECK(mentions(check(good + "f = 3\n"), "c.txt:7: unknown key 'f'"));
  CHECK(mentions(check(good + "k1 = big\n"), "c.txt:7: 'big'"));
  CHECK(mentions(check(good + "k1\n"), "c.txt:7: expected 'key = value'"));
  CHECK(mentions(check("width = 640.5\nheight = 480\nfx = 1\nfy = 1\ncx = 1\ncy = 1\n"), "whole numbers"));
  CHECK(mentions(check("width = 640\nheight = 480\nfx = 0\nfy = 1\ncx = 1\ncy = 1\n"),
                 "fx and fy must be positive"));
}

TEST_CASE("a sequence: lists paired by time, camera hint, ground truth") {
  const test::TumFixture tum(4);
  const Sequence sequence = load_sequence(tum.path);
  REQUIRE(sequence.frames.size() == 4);
  CHECK(sequence.frames[1].stamp == "1.033333");
  CHECK(sequence.camera_hint == (tum.path / "camera.txt").string());
  CHECK(sequence.groundtruth.size() == 4);
  SequenceOptions two;
  two.max_frames = 2;
  CHECK(load_sequence(tum.path, two).frames.size() == 2);
}

TEST_CASE("depth images are paired by when they were taken: the camera says how late they are stamped") {
  const test::TumFixture tum(6);  // stamped as the colour images, 33 ms apart
  std::ofstream(tum.path / "camera.txt", std::ios::app) << "depth_time_offset = 0.03\n";
  const auto check = [&](const Sequence& sequence, std::size_t frames, const std::string& second) {
    REQUIRE(sequence.frames.size() == frames);
    CHECK(sequence.frames[1].depth.filename() == second);
    for (const FrameRecord& frame : sequence.frames)
      CHECK(std::abs(frame.t_depth - frame.t_rgb - 1 / 30.0 + 0.03) < 1e-5);
  };
  check(load_sequence(tum.path), 5, "1.066666.png");  // the next one; after the last colour image none comes
  SequenceOptions options;
  options.depth_time_offset = -0.03;
  const Sequence early = load_sequence(tum.path, options);
  CHECK(early.frames.size() == 5);
  CHECK(early.frames[0].depth.filename() == "1.000000.png");
  // A camera named instead has no offset here.
  options = {};
  options.camera = "bonn";
  CHECK(load_sequence(tum.path, options).frames.size() == 6);
  // Pairs that a list gives stay together.
  std::ofstream(tum.path / "associations.txt") << "1.0 rgb/1.000000.png 1.0 depth/1.000000.png\n";
  const Sequence listed = load_sequence(tum.path);
  REQUIRE(listed.frames.size() == 1);
  CHECK(listed.frames[0].t_depth == doctest::Approx(0.97));
  std::istringstream far(
      "width = 64\nheight = 64\nfx = 60\nfy = 60\ncx = 32\ncy = 32\ndepth_time_offset = 2\n");
  CHECK(
      test::mentions(test::error_of([&] { (void)parse_camera(far, "c.txt"); }), "depth_time_offset must be"));
  std::istringstream slow("width = 64\nheight = 64\nfx = 60\nfy = 60\ncx = 32\ncy = 32\nreadout_time = 24\n");
  CHECK(test::mentions(test::error_of([&] { (void)parse_camera(slow, "c.txt"); }), "readout_time must be"));
}

TEST_CASE("broken sequences are refused with the file") {
  const test::TumFixture tum(3);
  CHECK(mentions(error_of([&] { (void)load_sequence(tum.path / "absent"); }), "does not exist"));
  CHECK(mentions(error_of([&] { (void)load_sequence(tum.path / "rgb.txt" / "no"); }), "does not exist"));
  SUBCASE("missing list") {
    fs::remove(tum.path / "depth.txt");
    CHECK(mentions(error_of([&] { (void)load_sequence(tum.path); }), "depth.txt: cannot be opened"));
  }
  SUBCASE("empty list") {
    std::ofstream(tum.path / "rgb.txt") << "# nothing\n";
    CHECK(mentions(error_of([&] { (void)load_sequence(tum.path); }), "rgb.txt: lists no images"));
  }
  SUBCASE("nothing associates") {
    std::ofstream(tum.path / "depth.txt") << "50.0 depth/a.png\n";
    CHECK(mentions(error_of([&] { (void)load_sequence(tum.path); }),
                   "no colour image has a depth image within 0.02 s"));
  }
  SUBCASE("bad ground truth") {
    std::ofstream(tum.path / "groundtruth.txt") << "1.0 0 0\n";
    const Sequence sequence = load_sequence(tum.path);  // which does not need it
    CHECK(sequence.groundtruth.empty());
    REQUIRE(sequence.notes.size() == 1);
    CHECK(mentions(sequence.notes[0], "groundtruth.txt:1: expected 8 columns"));
  }
  SUBCASE("a ground truth that is a link to itself") {
    std::filesystem::remove(tum.path / "groundtruth.txt");
    std::filesystem::create_symlink("groundtruth.txt", tum.path / "groundtruth.txt");
    const Sequence sequence = load_sequence(tum.path);
    CHECK(sequence.groundtruth.empty());
    REQUIRE(sequence.notes.size() == 1);
    CHECK(mentions(sequence.notes[0], "groundtruth.txt: "));
  }
}

TEST_CASE("a frame decodes to colour, grey and metres; each kind of damage is told") {
  const test::TumFixture tum(3);
  const Sequence sequence = load_sequence(tum.path);
  const CameraConfig camera = load_camera(sequence.camera_hint);
  const RgbdFrame frame = decode_frame(sequence.frames[0], 0, camera);
  CHECK(frame.bgr.type() == CV_8UC3);
  CHECK(frame.gray.type() == CV_8UC1);
  CHECK(frame.depth.at<float>(10, 10) == doctest::Approx(1.5));
  CHECK(std::isnan(frame.depth.at<float>(0, 0)));
  const fs::path rgb = sequence.frames[1].rgb, depth = sequence.frames[1].depth;
  const auto error = [&] { return error_of([&] { (void)decode_frame(sequence.frames[1], 1, camera); }); };
  SUBCASE("truncated PNG") {
    truncate(rgb, fs::file_size(rgb) / 2);
    CHECK(error() == rgb.string() + ": is truncated");
  }
  SUBCASE("truncated JPEG") {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", frame.bgr, bytes);
    std::ofstream(rgb, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size() / 2));
    CHECK(error() == rgb.string() + ": is truncated");
  }
  SUBCASE("empty") {
    truncate(depth, 0);
    CHECK(error() == depth.string() + ": is empty");
  }
  SUBCASE("missing") {
    fs::remove(depth);
    CHECK(error() == depth.string() + ": cannot be opened");
  }
  SUBCASE("not an image") {
    std::ofstream(rgb) << "hello";
    CHECK(error() == rgb.string() + ": is neither PNG nor JPEG, nor depth as TIFF, OpenEXR or .npy");
  }
  SUBCASE("8-bit depth") {
    write_image(depth, cv::Mat(camera.height, camera.width, CV_8UC1, cv::Scalar(3)));
    CHECK(mentions(error(), depth.string() + ": is not a 16-bit image of one channel"));
  }
  SUBCASE("another size") {
    write_image(rgb, cv::Mat(10, 20, CV_8UC3));
    CHECK(mentions(error(), rgb.string() + ": is 20x10"));
  }
}

TEST_CASE("an EXIF orientation does not turn the colours away from depth and masks") {
  const test::TemporaryFolder folder;
  cv::Mat image(48, 64, CV_8UC3);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u)
      image.at<cv::Vec3b>(v, u) = cv::Vec3b::all(static_cast<uchar>(3 * u + v));
  }
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", image, jpeg);
  const auto write = [&](const char* name, const std::vector<std::uint8_t>& bytes) {
    std::ofstream(folder.path / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return folder.path / name;
  };
  const cv::Mat plain = read_image(write("plain.jpg", jpeg), cv::IMREAD_COLOR);
  // APP1 behind the start marker: "Exif", a little-endian TIFF header, one entry: tag 0x0112 (orientation),
  // of type 3 (16 bit), one value, 6: to be shown turned by a quarter.
  const std::vector<std::uint8_t> app1{0xFF, 0xE1, 0, 34, 'E', 'x', 'i', 'f', 0,    0, 'I', 'I',
                                       42,   0,    8, 0,  0,   0,   1,   0,   0x12, 1, 3,   0,
                                       1,    0,    0, 0,  6,   0,   0,   0,   0,    0, 0,   0};
  jpeg.insert(jpeg.begin() + 2, app1.begin(), app1.end());
  const fs::path turned = write("turned.jpg", jpeg);
  REQUIRE(cv::imread(turned.string()).size() == cv::Size(48, 64));  // the tag is there and is understood
  const cv::Mat read = read_image(turned, cv::IMREAD_COLOR);
  REQUIRE(read.size() == plain.size());
  CHECK(cv::norm(read, plain, cv::NORM_INF) == 0);
}

TEST_CASE("the stream keeps the order and passes broken frames on without stopping") {
  const test::TumFixture tum(12);
  const Sequence sequence = load_sequence(tum.path);
  truncate(sequence.frames[5].depth, 40);
  FrameStream stream(sequence, load_camera(sequence.camera_hint), StreamOptions{2});
  std::size_t index = 0;
  while (const auto result = stream.next()) {
    CHECK(result->index == index);
    CHECK(result->frame.has_value() == (index != 5));
    if (index == 5) CHECK(mentions(result->error, "is truncated"));
    ++index;
  }
  CHECK(index == 12);
}

TEST_CASE("a stream may be dropped while its queue is full") {
  const test::TumFixture tum(12);
  const Sequence sequence = load_sequence(tum.path);
  FrameStream stream(sequence, load_camera(sequence.camera_hint), StreamOptions{1});
  CHECK(stream.next());
}

TEST_CASE("true masks that number instances are read as what their labels say") {
  const test::TemporaryFolder truth, predicted;
  cv::Mat two = cv::Mat::zeros(10, 10, CV_8UC1);
  two(cv::Rect(0, 0, 10, 2)) = 1;
  two(cv::Rect(0, 4, 10, 2)) = 2;  // by itself the label of chairs
  write_image(truth.path / "1.png", two);
  write_image(predicted.path / "1.png", two > 0);
  CHECK(evaluate_masks(predicted.path, truth.path).iou == doctest::Approx(0.5));
  MaskOptions instances;
  instances.labels = {"instances"};
  CHECK(evaluate_masks(predicted.path, truth.path, 0, {}, instances).iou == 1);
}

TEST_CASE("mask figures by hand; missing predictions count as empty") {
  const test::TemporaryFolder truth, predicted;
  cv::Mat a = cv::Mat::zeros(10, 10, CV_8UC1), b = a.clone();
  a(cv::Rect(0, 0, 10, 4)) = 255;  // 40 true
  b(cv::Rect(0, 2, 10, 4)) = 255;  // 40 found, 20 of them right
  write_image(truth.path / "1.png", a);
  write_image(predicted.path / "1.png", b);
  write_image(truth.path / "2.png", a);
  write_image(truth.path / "3.png", cv::Mat::zeros(10, 10, CV_8UC1));
  write_image(predicted.path / "3.png", cv::Mat::zeros(10, 10, CV_8UC1));
  const MaskReport report = evaluate_masks(predicted.path, truth.path);
  CHECK(report.frames == 3);
  CHECK(report.missing == 1);
  CHECK(report.recall == doctest::Approx(0.25));
  CHECK(report.precision == doctest::Approx(0.5));
  CHECK(report.iou == doctest::Approx(0.2));
  CHECK(report.frames_recall_below_0_3 == 1);
  CHECK(report.spill.mean == doctest::Approx(0.2 / 3));  // rows 4 and 5 of the first frame
  CHECK(report.spill.worst == doctest::Approx(0.2));
  CHECK(evaluate_masks(predicted.path, truth.path, 1).spill.worst == doctest::Approx(0.1));
  CHECK(evaluate_masks(predicted.path, truth.path, 2).spill.worst == 0);
  const test::TemporaryFolder empty;
  CHECK(mentions(error_of([&] { (void)evaluate_masks(empty.path, truth.path); }), "has no mask in common"));
  CHECK(mentions(error_of([&] { (void)evaluate_masks(predicted.path, empty.path); }), "holds no PNG masks"));
  CHECK(mentions(error_of([&] { (void)evaluate_masks(predicted.path / "absent", truth.path); }),
                 "does not exist"));
}
