// SPDX-License-Identifier: BSD-3-Clause
// A run that is watched.
#include "dynslam/runtime/view/live_view.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>

#include "dynslam/runtime/view/view_painter.hpp"
#include "run_fixture.hpp"
#include "view/view_canvas.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using namespace std::chrono_literals;
using test::bytes, test::kNeverStop, test::options_for;

namespace {

const std::filesystem::path& looked_at() {
  static const test::WalkingSequence sequence(30);
  return sequence.path;
}

/// Keeps what it is shown, and presses keys when it is told to.
class NotedScreen : public ViewScreen {
 public:
  bool show(const cv::Mat& canvas) override {
    if (fails) throw std::runtime_error("the screen is broken");
    const std::lock_guard lock(mutex_);
    last_ = canvas.clone();
    ++shown;
    return !gone;
  }
  std::vector<ViewKey> keys() override {
    const std::lock_guard lock(mutex_);
    return std::exchange(pressed_, {});
  }
  void press(ViewKey key) {
    const std::lock_guard lock(mutex_);
    pressed_.push_back(key);
  }
  cv::Mat last() {
    const std::lock_guard lock(mutex_);
    return last_;
  }
  std::atomic<int> shown{0};
  std::atomic<bool> gone{false}, fails{false};

 private:
  std::mutex mutex_;
  cv::Mat last_;
  std::vector<ViewKey> pressed_;
};

struct Looked {
  NotedScreen screen;
  std::optional<LiveView> view;
  RunSummary summary;
};

/// Runs while it is watched. @param each  called with each frame before the view gets it
void run_looked_at(Looked& looked, const RunOptions& options, const std::atomic<bool>& stop = kNeverStop,
                   const std::function<void(const WatchedFrame&)>& each = {}) {
  looked.view.emplace(looked.screen, options, stop);
  RunWatch watch = looked.view->watch();
  const auto hand_over = watch.frame;
  watch.frame = [&](const WatchedFrame& frame) {
    if (each) each(frame);
    hand_over(frame);
  };
  looked.summary = run_sequence(
      options, stop, {},
      [&](const Sequence& sequence, const CameraConfig& camera) { looked.view->open(sequence, camera); },
      watch);
}

/// Waits for something that happens on another thread.
template <class Condition>
bool comes(Condition&& condition) {
  for (int i = 0; i < 2000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(5ms);
  }
  return false;
}

int pixels_in(const cv::Mat& canvas, const cv::Rect& part, const cv::Scalar& colour) {
  cv::Mat found;
  // Smoothed lines miss their colour by a little.
  cv::inRange(canvas(part), colour - cv::Scalar::all(6), colour + cv::Scalar::all(6), found);
  return cv::countNonZero(found);
}

}  // namespace

TEST_CASE("a run that is looked at has the results of one that is not, byte for byte") {
  const test::TemporaryFolder out;
  for (const DynamicsMode mode : {DynamicsMode::none, DynamicsMode::both}) {
    RunOptions plain = options_for(looked_at(), out.path / "plain", mode);
    plain.map = mode == DynamicsMode::both;
    RunOptions options = plain;
    options.out = out.path / "looked";
    (void)run_sequence(plain, kNeverStop);
    Looked looked;
    std::size_t seen = 0;
    run_looked_at(looked, options, kNeverStop, [&](const WatchedFrame& frame) {
      CHECK(frame.number == ++seen);
      CHECK(frame.total == 30);
      CHECK(frame.semantic.empty() == (mode == DynamicsMode::none));
    });
    CHECK(seen == 30);
    looked.view->finish();
    CHECK(looked.screen.shown > 0);
    for (const char* file :
         {"trajectory.txt", "trajectory_live.txt", "keyframes.txt", "masks/1000000.666667.png"})
      CHECK(bytes(options.out / file) == bytes(plain.out / file));
    CHECK(std::filesystem::exists(options.out / "map.sot") == plain.map);
    if (plain.map) CHECK(bytes(options.out / "map.sot") == bytes(plain.out / "map.sot"));
  }
}

