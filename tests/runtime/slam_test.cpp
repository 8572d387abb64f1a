// SPDX-License-Identifier: BSD-3-Clause
// The system as an object: frames in memory, whatever they are.
#include "dynslam/runtime/slam.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <future>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "error_text.hpp"
#include "run_fixture.hpp"
#include "tiny_onnx.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes, test::kNeverStop, test::options_for;

namespace {

constexpr int kRawFrames = 24;

struct RawFrame {
  cv::Mat bgr, depth;             // CV_8UC3, CV_16UC1
  cv::Mat metres;                 // CV_32FC1, as the reader of sequences makes them
  double t = 0, depth_delay = 0;  // [s]
  std::string stamp;
};

struct Walk {
  test::WalkingSequence folder{kRawFrames};
  CameraConfig camera;
  std::vector<RawFrame> frames;

  Walk() {
    const Sequence sequence = load_sequence(folder.path);
    camera = load_camera(sequence.camera_hint);
    for (const FrameRecord& f : sequence.frames)
      frames.push_back({cv::imread(f.rgb.string()), cv::imread(f.depth.string(), cv::IMREAD_UNCHANGED),
                        decode_frame(f, 0, camera).depth, f.t_rgb, f.t_depth - f.t_rgb, f.stamp});
  }
};

const Walk& walk() {
  static const Walk made;
  return made;
}

using Change = std::function<void(const RawFrame& frame, cv::Mat& image, cv::Mat& depth)>;

/// The trajectory of all frames as text, each frame's images changed.
std::string trajectory_of(Slam& slam, const Change& change = {}, int frames = kRawFrames) {
  for (int i = 0; i < frames; ++i) {
    const RawFrame& f = walk().frames[static_cast<std::size_t>(i)];
    cv::Mat image = f.bgr.clone(), depth = f.depth.clone();
    if (change) change(f, image, depth);
    (void)slam.track(image, depth, f.t, std::nullopt, f.depth_delay);
    image.setTo(0);  // the caller's again
    depth.setTo(0);
  }
  slam.finish();
  std::ostringstream text;
  text.precision(17);
  for (const auto& pose : slam.trajectory())
    text << pose.t << ' ' << pose.T_w_c.translation().transpose() << ' ' << pose.T_w_c.so3().log().transpose()
         << '\n';
  return text.str();
}

}  // namespace

TEST_CASE("the depth noise of a camera goes for pose, weights and map, unless the options say otherwise") {
  constexpr int kFrames = 12;
  const auto noise = DepthNoise<double>::stereo(0.05, 535, 0.3);
  const auto run = [&](bool of_camera, const SlamOptions& options) {
    CameraConfig camera = walk().camera;
    if (of_camera) camera.depth_noise = noise;
    Slam slam(camera, options);
    const std::string poses = trajectory_of(slam, {}, kFrames);
    std::ostringstream tree;
    slam.octree()->write(tree);
    return std::pair(poses, tree.str());
  };
  SlamOptions usual, same;
  same.tracker.depth_noise = noise.times(4);
  same.tracker.geometry.weights.depth_noise = noise;
  same.mapper.scan.noise = noise.cast<float>();
  const auto from_camera = run(true, usual), from_options = run(false, same), without = run(false, usual);
  CHECK(from_camera == from_options);
  CHECK(from_camera.first != without.first);
  CHECK(from_camera.second != without.second);
  SlamOptions own = usual;
  own.tracker.depth_noise = {0.003, 0.009};
  SlamOptions own_same = same;
  own_same.tracker.depth_noise = own.tracker.depth_noise;
  CHECK(run(true, own) == run(false, own_same));
}

TEST_CASE("frames in memory give what a run over their files gives, map and masks included") {
  const test::TemporaryFolder out;
  const RunSummary run =
      run_sequence(options_for(walk().folder.path, out.path / "run", DynamicsMode::both), kNeverStop);
  CHECK(run.tracked == kRawFrames);
  SlamOptions options;
  options.dynamics = DynamicsMode::both;
  Slam slam(walk().camera, options);
  MaskSource masks(walk().folder.path / "label");
  for (const RawFrame& f : walk().frames) {
    const TrackResult result = slam.track(
        f.bgr, f.depth, f.t, masks.read(f.stamp, walk().camera.width, walk().camera.height), f.depth_delay);
    REQUIRE(result.ok());
    const cv::Mat saved =
        cv::imread((out.path / "run" / "masks" / (f.stamp + ".png")).string(), cv::IMREAD_UNCHANGED);
    CHECK(cv::countNonZero(saved != result.dynamic_mask) == 0);
  }
  fs::create_directories(out.path / "own");
  slam.save_octree(out.path / "own");
  write_trajectory(out.path / "own" / "trajectory.txt", slam.trajectory());
  write_trajectory(out.path / "own" / "trajectory_live.txt", slam.live_trajectory());
  write_trajectory(out.path / "own" / "keyframes.txt", slam.keyframe_trajectory());
  for (const char* file :
       {"trajectory.txt", "trajectory_live.txt", "keyframes.txt", "map.sot", "map_color.ot"})
    CHECK(bytes(out.path / "run" / file) == bytes(out.path / "own" / file));
  CHECK(slam.octree()->size() > 100);
}

