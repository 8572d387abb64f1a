// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/view/live_view.hpp"

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/view/view_painter.hpp"
#include "run/run_request.hpp"
#include "threads/thread_priority.hpp"
#include "view/work_share.hpp"

namespace dynslam::runtime {
namespace {

using namespace std::chrono_literals;
using viewing::WorkShare;

constexpr auto kBetweenPictures = 30ms;  // more than a screen shows
constexpr auto kBetweenKeys = 50ms;      // while no frame comes

using Poses = std::vector<StampedPose<double>>;

/// The ground truth of the time that the estimate covers, moved to where it lies beside it.
Poses beside(const Poses& estimate, const Poses& truth) {
  if (estimate.empty() || truth.empty()) return {};
  const auto ate = absolute_trajectory_error<double>(estimate, truth);
  if (!ate) return {};
  const SE3<double> T_est_gt = ate->T_gt_est.inverse();
  constexpr double kMargin = 0.02;  // seconds that poses of one time may be apart
  Poses result;
  for (const auto& pose : truth) {
    if (pose.t < estimate.front().t - kMargin || pose.t > estimate.back().t + kMargin) continue;
    result.push_back({pose.t, T_est_gt * pose.T_w_c, pose.ns});
  }
  return result;
}

void copy_mask(const cv::Mat& mask, cv::Mat& to) {
  if (mask.empty()) {
    to.release();
  } else {
    mask.copyTo(to);
  }
}

}  // namespace

struct LiveView::State {
  /// What came since the last picture.
  struct News {
    ViewFrame frame;
    bool fresh = false;          // the frame is one
    std::optional<Poses> whole;  // the trajectory, where it was asked for
    Poses more;                  // poses after it
    std::optional<std::vector<ViewVoxel>> voxels;
  };

  State(ViewScreen& s, const RunOptions& o, const std::atomic<bool>& stop_run)
      : screen(s), stop(stop_run), dynamics(o.dynamics), map(o.map) {
    scene.classes = map_classes(o);
  }

  void see(const WatchedFrame& seen);
  void take(const WatchedFrame& seen);
  void wait_while_paused(std::unique_lock<std::mutex>& lock);
  void draw_pictures(const std::stop_token& ended);
  bool take_news(const std::stop_token& ended);
  void answer_keys();
  void close();

  ViewScreen& screen;
  const std::atomic<bool>& stop;
  DynamicsMode dynamics;
  bool map;

