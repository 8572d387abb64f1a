// SPDX-License-Identifier: BSD-3-Clause
// ROS 1 bags as sequences: recognised, read with camera, times, depth and ground truth, run, evaluated.
#include <doctest/doctest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "bag_fixture.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/inspect/inspect.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "error_text.hpp"
#include "program.hpp"
#include "run_fixture.hpp"

namespace {

using namespace dynslam;
using namespace dynslam::runtime;
using test::bag_of_film, test::camera_info, test::compressed_colour, test::compressed_depth, test::film,
    test::InfoOfCamera, test::in_metres, test::image_message, test::kColourTopic, test::kDepthTopic,
    test::kInfoTopic, test::kOpticalFrame, test::metric_depth, test::millimetre_depth, test::mentions,
    test::ProgramResult, test::raw_colour, test::TemporaryFolder, test::tf_message, test::tf_truth,
    test::TopicOfFilm, test::error_of, test::FormatFixture, test::call, test::BagWriter, test::Serialised,
    test::odometry_message, test::pose_message, test::kNeverStop;
namespace fs = std::filesystem;

/// A bag of the film in a folder of its own.
struct FilmBag : TemporaryFolder {
  fs::path file = path / "film.bag";
  explicit FilmBag(const std::vector<TopicOfFilm>& topics) {
    test::write_file(file, bag_of_film(topics).bytes());
  }
};

RunOptions plain_run(const fs::path& sequence, const fs::path& out) {
  RunOptions options;
  options.sequence = sequence;
  options.out = out;
  options.dynamics = DynamicsMode::none;
  options.map = false;
  return options;
}

/// Of the valid depth of the film's k-th frame, the largest difference [m].
double depth_error(const Sequence& sequence, std::size_t k) {
  const RgbdFrame frame = decode_frame(sequence.frames[k], k, camera_of(sequence));
  const cv::Mat expected = in_metres(film()[k].depth);
  double worst = 0;
  for (int v = 0; v < expected.rows; ++v) {
    for (int u = 0; u < expected.cols; ++u) {
      const float z = frame.depth.at<float>(v, u), truth = expected.at<float>(v, u);
      if ((z > 0) != (truth > 0)) return 1e9;
      if (truth > 0) worst = std::max(worst, double(std::abs(z - truth)));
    }
  }
  return worst;
}

std::string load_error(const fs::path& file, const std::string& topics = {}) {
  SequenceOptions options;
  options.topics = topics;
  return error_of([&] { (void)load_sequence(file, options); });
}

}  // namespace

TEST_CASE("a bag is recognised, and read with its topics, camera, times, depth and ground truth") {
  const FilmBag bag({raw_colour(), metric_depth(), camera_info(), tf_truth()});
  CHECK(formats_of(bag.file) == std::vector<std::string>{"bag"});
  const Sequence sequence = load_sequence(bag.file);
  CHECK(sequence.format == "bag");
  CHECK(sequence.has_stamps);
  CHECK(sequence.topics == "/camera/rgb/image_color,/camera/depth/image");
  REQUIRE(sequence.frames.size() == film().size());
  CHECK(sequence.frames[3].stamp == "100.300000");
  CHECK(sequence.frames[3].t_rgb == 100.3);
  const CameraConfig camera = camera_of(sequence);
  CHECK(camera.model.pinhole().fx() == 535.4);
  CHECK(camera.model.pinhole().cy() == 247.6);
  CHECK(sequence.camera_source == "CameraInfo");
  CHECK(camera.name == kInfoTopic);
  CHECK(depth_error(sequence, 10) < 1e-6);
  const RgbdFrame frame = decode_frame(sequence.frames[10], 10, camera);
  CHECK(cv::norm(frame.bgr, film()[10].bgr, cv::NORM_INF) == 0);
  REQUIRE(sequence.groundtruth.size() == film().size());
  for (std::size_t k = 0; k < film().size(); ++k)
    CHECK((sequence.groundtruth[k].T_w_c.inverse() * film()[k].T_w_c).log().norm() < 1e-9);
  CHECK(mentions(sequence.truth_file.string(), "/tf (world -> openni_rgb_optical_frame)"));
}

