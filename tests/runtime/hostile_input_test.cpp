// SPDX-License-Identifier: BSD-3-Clause
// Files made to do harm, or damaged so that they look well: each gets a clear line, a bound or a right
// result.
#include <doctest/doctest.h>

#include <algorithm>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"
#include "dynslam/runtime/nets/segmentation_stage.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "error_text.hpp"
#include "io/make_folder.hpp"
#include "run_fixture.hpp"
#include "tiny_onnx.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions;
namespace fs = std::filesystem;
using test::bytes;

namespace {

cv::Mat noise(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  cv::RNG random(3);
  random.fill(image, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(image, image, {5, 5}, 0);
  return image;
}

}  // namespace

TEST_CASE("depth among the colour images is refused, not taken for a dark picture") {
  const test::TemporaryFolder folder;
  const auto path = folder.path / "depth.png";
  write_image(path, cv::Mat(4, 5, CV_16UC1, cv::Scalar(5000)));
  CHECK(mentions(error_of([&] { (void)read_image(path, cv::IMREAD_COLOR); }), "has one channel of 16 bits"));
  CHECK(read_image(path, cv::IMREAD_UNCHANGED).at<std::uint16_t>(0, 0) == 5000);
}

TEST_CASE("a JPEG that is damaged in the middle is refused though its end marker stands") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path / "a.jpg";
  for (const bool progressive : {false, true}) {
    std::vector<std::uint8_t> jpeg;
    cv::imencode(".jpg", noise(320, 240), jpeg, {cv::IMWRITE_JPEG_PROGRESSIVE, progressive ? 1 : 0});
    const std::string good(jpeg.begin(), jpeg.end());
    test::write_file(path, good);
    CHECK(read_image(path, cv::IMREAD_COLOR).size() == cv::Size(320, 240));
    std::string damaged = good;
    std::fill_n(damaged.begin() + static_cast<std::ptrdiff_t>(good.size() / 2), good.size() / 4, '\0');
    test::write_file(path, damaged);
    CHECK(mentions(error_of([&] { (void)read_image(path, cv::IMREAD_COLOR); }), "a.jpg: is damaged: "));
    damaged = good;
    damaged.erase(good.size() / 2, good.size() / 4);
    test::write_file(path, damaged);
    CHECK(mentions(error_of([&] { (void)read_image(path, cv::IMREAD_COLOR); }), "a.jpg: is damaged: "));
  }
}

TEST_CASE("a file of some bytes that promises a huge image is refused before it is decoded") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path / "bomb.png";
  write_image(path, cv::Mat::zeros(64, 64, CV_16UC1));
  std::string content = bytes(path);
  const auto set_size = [&](unsigned width, unsigned height) {
    std::size_t at = 16;
    for (const unsigned n : {width, height}) {
      for (const unsigned shift : {24U, 16U, 8U, 0U}) content[at++] = static_cast<char>(n >> shift);
    }
    test::write_file(path, content);
    return error_of([&] { (void)read_image(path, cv::IMREAD_UNCHANGED); });
  };
  CHECK(mentions(set_size(30000, 30000), "bomb.png: is 30000x30000 pixels; at most 8192 a side are read"));
  CHECK(mentions(set_size(1, 0x7fffffff), "at most 8192"));
  CHECK(mentions(set_size(8000, 8000), "bomb.png: is damaged: the check sum of its chunk IHDR differs"));
  // A frame is compared with its camera first: an honest image of 8000 x 8000 is not decoded, either.
  write_image(path, cv::Mat::zeros(8000, 8000, CV_8UC1));
  CHECK(mentions(error_of([&] {
                   FrameRecord record;
                   record.rgb = record.depth = path;
                   (void)decode_frame(record, 0, load_camera("fr1"));
                 }),
                 "is 8000x8000, the camera's images are 640x480"));
}

