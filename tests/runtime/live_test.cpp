// SPDX-License-Identifier: BSD-3-Clause
// A camera that does not wait: what is dropped, what is told, what another thread meets.
#include "dynslam/runtime/live.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <semaphore>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "error_text.hpp"
#include "run_fixture.hpp"
#include "tiny_onnx.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr std::size_t kLiveFrames = 24;

struct CameraImage {
  cv::Mat bgr, depth;  // CV_8UC3, CV_16UC1
  double t = 0, depth_delay = 0;
};

/// Rendered once for all tests of this file.
struct LiveWalk {
  test::WalkingSequence folder{static_cast<int>(kLiveFrames)};
  CameraConfig camera;
  std::vector<CameraImage> images;

  LiveWalk() {
    const Sequence sequence = load_sequence(folder.path);
    camera = load_camera(sequence.camera_hint);
    for (const FrameRecord& f : sequence.frames)
      images.push_back({cv::imread(f.rgb.string()), cv::imread(f.depth.string(), cv::IMREAD_UNCHANGED),
                        f.t_rgb, f.t_depth - f.t_rgb});
  }
};

const LiveWalk& live_walk() {
  static const LiveWalk made;
  return made;
}

void push(LiveSlam& live, std::size_t i) {
  const CameraImage& image = live_walk().images[i];
  cv::Mat bgr = image.bgr.clone(), depth = image.depth.clone();
  live.push(bgr, depth, image.t, image.depth_delay);
  bgr.setTo(0);  // the camera's again
  depth.setTo(0);
}

/// Keeps whoever comes until it is opened.
class Gate {
 public:
  void pass() {
    std::unique_lock lock(mutex_);
    arrived_ = true;
    changed_.notify_all();
    changed_.wait(lock, [this] { return open_; });
  }
  void wait_for_one() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return arrived_; });
  }
  void open() {
    const std::lock_guard lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool arrived_ = false, open_ = false;
};

SlamOptions geometric_alone() {
  SlamOptions options;
  options.map = false;
  return options;
}

/// Pushes all frames, each when the one before was tracked.
void push_in_step(const SlamOptions& options, LiveOptions live_options,
                  const std::function<void(LiveSlam&)>& then) {
  std::counting_semaphore<1000> done(0);
  const auto given = live_options.result;
  live_options.result = [&](const LiveResult& r) {
    if (given) given(r);
    done.release();
  };
  LiveSlam live(live_walk().camera, options, live_options);
  for (std::size_t i = 0; i < kLiveFrames; ++i) {
    push(live, i);
    done.acquire();
  }
  live.finish();
  then(live);
}

bool same_poses(const Slam& a, const Slam& b) {
  const auto x = a.trajectory(), y = b.trajectory();
  return std::equal(x.begin(), x.end(), y.begin(), y.end(), [](const auto& p, const auto& q) {
    return p.t == q.t && p.T_w_c.matrix() == q.T_w_c.matrix();
  });
}

}  // namespace

TEST_CASE("with time enough nothing is dropped, and the results are those of frames that are waited for") {
  SlamOptions options;
  Slam expected(live_walk().camera, options);
  for (const CameraImage& f : live_walk().images)
    (void)expected.track(f.bgr, f.depth, f.t, std::nullopt, f.depth_delay);
  expected.finish();
  std::vector<LiveResult> results;
  LiveOptions live_options;
  live_options.result = [&](const LiveResult& r) { results.push_back(r); };
  push_in_step(options, live_options, [&](LiveSlam& live) {
    CHECK(same_poses(live.slam(), expected));
    CHECK(live.slam().octree()->size() == expected.octree()->size());
    const LiveStatistics s = live.statistics();
    CHECK(s.pushed == kLiveFrames);
    CHECK(s.dropped == 0);
    CHECK(s.tracked == kLiveFrames);
    CHECK(s.lost == 0);
  });
  REQUIRE(results.size() == kLiveFrames);
  for (std::size_t i = 0; i < results.size(); ++i) {
    CHECK(results[i].index == i);
    CHECK(results[i].t == live_walk().images[i].t);
    CHECK(results[i].latency > 0);
    CHECK_FALSE(results[i].mask_age);
  }
}