TEST_CASE("the live trajectory is what track() returned, to the last bit, whatever came later") {
  Slam slam(walk().camera);
  std::vector<StampedPose<double>> returned;
  const auto same = [&] {
    const auto& live = slam.live_trajectory();
    REQUIRE(live.size() == returned.size());
    for (std::size_t i = 0; i < live.size(); ++i) {
      CHECK(live[i].t == returned[i].t);
      CHECK(live[i].T_w_c.matrix() == returned[i].T_w_c.matrix());
    }
  };
  CHECK(slam.live_trajectory().empty());
  for (std::size_t i = 0; i < walk().frames.size(); ++i) {
    const RawFrame& f = walk().frames[i];
    const bool covered = i == 10 || i == 11;
    const TrackResult result = slam.track(covered ? cv::Mat(f.bgr.size(), f.bgr.type(), cv::Scalar()) : f.bgr,
                                          f.depth, f.t, std::nullopt, f.depth_delay);
    CHECK(result.ok() == !covered);
    if (result.ok()) returned.push_back({f.t, result.T_w_c, 0});
    same();
  }
  slam.finish();
  same();
  // In the end other poses are known, of frames that were lost, too.
  const auto last = slam.trajectory();
  CHECK(last.size() >= returned.size());
  CHECK(last.back().T_w_c.matrix() != returned.back().T_w_c.matrix());
  slam.reset();
  CHECK(slam.live_trajectory().empty());
}

TEST_CASE("images of any stride and of each type that is allowed give the same; so does a second walk") {
  Slam slam(walk().camera);
  const std::string plain = trajectory_of(slam);
  CHECK(std::count(plain.begin(), plain.end(), '\n') == kRawFrames);
  const auto same = [&](const std::string& what, const Change& change) {
    CAPTURE(what);
    slam.reset();
    CHECK(slam.trajectory().empty());
    CHECK(slam.map().keyframes().empty());
    const bool equal = trajectory_of(slam, change) == plain;
    CHECK(equal);
  };
  same("again", {});
  same("padded rows", [](const RawFrame&, cv::Mat& image, cv::Mat& depth) {
    for (cv::Mat* m : {&image, &depth}) {
      cv::Mat wide;
      cv::copyMakeBorder(*m, wide, 3, 5, 7, 11, cv::BORDER_CONSTANT, cv::Scalar::all(99));
      *m = wide(cv::Rect(7, 3, m->cols, m->rows));
    }
  });
  same("BGRA",
       [](const RawFrame&, cv::Mat& image, cv::Mat&) { cv::cvtColor(image, image, cv::COLOR_BGR2BGRA); });
  same("grey",
       [](const RawFrame&, cv::Mat& image, cv::Mat&) { cv::cvtColor(image, image, cv::COLOR_BGR2GRAY); });
  same("metres", [](const RawFrame& f, cv::Mat&, cv::Mat& depth) { depth = f.metres.clone(); });
}

TEST_CASE("the trajectory is smoothed in the end, not before, and not where it shall stay as tracked") {
  // Acceleration of the centres, summed [m]: what smoothing takes away.
  const auto roughness = [](const std::vector<StampedPose<double>>& trajectory) {
    double sum = 0;
    for (std::size_t i = 2; i < trajectory.size(); ++i) {
      sum += (trajectory[i].T_w_c.translation() - 2 * trajectory[i - 1].T_w_c.translation() +
              trajectory[i - 2].T_w_c.translation())
                 .norm();
    }
    return sum;
  };
  const auto roughness_of = [&](const SlamOptions& options, bool finished) {
    Slam slam(walk().camera, options);
    for (const RawFrame& f : walk().frames)
      (void)slam.track(f.bgr, f.depth, f.t, std::nullopt, f.depth_delay);
    if (finished) slam.finish();
    CHECK(slam.trajectory().size() == kRawFrames);
    return roughness(slam.trajectory());
  };
  SlamOptions as_tracked, paper;
  as_tracked.trajectory.smooth = false;
  paper.tracker.method = MotionMethod::paper;
  SlamOptions paper_as_tracked = paper;
  paper_as_tracked.trajectory.smooth = false;
  CHECK(roughness_of({}, true) < 0.5 * roughness_of(as_tracked, true));
  CHECK(roughness_of({}, false) == roughness_of(as_tracked, false));
  CHECK(roughness_of(paper, true) == roughness_of(paper_as_tracked, true));
}