TEST_CASE("a bag of each kind of images is tracked, and evaluated against its own ground truth") {
  const std::vector<std::pair<const char*, std::vector<TopicOfFilm>>> kinds{
      {"raw, metres", {raw_colour(), metric_depth(), camera_info(), tf_truth()}},
      {"jpeg, compressedDepth", {compressed_colour(), compressed_depth(), camera_info(), tf_truth()}},
      {"raw, millimetres", {raw_colour(), millimetre_depth(), camera_info(), tf_truth()}}};
  for (const auto& kind : kinds) {
    CAPTURE(kind.first);
    const FilmBag bag(kind.second);
    const Sequence sequence = load_sequence(bag.file);
    CHECK(depth_error(sequence, 5) < 6e-4);  // half a millimetre, where depth is in millimetres
    const RunSummary summary = run_sequence(plain_run(bag.file, bag.path / "out"), kNeverStop);
    CHECK(summary.tracked == film().size());
    const TrajectoryReport report = evaluate_trajectory(bag.path / "out", bag.file, {});
    CHECK(report.ate.pairs == film().size());
    CHECK(report.ate.translation.rmse < 0.03);
  }
}

TEST_CASE("a sequence as a folder and as a bag gives the same trajectory, byte for byte") {
  const FormatFixture folder("tum");
  const FilmBag bag({raw_colour(),
                     {kDepthTopic, "sensor_msgs/Image",
                      [](std::uint64_t t, const test::Shot& shot) {
                        return image_message(t, kOpticalFrame, "16UC1", shot.depth);
                      }},
                     camera_info()});
  test::write_file(bag.path / "camera.txt",
                   "width = 640\nheight = 480\nfx = 535.4\nfy = 539.2\ncx = 320.1\ncy = 247.6\n"
                   "depth_units_per_metre = 5000\n");
  const auto trajectory = [&](const fs::path& sequence, const fs::path& out) {
    RunOptions options = plain_run(sequence, out);
    options.camera = (bag.path / "camera.txt").string();
    options.dynamics = DynamicsMode::geometric;
    CHECK(run_sequence(options, kNeverStop).tracked == film().size());
    return test::bytes(out / "trajectory.txt");
  };
  CHECK(trajectory(folder.root, bag.path / "a") == trajectory(bag.file, bag.path / "b"));
}

TEST_CASE("what the program says of bags") {
  const FilmBag bag({raw_colour(), metric_depth(), camera_info(), tf_truth()});
  const std::string file = bag.file.string(), out = (bag.path / "out").string();
  const ProgramResult info = call("info " + file);
  CHECK(info.code == 0);
  CHECK(mentions(info.out, "format    bag\ntopics    /camera/rgb/image_color,/camera/depth/image\n"));
  CHECK(mentions(info.out, "14 pairs of 14 colour and 14 depth images"));

  CHECK(mentions(info.out, "dynslam run " + file));
  const ProgramResult run = call("run " + file + " --format bag --no-map --out " + out);
  CHECK(run.code == 0);
  CHECK(mentions(run.out, "14 of 14 frames tracked"));
  CHECK(mentions(run.out, "ATE [m]"));
  CHECK(mentions(call("eval " + out + " " + file).out, "ATE [m]"));
  CHECK(call("ablate " + file + " --no-map --out " + out + "2").code == 0);
  CHECK(fs::exists(bag.path / "out2" / "overlays.png"));

  CHECK(mentions(call("run " + file + " --format tum").out, "is not a folder"));
  CHECK(mentions(call("run " + bag.path.string() + " --format bag").out, "is a folder, not a bag"));
  CHECK(mentions(call("info " + FormatFixture("tum").root.string() + " --topics /a,/b").out,
                 "--topics is for bags"));
  test::write_file(bag.path / "notes.txt", "no bag\n");
  CHECK(mentions(load_error(bag.path / "notes.txt"), "is neither a folder nor a recording of ROS"));
}

TEST_CASE("topics that may be meant are listed, and --topics chooses") {
  const auto left = raw_colour("/left/image_raw"), right = raw_colour("/right/image_raw");
  const FilmBag bag({left, right, metric_depth()});
  const std::string error = load_error(bag.file);
  CHECK(mentions(error,
                 "colour /left/image_raw (bgr8, 14 images), /right/image_raw (bgr8, 14 images); depth "
                 "/camera/depth/image (32FC1, 14 images)"));
  CHECK(mentions(error, "--topics COLOUR,DEPTH"));
  SequenceOptions options;
  options.topics = "/right/image_raw,/camera/depth/image";
  CHECK(load_sequence(bag.file, options).topics == options.topics);
  for (const char* wrong : {"/right/image_raw", "/a,/b,/c", "/up/image_raw,/camera/depth/image",
                            "/camera/depth/image,/right/image_raw"}) {
    options.topics = wrong;
    CHECK_THROWS_AS((void)load_sequence(bag.file, options), UsageError);
  }
  CHECK(mentions(load_error(FilmBag({left}).file), "no topic of depth images that are read"));
  CHECK(mentions(load_error(FilmBag({metric_depth()}).file),
                 "its topics of images: /camera/depth/image (32FC1"));
}