TEST_CASE("a damaged mask in the cache is asked of the network again, and replaced") {
  const test::TemporaryFolder cache;
  const test::TumFixture tum(2);
  test::TinyNetwork network = test::colour_network();
  network.width = network.height = 64;
  test::write_onnx(cache.path / "net.onnx", network);
  const auto run = [&] {
    FrameStream frames(load_sequence(tum.path), load_camera((tum.path / "camera.txt").string()));
    SegmentationStageOptions o;
    o.segmenter.model = cache.path / "net.onnx";
    o.segmenter.engine = EngineKind::opencv;
    o.cache = cache.path / "masks";
    SegmentationStage stage(frames, o);
    int pixels = 0;
    while (auto next = stage.next()) pixels += cv::countNonZero(next->segmented.masks->dynamic);
    return pixels;
  };
  const int expected = run();
  const fs::path file = fs::directory_iterator(cache.path / "masks")->path();
  const std::string good = bytes(file);
  for (const std::string& bad : {good.substr(0, good.size() / 2), std::string(), std::string("junk")}) {
    test::write_file(file, bad);
    CHECK(run() == expected);
    CHECK(bytes(file) == good);
  }
  write_image(file, cv::Mat::zeros(32, 32, CV_16UC1));  // of another sequence
  CHECK(run() == expected);
  CHECK(bytes(file) == good);
}

TEST_CASE("a camera whose pixels look aside for ever is refused; wide lenses are not") {
  const auto parse = [](const std::string& focal, const std::string& centre) {
    std::istringstream in("width = 640\nheight = 480\nfx = " + focal + "\nfy = " + focal +
                          "\ncx = " + centre + "\ncy = 240\n");
    return error_of([&] { (void)parse_camera(in, "c.txt"); });
  };
  CHECK(parse("500", "320").empty());
  CHECK(parse("60", "320").empty());  // 159 degrees from side to side
  CHECK(mentions(parse("1", "320"), "c.txt: fx, fy, cx and cy let a pixel look more than 87 degrees aside"));
  CHECK(mentions(parse("500", "-1e6"), "87 degrees"));
}