TEST_CASE("what the geometry found can be asked for, as long as the frame has a pose") {
  Slam slam(walk().camera);
  CHECK(slam.motion() == nullptr);
  bool found = false;
  for (const RawFrame& f : walk().frames) {
    const TrackResult result = slam.track(f.bgr, f.depth, f.t, std::nullopt, f.depth_delay);
    REQUIRE(result.ok());
    const MotionResult<double>* motion = slam.motion();
    REQUIRE(motion != nullptr);
    if (result.mask_rejected != MaskVerdict::kept) continue;
    const cv::Mat mask(motion->mask.height(), motion->mask.width(), CV_8UC1,
                       const_cast<std::uint8_t*>(motion->mask.data()));
    CHECK(cv::countNonZero((mask != 0) != (result.dynamic_mask != 0)) == 0);
    found = found || (motion->dynamic_matches > 0 && cv::countNonZero(mask) > 0);
  }
  CHECK(found);
  const RawFrame& last = walk().frames.back();
  CHECK_FALSE(slam.track(cv::Mat::zeros(last.bgr.size(), CV_8UC3), last.depth, last.t + 0.03).ok());
  CHECK(slam.motion() == nullptr);
  SlamOptions none;
  none.dynamics = DynamicsMode::none;
  Slam plain(walk().camera, none);
  (void)plain.track(walk().frames[0].bgr, walk().frames[0].depth, walk().frames[0].t);
  CHECK(plain.motion() == nullptr);
}

TEST_CASE("two systems in one process do not know of each other") {
  Slam alone(walk().camera);
  const std::string expected = trajectory_of(alone, {}, 10);
  const auto run = [] {
    Slam slam(walk().camera);
    return trajectory_of(slam, {}, 10);
  };
  auto a = std::async(std::launch::async, run), b = std::async(std::launch::async, run);
  CHECK(a.get() == expected);
  CHECK(b.get() == expected);
}

TEST_CASE("a map that was saved is gone on in; what threw midway is never saved over it") {
  const test::TemporaryFolder folder;
  const fs::path map = folder.path / "map";
  Slam first(walk().camera);
  (void)trajectory_of(first, {}, 12);
  const std::size_t keyframes = first.map().keyframes().size();
  first.save(map);
  const std::string saved = bytes(map / "keyframes.bin");
  CHECK(fs::exists(map / "scans.bin"));

  Slam second(walk().camera);
  second.load(map);
  CHECK(second.map().keyframes().size() == keyframes);
  const RawFrame& f = walk().frames[3];
  CHECK(second.track(f.bgr, f.depth, f.t).state == TrackingState::relocalised);
  CHECK_THROWS_WITH_AS(second.load(map), doctest::Contains("before the first frame"), UsageError);

  SlamOptions small;
  small.map_memory = 1000;  // bytes: the first keyframe is too many
  Slam third(walk().camera, small);
  const auto fill = [&] { (void)trajectory_of(third); };
  CHECK_THROWS(fill());
  CHECK_FALSE(third.whole());
  CHECK_THROWS_WITH_AS(third.save(map), doctest::Contains("stays as it was"), InputError);
  CHECK(bytes(map / "keyframes.bin") == saved);
  third.reset();
  CHECK(third.whole());
}

TEST_CASE("a network inside gives what its masks give from outside") {
  const test::TemporaryFolder folder;
  test::write_onnx(folder.path / "colours.onnx", test::colour_network());
  SlamOptions options;
  options.dynamics = DynamicsMode::both;
  options.network.emplace();
  options.network->segmenter.model = folder.path / "colours.onnx";
  options.network->every = 2;
  Slam inside(walk().camera, options);
  const std::string expected = trajectory_of(inside, {}, 8);
  inside.reset();
  CHECK(trajectory_of(inside, {}, 8) == expected);
  options.network.reset();
  Slam outside(walk().camera, options);
  RunOptions run = options_for(walk().folder.path, folder.path / "run", DynamicsMode::both);
  run.masks.clear();
  run.segmentation.segmenter.model = folder.path / "colours.onnx";
  run.segmentation.every = 2;
  run.max_frames = 8;
  const RunSummary summary = run_sequence(run, kNeverStop);
  REQUIRE(summary.trajectory.size() == inside.trajectory().size());
  for (std::size_t i = 0; i < summary.trajectory.size(); ++i)
    CHECK(summary.trajectory[i].T_w_c.translation() == inside.trajectory()[i].T_w_c.translation());
}