TEST_CASE("of several topics the one in colour, uncompressed, and registered is taken") {
  const TopicOfFilm infrared{"/camera/ir/image", "sensor_msgs/Image",
                             [](std::uint64_t t, const test::Shot& shot) {
                               cv::Mat grey;
                               cv::extractChannel(shot.bgr, grey, 1);
                               return image_message(t, kOpticalFrame, "mono8", grey);
                             }};
  const TopicOfFilm unregistered{"/camera/depth/unregistered", "sensor_msgs/Image",
                                 [](std::uint64_t t, const test::Shot& shot) {
                                   return image_message(t, "depth_frame", "16UC1", shot.depth);
                                 }};
  const FilmBag bag({infrared, raw_colour(), compressed_colour(), unregistered, metric_depth(),
                     compressed_depth(), camera_info()});
  CHECK(load_sequence(bag.file).topics == "/camera/rgb/image_color,/camera/depth/image");
  const FilmBag grey({infrared, metric_depth()});
  const Sequence sequence = load_sequence(grey.file);
  CHECK(sequence.topics == "/camera/ir/image,/camera/depth/image");
  CHECK_THROWS_AS((void)camera_of(sequence), UsageError);  // no camera_info beside it
}

TEST_CASE("CameraInfo of each lens becomes that camera, and a rectified image's is without a lens") {
  const auto camera_with = [](const InfoOfCamera& info, const char* topic = kColourTopic) {
    const FilmBag bag({raw_colour(topic), metric_depth(), camera_info(info)});
    return camera_of(load_sequence(bag.file));
  };
  InfoOfCamera info;
  info.d = {0.2, -0.5, 0.001, -0.002, 0.1};
  CHECK_FALSE(camera_with(info).model.is_ideal());
  CHECK(camera_with(info).depth_units_per_metre == 1000);
  info.p = {500, 501, 322, 243};
  const CameraConfig rectified = camera_with(info, "/camera/rgb/image_rect_color");
  CHECK(rectified.model.is_ideal());
  CHECK(rectified.model.pinhole().fx() == 500);
  info.model = "rational_polynomial";
  info.d = {0.4, -2.5, 0.001, 0, 1.4, 0.3, -2.3, 1.3};
  CHECK_FALSE(camera_with(info).model.is_ideal());
  info.model = "equidistant";
  info.d = {-0.02, 0.01, 0, 0.001};
  CHECK_FALSE(camera_with(info).model.is_ideal());

  const auto error_with = [](const InfoOfCamera& wrong) {
    const FilmBag bag({raw_colour(), metric_depth(), camera_info(wrong)});
    return load_error(bag.file);
  };
  info.model = "thin_prism";
  CHECK(mentions(error_with(info),
                 "film.bag: /camera/rgb/camera_info: distortion_model 'thin_prism' is none of"));
  info = {};
  info.k[0] = std::nan("");
  CHECK(mentions(error_with(info), "camera_info: 'nan' of K is not a finite number"));
  info = {};
  info.binning = 2;
  CHECK(mentions(error_with(info), "binning_x is 2"));
}

TEST_CASE("a named camera takes its depth from the bag's units") {
  const FilmBag bag({raw_colour(), millimetre_depth(), camera_info()});
  const Sequence sequence = load_sequence(bag.file);
  CHECK(camera_of(sequence, "fr3").depth_units_per_metre == 1000);
  test::write_file(bag.path / "c.txt", "width = 640\nheight = 480\nfx = 535\nfy = 539\ncx = 320\ncy = 247\n");
  CHECK(camera_of(sequence, (bag.path / "c.txt").string()).depth_units_per_metre == 1000);
  std::ofstream(bag.path / "c.txt", std::ios::app) << "depth_units_per_metre = 4000\n";
  CHECK(camera_of(sequence, (bag.path / "c.txt").string()).depth_units_per_metre == 4000);
}