TEST_CASE("a pause holds the run, with its frame, masks, path and map in view, until it is ended") {
  const test::TemporaryFolder out;
  const RunOptions options = options_for(looked_at(), out.path, DynamicsMode::both);
  Looked looked;
  std::atomic<std::size_t> tracked{0};
  std::mutex guard;
  cv::Mat image;  // what was tracked last
  std::thread who_looks([&] {
    CHECK(comes([&] { return tracked >= 12; }));
    looked.screen.press(ViewKey::pause);
    const ViewLayout layout = view_layout({});
    // It rests: the picture says why, and nothing new is tracked.
    CHECK(comes([&] {
      const cv::Mat canvas = looked.screen.last();
      return !canvas.empty() && pixels_in(canvas, layout.header, viewing::kHeld) > 20;
    }));
    std::size_t held = 0;
    CHECK(comes([&] {
      const std::size_t now = tracked;
      std::this_thread::sleep_for(300ms);
      held = tracked;
      return held == now;
    }));
    CHECK(held < 30);
    CHECK(comes([&] {
      const cv::Mat canvas = looked.screen.last();
      return !canvas.empty() && pixels_in(canvas, layout.header, viewing::kHeld) > 20 &&
             pixels_in(canvas, layout.map, cv::Scalar(0, 0, 192)) > 20;  // a chair
    }));
    // It shows the frame that is held, when that one is tracked to its end.
    cv::Mat canvas;
    CHECK(comes([&] {
      canvas = looked.screen.last();
      cv::Mat same;
      const std::lock_guard lock(guard);
      cv::inRange(cv::abs(canvas(layout.picture) - image), cv::Scalar::all(0), cv::Scalar::all(0), same);
      const int pixels = cv::countNonZero(same);  // of 307200; the rest is tinted
      return pixels > 100'000 && pixels < 300'000;
    }));
    cv::Rect plan = layout.trajectory;
    plan.y += 26;  // below its legend
    plan.height -= 26;
    CHECK(pixels_in(canvas, plan, viewing::kTruth) > 20);
    CHECK(pixels_in(canvas, plan, viewing::kRun) > 50);
    CHECK(pixels_in(canvas, layout.picture, viewing::kSemantic) > 50);  // outlines
    looked.screen.press(ViewKey::pause);
  });
  run_looked_at(looked, options, kNeverStop, [&](const WatchedFrame& frame) {
    const std::lock_guard lock(guard);
    image = frame.frame.bgr.clone();
    ++tracked;
  });
  who_looks.join();
  CHECK(looked.summary.tracked == 30);
}

TEST_CASE("a view that is closed, gone or broken lets the run go on; so does the end of a pause by Ctrl-C") {
  const test::TemporaryFolder out;
  const RunOptions options = options_for(looked_at(), out.path, DynamicsMode::none);
  SUBCASE("closed by a key") {
    Looked looked;
    looked.screen.press(ViewKey::close);
    run_looked_at(looked, options);
    CHECK(looked.view->closed());
    CHECK(looked.summary.tracked == 30);
  }
  SUBCASE("the window is gone") {
    Looked looked;
    looked.screen.gone = true;
    run_looked_at(looked, options);
    CHECK(comes([&] { return looked.view->closed(); }));
    CHECK(looked.screen.shown == 1);
    CHECK(looked.summary.tracked == 30);
  }
  SUBCASE("what goes wrong in it is said in the end") {
    Looked looked;
    looked.screen.fails = true;
    run_looked_at(looked, options);
    CHECK(looked.summary.tracked == 30);
    CHECK_THROWS_WITH_AS(looked.view->finish(), "the screen is broken", std::runtime_error);
  }
  SUBCASE("stopped in a pause") {
    Looked looked;
    std::atomic<bool> stop{false};
    looked.screen.press(ViewKey::pause);
    std::thread later([&] {
      CHECK(comes([&] { return looked.screen.shown > 1; }));
      stop = true;
    });
    run_looked_at(looked, options, stop);
    later.join();
    CHECK(looked.summary.interrupted);
    CHECK(looked.summary.tracked < 30);
  }
}

TEST_CASE("a live run is shown with its masks") {
  const test::TemporaryFolder out;
  RunOptions options = options_for(looked_at(), out.path, DynamicsMode::both);
  options.schedule = Schedule::live;
  options.live_speed = 1000;
  options.live.queue = 1000;
  std::size_t with_masks = 0, frames = 0;
  Looked looked;
  run_looked_at(looked, options, kNeverStop, [&](const WatchedFrame& frame) {
    ++frames;
    with_masks += cv::countNonZero(frame.semantic) > 0 ? 1 : 0;
    CHECK(frame.frame.bgr.size() == cv::Size(640, 480));
  });
  CHECK(frames == 30);
  CHECK(with_masks > 20);
  CHECK(comes([&] { return looked.screen.shown > 0; }));
}