  // Of the thread that tracks.
  std::optional<double> t0;  // of the first frame [s]
  bool corrected = true;     // poses that were handed over are others now
  WorkShare of_tracker{20};
  // Of the octree's.
  WorkShare of_mapper{10};
  // Of all, with the mutex.
  std::mutex mutex;
  std::condition_variable_any changed;
  News news;
  bool paused = false;
  std::atomic<bool> closed{false};
  std::exception_ptr failure;
  // Of the thread that draws.
  std::optional<ViewPainter> painter;
  Poses truth;
  ViewScene scene;
  WorkShare of_drawing{10};
  std::jthread drawing;  // last: it uses all of the above
};

/// On the thread that tracks: one copy, and on.
void LiveView::State::see(const WatchedFrame& seen) {
  if (closed) return;
  std::unique_lock lock(mutex);
  take(seen);
  changed.notify_all();
  wait_while_paused(lock);
}

void LiveView::State::take(const WatchedFrame& seen) {
  const TrackResult& result = seen.result;
  ViewFrame& f = news.frame;  // its images' memory is used again
  if (!t0) t0 = seen.frame.t;
  f.number = seen.number;
  f.total = seen.total;
  f.seconds = seen.frame.t - *t0;
  f.state = result.state;
  f.keyframe = result.keyframe;
  f.matches = result.matches;
  f.inliers = result.inliers;
  f.bgr = seen.frame.bgr;  // nobody changes it
  copy_mask(seen.semantic, f.semantic);
  f.keypoints.clear();
  const MotionResult<double>* motion = seen.slam.motion();
  if (motion != nullptr && motion->mask.width() > 0) {
    copy_mask(cv::Mat(motion->mask.height(), motion->mask.width(), CV_8UC1,
                      const_cast<std::uint8_t*>(motion->mask.data())),  // OpenCV has no read-only matrices
              f.geometric);
  } else {
    f.geometric.release();
  }
  if (motion != nullptr) {
    for (const JudgedMatch<double>& m : motion->matches)
      f.keypoints.push_back({cv::Point2f(float(m.x_m.x()), float(m.x_m.y())), m.weight});
  }
  news.fresh = true;
  // All poses are asked for where a keyframe may have moved them, which takes longer the longer the run is.
  corrected = corrected || result.keyframe;
  if (corrected && of_tracker.due()) {
    of_tracker.spend([&] { news.whole = seen.slam.trajectory(); });
    news.more.clear();
    corrected = false;
  } else if (result.ok()) {
    news.more.push_back({seen.frame.t, result.T_w_c, seen.frame.ns});
  }
}

void LiveView::State::wait_while_paused(std::unique_lock<std::mutex>& lock) {
  while (paused && !closed && !stop.load()) changed.wait_for(lock, 100ms);
}

void LiveView::State::close() {
  const std::lock_guard lock(mutex);
  closed = true;
  changed.notify_all();
}

void LiveView::State::answer_keys() {
  for (const ViewKey key : screen.keys()) {
    if (key == ViewKey::close) {
      close();
      return;
    }
    const std::lock_guard lock(mutex);
    paused = !paused;
    changed.notify_all();
  }
}

/// Waits for something new, but not long. @return whether there is
bool LiveView::State::take_news(const std::stop_token& ended) {
  News now;
  {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, ended, kBetweenKeys,
                     [this] { return news.fresh || news.voxels || paused != scene.paused; });
    if (!news.fresh && !news.voxels && paused == scene.paused) return false;
    scene.paused = paused;
    now.whole = std::exchange(news.whole, std::nullopt);
    now.more.swap(news.more);
    now.voxels = std::exchange(news.voxels, std::nullopt);
    if (news.fresh) std::swap(scene.frame, news.frame);
    news.fresh = false;
  }
  if (now.whole) scene.trajectory = std::move(*now.whole);
  scene.trajectory.insert(scene.trajectory.end(), now.more.begin(), now.more.end());
  if (now.voxels) {
    scene.voxels = std::move(*now.voxels);
    ++scene.map_version;
  }
  if (of_drawing.due()) of_drawing.spend([&] { scene.truth = beside(scene.trajectory, truth); });
  return true;
}

void LiveView::State::draw_pictures(const std::stop_token& ended) {
  step_back(StepBack::some);
  while (!ended.stop_requested() && !closed) {
    answer_keys();
    if (closed) return;
    const auto begin = std::chrono::steady_clock::now();
    if (!take_news(ended)) continue;
    if (!screen.show(painter->paint(scene))) {
      close();
      return;
    }
    std::this_thread::sleep_until(begin + kBetweenPictures);
  }
}

LiveView::LiveView(ViewScreen& screen, const RunOptions& options, const std::atomic<bool>& stop)
    : state_(std::make_unique<State>(screen, options, stop)) {}

LiveView::~LiveView() {
  state_->close();
}

void LiveView::open(const Sequence& sequence, const CameraConfig& camera) {
  State& s = *state_;
  s.truth = sequence.groundtruth;
  PainterOptions options;
  options.image = {camera.width, camera.height};
  options.dynamics = s.dynamics;
  options.map = s.map;
  options.truth = !s.truth.empty();
  s.painter.emplace(options);
  s.drawing = std::jthread([&s](const std::stop_token& ended) {
    try {
      s.draw_pictures(ended);
    } catch (...) {
      s.failure = std::current_exception();
      s.close();
    }
  });
}

RunWatch LiveView::watch() {
  RunWatch result;
  State* const s = state_.get();
  result.frame = [s](const WatchedFrame& seen) { s->see(seen); };
  if (!s->map) return result;
  result.mapped = [s](const interop::SemanticOcTree& tree) {
    if (s->closed || !s->of_mapper.due()) return;
    s->of_mapper.spend([&] {
      std::vector<ViewVoxel> voxels = view_voxels(tree);
      const std::lock_guard lock(s->mutex);
      s->news.voxels = std::move(voxels);
      s->changed.notify_all();
    });
  };
  return result;
}

void LiveView::finish() {
  state_->close();
  if (state_->drawing.joinable()) state_->drawing.join();
  if (state_->failure) std::rethrow_exception(std::exchange(state_->failure, nullptr));
}

bool LiveView::closed() const {
  return state_->closed;
}

}  // namespace dynslam::runtime