TEST_CASE(
    "frames that come too fast: the oldest are dropped and counted, none twice, the newest always there") {
  for (const std::size_t queue : {std::size_t(1), std::size_t(5)}) {
    CAPTURE(queue);
    Gate gate;
    std::vector<std::size_t> tracked;
    LiveOptions live_options;
    live_options.queue = queue;
    live_options.result = [&](const LiveResult& r) {
      tracked.push_back(r.index);
      gate.pass();
    };
    LiveSlam live(live_walk().camera, geometric_alone(), live_options);
    push(live, 0);
    gate.wait_for_one();  // the first frame is being told, and takes its time
    for (std::size_t i = 1; i < kLiveFrames; ++i) push(live, i);
    CHECK(live.statistics().pushed == kLiveFrames);
    // Beside those in the queue one is prepared, or about to be.
    const std::size_t early = live.statistics().dropped;
    CHECK(early <= kLiveFrames - 1 - queue);
    CHECK(early >= kLiveFrames - 2 - queue);
    gate.open();
    live.finish();
    const LiveStatistics s = live.statistics();
    CHECK(tracked.size() + s.dropped == kLiveFrames);
    CHECK(s.tracked + s.lost == tracked.size());
    CHECK(s.dropped == early);
    CHECK(std::is_sorted(tracked.begin(), tracked.end(), std::less_equal<>()));
    CHECK(tracked.front() == 0);
    for (std::size_t k = 0; k < queue; ++k)
      CHECK(std::find(tracked.begin(), tracked.end(), kLiveFrames - 1 - k) != tracked.end());
    CHECK(live.slam().trajectory().size() == s.tracked);
  }
}

TEST_CASE("latencies are those between push and result, and finish() lets more frames follow") {
  // A clock that is read when a frame is pushed and when it is tracked, one after the other here.
  std::atomic<int> readings{0};
  LiveOptions live_options;
  live_options.clock = [&] {
    const int reading = readings++;
    const int frame = reading / 2;
    return 100.0 * frame + (reading % 2 == 0 ? 0 : 0.001 * (frame + 1));
  };
  std::vector<double> told;
  live_options.result = [&](const LiveResult& r) { told.push_back(r.latency); };
  push_in_step(geometric_alone(), live_options, [&](LiveSlam& live) {
    REQUIRE(told.size() == kLiveFrames);
    for (std::size_t i = 0; i < told.size(); ++i)
      CHECK(told[i] == doctest::Approx(0.001 * static_cast<double>(i + 1)));
    const LiveStatistics s = live.statistics();
    CHECK(s.latency_max == doctest::Approx(0.001 * kLiveFrames));
    CHECK(s.latency_median == doctest::Approx(0.001 * (kLiveFrames / 2 + 1)));
    CHECK(s.latency_p95 == doctest::Approx(0.001 * 23));
    const CameraImage& image = live_walk().images[0];
    live.push(image.bgr, image.depth, live_walk().images.back().t + 0.03);
    live.finish();
    CHECK(live.statistics().pushed == kLiveFrames + 1);
    CHECK(told.size() == kLiveFrames + 1);
  });
}

TEST_CASE("what a function throws, and what the map meets, reaches the camera's thread and finish()") {
  SUBCASE("a result") {
    LiveOptions live_options;
    live_options.result = [](const LiveResult& r) {
      if (r.index == 3) throw std::runtime_error("the network socket is gone");
    };
    LiveSlam live(live_walk().camera, geometric_alone(), live_options);
    const auto all = [&] {
      for (std::size_t i = 0; i < kLiveFrames; ++i) {
        push(live, i);
        while (live.statistics().tracked + live.statistics().dropped <= i && i <= 3)
          std::this_thread::yield();
      }
      live.finish();
    };
    CHECK_THROWS_WITH_AS(all(), "the network socket is gone", std::runtime_error);
    CHECK_THROWS_WITH_AS(live.finish(), "the network socket is gone", std::runtime_error);
    // Whatever is wrong with a frame: this one is as old as the first.
    CHECK_THROWS_WITH_AS(push(live, 0), "the network socket is gone", std::runtime_error);
    CHECK(live.slam().trajectory().size() == 4);
    CHECK(live.slam().whole());
  }
  SUBCASE("the octree's limit") {
    SlamOptions options;
    options.map_memory = 1000;  // bytes: the first keyframe is too many
    LiveSlam live(live_walk().camera, options);
    const auto all = [&] {
      for (std::size_t i = 0; i < kLiveFrames; ++i) push(live, i);
      live.finish();
    };
    CHECK_THROWS(all());
    CHECK_FALSE(live.slam().whole());
  }
  SUBCASE("an event") {
    SlamOptions options = geometric_alone();
    options.events.keyframe = [](const KeyframeEvent&) { throw std::runtime_error("no"); };
    LiveSlam live(live_walk().camera, options);
    push(live, 0);
    CHECK_THROWS_WITH_AS(live.finish(), "no", std::runtime_error);
  }
}

TEST_CASE("it can end at any time: with frames that wait, without any, while it is full") {
  { const LiveSlam never_used(live_walk().camera, geometric_alone()); }
  for (std::size_t frames = 1; frames <= 8; ++frames) {
    std::atomic<std::size_t> told{0};
    {
      LiveOptions live_options;
      live_options.queue = 8;
      live_options.result = [&](const LiveResult&) { ++told; };
      LiveSlam live(live_walk().camera, geometric_alone(), live_options);
      for (std::size_t i = 0; i < frames; ++i) push(live, i);
    }
    CHECK(told <= frames);
  }
}