TEST_CASE("quaternions of any length give rotations; positions that overflow are refused") {
  const auto parse = [](const std::string& line) {
    std::istringstream in(line);
    return parse_trajectory(in, "t.txt");
  };
  for (const char* q : {"0 0 1e200 1e200", "0 0 1e-5 1e-5", "0 0 3 3", "0 0 1e308 1e308"}) {
    CAPTURE(q);
    const SE3d T = parse(std::string("1 1 2 3 ") + q).front().T_w_c;
    CHECK((T.rotation_matrix() * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm() < 1e-9);
  }
  CHECK(mentions(error_of([&] { (void)parse("1 0 1e200 0 0 0 0 1"); }),
                 "t.txt:1: '1e200' is too far to be a position"));
}

TEST_CASE("a map beyond its memory ends with a line that says what to do") {
  const CameraConfig camera = load_camera("fr3");
  SemanticMapperOptions options;
  options.resolution = 0.02;
  options.max_bytes = 1 << 20;
  SemanticMapper mapper(camera.model, camera.width, camera.height, options);
  mapper.insert({SE3d(), cv::Mat(480, 640, CV_32FC1, cv::Scalar(2)), cv::Mat(), cv::Mat(),
                 cv::Mat::zeros(480, 640, CV_8UC3), 0});
  CHECK_THROWS_WITH_AS(mapper.finish(), doctest::Contains("takes more than 1 MB at voxels of 0.02 m"),
                       InputError);
}

TEST_CASE("synth refuses a folder with another program's sequence, and makes its own again") {
  const test::TumFixture real(2);
  const std::string truth = bytes(real.path / "groundtruth.txt");
  SynthOptions o;
  o.frames = 1;
  CHECK(mentions(error_of([&] { synthesize(o, real.path); }), "`dynslam synth` did not make"));
  CHECK(bytes(real.path / "groundtruth.txt") == truth);
  CHECK_FALSE(fs::exists(real.path / "label"));
  const test::TemporaryFolder own;
  synthesize(o, own.path);
  synthesize(o, own.path);
  CHECK(fs::exists(own.path / "synth.json"));
}

TEST_CASE("a folder that synth fills again is never of two sequences") {
  const test::TemporaryFolder own, other;
  SynthOptions o;
  o.width = 64;
  o.height = 64;
  o.frames = 3;
  synthesize(o, own.path);
  o.frames = 1;
  o.path = "rpy";
  CHECK_THROWS(synthesize(o, own.path, [](int, int) { throw std::runtime_error("interrupted"); }));
  CHECK_FALSE(fs::exists(own.path / "groundtruth.txt"));
  CHECK_FALSE(fs::exists(own.path / "rgb.txt"));
  CHECK(mentions(error_of([&] { (void)load_sequence(own.path); }), "is not whole (unfinished.txt)"));
  {
    const FileHandle lock = lock_folder(own.path);
    CHECK(mentions(error_of([&] { synthesize(o, own.path); }), "is where another process writes"));
  }
  synthesize(o, own.path);
  for (const char* folder : {"rgb", "depth", "label", "instance", "dynamic_mask", "box_mask"})
    CHECK(count_pngs(own.path / folder) == 1);
  CHECK(load_sequence(own.path).frames.size() == 1);

  fs::create_directories(other.path / "label");
  test::write_file(other.path / "label" / "mine.png", "mine");
  CHECK(mentions(error_of([&] { synthesize(o, other.path); }), "holds images that `dynslam synth` did not"));
  CHECK(bytes(other.path / "label" / "mine.png") == "mine");
  CHECK_FALSE(fs::exists(other.path / "rgb"));
}

TEST_CASE("a model that takes its weights from outside its folder is refused, wherever it names them") {
  const test::TemporaryFolder folder;
  const fs::path model = folder.path / "net" / "m.onnx";
  fs::create_directories(model.parent_path());
  test::write_file(folder.path / "secret.bin", std::string(4096, 's'));
  test::write_file(model.parent_path() / "weights.bin", std::string(4096, 'w'));
  fs::create_symlink("../secret.bin", model.parent_path() / "link.bin");
  using test::Message;
  const auto tensor = [](const std::string& location) {
    return Message()
        .number(1, 1)
        .number(2, 1)
        .bytes(8, "w")
        .message(13, Message().bytes(1, "location").bytes(2, location))
        .number(14, 1);
  };
  const auto refusal = [&](const Message& graph) {
    test::write_file(model, Message().number(1, 7).message(7, graph).text());
    return error_of([&] { (void)load_engine(model, {EngineKind::opencv}); });
  };
  for (const std::string location : {"/etc/passwd", "../secret.bin", "link.bin", "a/../../secret.bin"}) {
    CAPTURE(location);
    const std::string expected = "m.onnx: takes weights from outside its folder: " + location;
    const Message weights = tensor(location);
    CHECK(mentions(refusal(Message().message(5, weights)), expected));                         // initializer
    CHECK(mentions(refusal(Message().message(15, Message().message(1, weights))), expected));  // sparse one
    const Message constant = Message().message(5, Message().message(5, weights));  // Constant layer
    CHECK(mentions(refusal(Message().message(1, constant)), expected));
    const Message branch = Message().message(5, Message().message(6, Message().message(1, constant)));  // If
    CHECK(mentions(refusal(Message().message(1, branch)), expected));
    // Behind a group, which readers of protocol buffers skip.
    test::write_file(model,
                     "\x0b\x0c" + Message().number(1, 7).message(7, Message().message(5, weights)).text());
    CHECK(mentions(error_of([&] { (void)load_engine(model, {EngineKind::opencv}); }), expected));
  }
  CHECK_FALSE(mentions(refusal(Message().message(5, tensor("weights.bin"))), "outside its folder"));
}