TEST_CASE("ground truth of a bag is what moves the camera, or there is a reason why it is none") {
  const std::vector<TopicOfFilm> images{raw_colour(), metric_depth(), camera_info()};
  const auto with = [&](std::vector<TopicOfFilm> more) {
    more.insert(more.begin(), images.begin(), images.end());
    const FilmBag bag(more);
    return load_sequence(bag.file);
  };
  const TopicOfFilm pose{"/pose", "geometry_msgs/PoseStamped", [](std::uint64_t t, const test::Shot& shot) {
                           return pose_message(t, "world", shot.T_w_c);
                         }};
  CHECK(with({pose}).groundtruth.size() == film().size());
  TopicOfFilm second = pose;
  second.name = "/pose_of_the_hand";
  CHECK(with({pose, second}).truth_missing == "several topics may be it: /pose, /pose_of_the_hand");
  CHECK(mentions(with({}).truth_missing, "neither tf moves the camera's frame 'openni_rgb_optical_frame'"));
  const auto odometry = [](const char* child) {
    return TopicOfFilm{"/odom", "nav_msgs/Odometry", [child](std::uint64_t t, const test::Shot& shot) {
                         return odometry_message(t, child, shot.T_w_c);
                       }};
  };
  CHECK(with({odometry(kOpticalFrame)}).groundtruth.size() == film().size());
  CHECK(mentions(with({odometry("base_link")}).truth_missing, "/odom is about 'base_link'"));
  const TopicOfFilm two_moving{
      "/tf", "tf2_msgs/TFMessage", [](std::uint64_t t, const test::Shot& shot) {
        return tf_message(t, {{"map", "odom", shot.T_w_c}, {"odom", kOpticalFrame, shot.T_w_c.inverse()}});
      }};
  CHECK(mentions(with({two_moving}).truth_missing, "by more than one transform (map -> odom, odom -> "));
  const TopicOfFilm circle{
      "/tf", "tf2_msgs/TFMessage", [](std::uint64_t t, const test::Shot& shot) {
        return tf_message(t, {{"a", kOpticalFrame, shot.T_w_c}, {kOpticalFrame, "a", shot.T_w_c}});
      }};
  CHECK(mentions(with({circle}).truth_missing, "tf goes in a circle"));
  const TopicOfFilm broken{"/pose", "geometry_msgs/PoseStamped", [](std::uint64_t t, const test::Shot&) {
                             return Serialised().header(t, "w").raw(std::string(56, '\0')).bytes();
                           }};
  const Sequence without = with({broken});
  CHECK(without.frames.size() == film().size());
  CHECK(mentions(without.truth_missing, "film.bag: /pose, message at byte"));

  const FilmBag bag({raw_colour(), metric_depth(), camera_info()});
  test::write_file(bag.path / "t.txt", "1 0 0 0 0 0 0 1\n");
  CHECK(mentions(call("eval " + (bag.path / "t.txt").string() + " " + bag.file.string()).out,
                 "film.bag: has no ground truth: neither tf moves"));
}

TEST_CASE(
    "times of a bag's images: nanoseconds are kept, 0 is one, what comes twice is left out and counted") {
  const auto bag_at = [](std::uint64_t first, std::uint64_t step) {
    BagWriter bag;
    const cv::Mat colour(64, 64, CV_8UC3, cv::Scalar::all(7)), depth(64, 64, CV_16UC1, cv::Scalar(1500));
    for (std::uint64_t k = 0; k < 3; ++k) {
      const std::uint64_t t = first + k * step;
      bag.add("/c", "sensor_msgs/Image", t, image_message(t, "f", "rgb8", colour));
      bag.add("/d", "sensor_msgs/Image", t, image_message(t, "f", "16UC1", depth));
    }
    return bag.bytes();
  };
  const TemporaryFolder folder;
  const fs::path file = folder.path / "t.bag";
  test::write_file(file, bag_at(1700000000123456789U, 33333333U));
  CHECK(load_sequence(file).frames[1].stamp == "1700000000.156790122");
  test::write_file(file, bag_at(0, 33333333U));
  const Sequence from_zero = load_sequence(file);
  CHECK(from_zero.frames.size() == 3);
  CHECK(from_zero.frames[0].t_rgb == 0);
  CHECK(from_zero.notes.empty());
  test::write_file(file, bag_at(0, 0));
  CHECK(mentions(load_error(file), "t.bag: /c: no image has a time in its header"));
  test::write_file(file, bag_at(5, 0));
  const Sequence repeated = load_sequence(file);
  CHECK(repeated.frames.size() == 1);
  REQUIRE(repeated.notes.size() == 2);
  CHECK(repeated.notes[0] ==
        "2 of 3 images of /c have the time of the one before and are left out, the first at 0.000000005 s");
}