TEST_CASE(
    "wrong frames are refused by push() and leave no trace; finish() is refused where it would never end") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const CameraImage& f = live_walk().images[1];
  std::unique_ptr<LiveSlam> live;
  std::string refusal;
  LiveOptions live_options;
  live_options.result = [&](const LiveResult&) {
    try {
      live->finish();
    } catch (const UsageError& error) {
      refusal = error.what();
    }
  };
  live = std::make_unique<LiveSlam>(live_walk().camera, geometric_alone(), live_options);
  push(*live, 0);
  const auto error = [&](const cv::Mat& image, const cv::Mat& depth, double t) {
    return test::error_of([&] { live->push(image, depth, t); });
  };
  CHECK(error({}, f.depth, f.t).find("the image is empty") != std::string::npos);
  CHECK(error(f.bgr, cv::Mat::zeros(10, 10, CV_16UC1), f.t).find("640x480") != std::string::npos);
  CHECK(error(f.bgr, f.bgr, f.t).find("not CV_16UC1") != std::string::npos);
  CHECK(error(f.bgr, f.depth, kNan).find("is not a number") != std::string::npos);
  CHECK(error(f.bgr, f.depth, live_walk().images[0].t).find("does not come after") != std::string::npos);
  RgbdFrame frame;
  frame.t = f.t;
  CHECK(test::error_of([&] { live->push(frame); }).find("the grey image is empty") != std::string::npos);
  live->finish();
  CHECK(live->statistics().pushed == 1);
  CHECK(refusal.find("LiveSlam::finish()") != std::string::npos);
  LiveOptions negative;
  negative.mask_age = -1;
  CHECK_THROWS_AS(LiveSlam(live_walk().camera, {}, negative), UsageError);
  SlamOptions network;
  network.network.emplace();
  CHECK_THROWS_WITH_AS(LiveSlam(live_walk().camera, network), doctest::Contains("`semantic` or `both`"),
                       UsageError);
}

TEST_CASE("two systems at once do not know of each other") {
  Slam expected(live_walk().camera, geometric_alone());
  for (const CameraImage& f : live_walk().images)
    (void)expected.track(f.bgr, f.depth, f.t, std::nullopt, f.depth_delay);
  expected.finish();
  std::array<bool, 2> same{};
  {
    std::vector<std::jthread> cameras;
    for (bool& mine : same)
      cameras.emplace_back([&] {
        push_in_step(geometric_alone(), {},
                     [&](LiveSlam& live) { mine = same_poses(live.slam(), expected); });
      });
  }
  CHECK(same[0]);
  CHECK(same[1]);
}

TEST_CASE("masks of a network come late and are carried to the frames; masks of a frame's own are its own") {
  const test::TemporaryFolder folder;
  test::write_onnx(folder.path / "colours.onnx", test::colour_network());
  SlamOptions options = geometric_alone();
  options.dynamics = DynamicsMode::semantic;
  options.network.emplace();
  options.network->segmenter.model = folder.path / "colours.onnx";
  LiveOptions live_options;
  live_options.mask_age = 10;
  std::vector<LiveResult> results;
  live_options.result = [&](const LiveResult& r) { results.push_back(r); };
  std::size_t seen = 0;
  push_in_step(options, live_options, [&](LiveSlam& live) { seen = live.statistics().masks; });
  REQUIRE(results.size() == kLiveFrames);
  CHECK_FALSE(results[0].mask_age);  // the network has just been given it
  std::size_t carried = 0;
  for (const LiveResult& r : results) {
    CHECK((r.mask_carried() || cv::countNonZero(r.track.dynamic_mask) == 0));
    carried += r.mask_carried() ? 1 : 0;
    if (r.mask_age) CHECK(*r.mask_age < live_walk().images.back().t - live_walk().images.front().t + 1e-6);
  }
  CHECK((seen > 0) == (carried > 0));
  CHECK(seen <= carried);

  options.network->keep = false;
  CHECK_THROWS_WITH_AS(LiveSlam(live_walk().camera, options), doctest::Contains("must be true"), UsageError);

  options.network.reset();
  std::optional<double> age;
  live_options.result = [&](const LiveResult& r) { age = r.mask_age; };
  LiveSlam live(live_walk().camera, options, live_options);
  const Sequence sequence = load_sequence(live_walk().folder.path);
  MaskSource masks(live_walk().folder.path / "label");
  live.push(decode_frame(sequence.frames[0], 0, live_walk().camera),
            masks.read(sequence.frames[0].stamp, live_walk().camera.width, live_walk().camera.height));
  live.finish();
  CHECK(age == 0.0);
}