TEST_CASE("wrong input is refused with what it is and what was expected, and changes nothing") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                   kInf = std::numeric_limits<double>::infinity();
  const RawFrame& f = walk().frames[0];
  Slam slam(walk().camera);
  const auto zeros = [](int type, int w = 640, int h = 480) { return cv::Mat(cv::Mat::zeros(h, w, type)); };
  struct Wrong {
    cv::Mat image, depth;
    double t = 1.0, delay = 0;
    std::optional<Masks> prior{};
    const char* expected = "";
  };
  std::vector<Wrong> wrong;
  for (const int type : {CV_8SC3, CV_16UC1, CV_16UC3, CV_32FC1, CV_32FC3, CV_64FC3, CV_8UC2})
    wrong.push_back({zeros(type), f.depth, 1, 0, {}, "not CV_8UC3, CV_8UC4 or CV_8UC1"});
  for (const int type : {CV_8UC1, CV_8UC3, CV_16SC1, CV_16UC3, CV_32SC1, CV_64FC1, CV_32FC3, CV_16FC1})
    wrong.push_back(
        {f.bgr, zeros(type), 1, 0, {}, "not CV_16UC1 (units of the camera) or CV_32FC1 (metres)"});
  for (const auto& size : {cv::Size(320, 240), cv::Size(641, 480), cv::Size(640, 479), cv::Size(480, 640)}) {
    wrong.push_back(
        {zeros(CV_8UC3, size.width, size.height), f.depth, 1, 0, {}, "the camera's images are 640x480"});
    wrong.push_back(
        {f.bgr, zeros(CV_16UC1, size.width, size.height), 1, 0, {}, "the camera's images are 640x480"});
  }
  const std::array<int, 3> cube{4, 480, 640};
  wrong.push_back({cv::Mat(3, cube.data(), CV_8UC3), f.depth, 1, 0, {}, "the camera's images are 640x480"});
  wrong.push_back({f.bgr, cv::Mat(3, cube.data(), CV_16UC1), 1, 0, {}, "the camera's images are 640x480"});
  wrong.push_back({{}, f.depth, 1, 0, {}, "the image is empty"});
  wrong.push_back({f.bgr, {}, 1, 0, {}, "the depth image is empty"});
  for (const double t : {kNan, kInf, -kInf}) {
    wrong.push_back({f.bgr, f.depth, t, 0, {}, "is not a number"});
    wrong.push_back({f.bgr, f.depth, 1, t, {}, "is not a number"});
  }
  for (const auto& masks :
       {Masks{zeros(CV_8UC1, 10, 10), {}, {}}, Masks{zeros(CV_16UC1), {}, {}}, Masks{zeros(CV_8UC3), {}, {}},
        Masks{zeros(CV_8UC1), zeros(CV_8UC1, 10, 10), {}}, Masks{zeros(CV_8UC1), zeros(CV_32FC1), {}},
        Masks{zeros(CV_8UC1), {}, zeros(CV_8UC1)}, Masks{zeros(CV_8UC1), {}, zeros(CV_16UC1, 640, 481)}})
    wrong.push_back({f.bgr, f.depth, 1, 0, masks, "not 640x480"});
  CHECK(wrong.size() == 40);
  for (const Wrong& w : wrong) {
    const std::string message =
        test::error_of([&] { (void)slam.track(w.image, w.depth, w.t, w.prior, w.delay); });
    CAPTURE(w.expected);
    CHECK_MESSAGE(message.find(w.expected) != std::string::npos, message);
    CHECK(slam.whole());
  }
  (void)slam.track(f.bgr, f.depth, f.t);
  for (const double t : {f.t, f.t - 1e-3, -1.0, 0.0}) {
    const std::string message = test::error_of([&] { (void)slam.track(f.bgr, f.depth, t); });
    CHECK_MESSAGE(message.find("does not come after") != std::string::npos, message);
  }
  CHECK(slam.trajectory().size() == 1);
  CHECK(slam.whole());
}