TEST_CASE("a bag whose messages were all recorded twice is the bag") {
  const std::vector<TopicOfFilm> topics{raw_colour(), millimetre_depth(), camera_info(), tf_truth()};
  std::vector<TopicOfFilm> twice = topics;
  twice.insert(twice.end(), topics.begin(), topics.end());
  const FilmBag once(topics), doubled(twice);
  const Sequence a = load_sequence(once.file), b = load_sequence(doubled.file);
  CHECK(b.notes.size() == 2);
  REQUIRE(a.frames.size() == b.frames.size());
  for (std::size_t i = 0; i < a.frames.size(); ++i) CHECK(a.frames[i].stamp == b.frames[i].stamp);
  CHECK(a.groundtruth.size() == b.groundtruth.size());
  const ProgramResult info = call("info " + doubled.file.string());
  CHECK(info.code == 0);
  CHECK(mentions(info.out, "14 of 28 images of /camera/rgb/image_color have the time of the one before"));
}

TEST_CASE("float depth in millimetres is read as what it is, and that is said") {
  const TopicOfFilm depth{kDepthTopic, "sensor_msgs/Image", [](std::uint64_t t, const test::Shot& shot) {
                            const cv::Mat metres = in_metres(shot.depth);
                            return image_message(t, kOpticalFrame, "32FC1", cv::Mat(metres * 1000));
                          }};
  const FilmBag bag({raw_colour(), depth, camera_info(), tf_truth()});
  const ProgramResult info = call("info " + bag.file.string());
  CHECK(info.code == 0);
  CHECK(mentions(info.out, "too far for metres: it is read in the camera's depth units per metre"));
  CHECK_FALSE(mentions(info.out, "65535"));
  CHECK_FALSE(mentions(info.out, "are wrong"));
  const std::string out = (bag.path / "converted").string();
  const ProgramResult converted = call("convert " + bag.file.string() + " " + out);
  CHECK(converted.code == 0);
  CHECK(mentions(converted.out, "too far for metres"));
  const Sequence sequence = load_sequence(out);
  const RgbdFrame frame = decode_frame(sequence.frames[0], 0, camera_of(sequence));
  CHECK(cv::norm(frame.depth, in_metres(film()[0].depth), cv::NORM_INF) < 0.002);  // NaN is none in both
}

TEST_CASE("depth that does not fit into what is written is said, never lost without a word") {
  const TopicOfFilm far{kDepthTopic, "sensor_msgs/Image", [](std::uint64_t t, const test::Shot& shot) {
                          cv::Mat metres = in_metres(shot.depth);
                          return image_message(t, kOpticalFrame, "32FC1", cv::Mat(metres + 30));
                        }};
  const FilmBag bag({raw_colour(), far, camera_info()});
  test::write_file(
      bag.path / "c.txt",
      "width = 640\nheight = 480\nfx = 535\nfy = 539\ncx = 320\ncy = 247\ndepth_units_per_metre = 5000\n");
  const ProgramResult converted = call("convert " + bag.file.string() + " " + (bag.path / "o").string() +
                                       " --camera " + (bag.path / "c.txt").string());
  CHECK(converted.code == 0);
  CHECK(mentions(converted.out, "100 % of the depth does not fit into 16 bits of 5000 units per metre"));
  CHECK(mentions(converted.out, "14 of 14 depth images have no depth at all"));
}

TEST_CASE("a run warns of a camera that the sequence's name contradicts, before it tracks") {
  const FilmBag bag({raw_colour(), metric_depth(), camera_info(), tf_truth()});
  const auto named = bag.path / "rgbd_dataset_freiburg1_desk.bag";
  fs::rename(bag.file, named);
  const ProgramResult run =
      call("run " + named.string() + " --no-map --dynamics none --out " + (bag.path / "o").string());
  CHECK(run.code == 0);
  CHECK(mentions(run.out,
                 "dynslam: warning: the bag's name speaks of fr1 (fx 517.3, fy 516.5), the camera "
                 "/camera/rgb/camera_info has fx 535.4"));
  CHECK(run.out.find("depth units") == std::string::npos);
  CHECK(mentions(call("info " + named.string()).out, "the bag's name speaks of fr1"));
  const FormatFixture folder("tum");
  const auto renamed = bag.path / "freiburg2_x";
  fs::copy(folder.root, renamed, fs::copy_options::recursive);
  CHECK(mentions(call("run " + renamed.string() + " --camera fr3 --no-map --dynamics none --out " +
                      (bag.path / "p").string())
                     .out,
                 "dynslam: warning: the folder's name speaks of fr2"));
}
