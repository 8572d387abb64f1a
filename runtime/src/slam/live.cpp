// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/live.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/slam/frame_preparation.hpp"
#include "dynslam/runtime/threads/bounded_queue.hpp"
#include "io/argument_check.hpp"
#include "io/frame_of_images.hpp"
#include "nets/late_masks.hpp"
#include "slam/input_check.hpp"
#include "threads/thread_priority.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::array kSchedules{Schedule::deterministic, Schedule::live};

double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// The system itself; its network has a thread of its own here.
std::unique_ptr<Slam> slam_without_network(const CameraConfig& camera, const SlamOptions& options) {
  SlamOptions own(options);
  own.network.reset();
  return std::make_unique<Slam>(camera, own);
}

std::unique_ptr<LateMasks> late_masks(const SlamOptions& options, const LiveOptions& live) {
  check_argument(live.mask_age >= 0, "LiveOptions: `mask_age` must not be negative");
  if (!options.network) return nullptr;
  if (!uses_semantic(options.dynamics))
    throw UsageError("SlamOptions: a network needs the mode `semantic` or `both`");
  return std::make_unique<LateMasks>(*options.network, live.mask_age);
}

}  // namespace

std::optional<Schedule> parse_schedule(std::string_view name) {
  for (const Schedule one : kSchedules) {
    if (name == to_string(one)) return one;
  }
  return std::nullopt;
}

std::string_view to_string(Schedule schedule) {
  return schedule == Schedule::live ? "live" : "deterministic";
}

struct LiveSlam::State {
  /// A frame on its way.
  struct Item {
    std::size_t index = 0;
    double pushed_at = 0;  // [s] of the clock
    RgbdFrame frame;       // its images are empty where these two are not
    cv::Mat image, depth;  // as the camera gave them, copied
    std::optional<Masks> prior{};
    std::optional<double> mask_age{};
    double network_ms = 0, keeper_ms = 0;
  };

  State(const CameraConfig& c, const SlamOptions& options, const LiveOptions& live)
      : camera(c),
        live_options(live),
        clock(live.clock ? live.clock : &steady_seconds),
        slam(slam_without_network(c, options)),
        preparation(options.tracker),
        masks(late_masks(options, live)),
        waiting(live.queue) {
    preparing = std::jthread([this](const std::stop_token& stop) {
      step_back(StepBack::some);
      guarded([&] { prepare_frames(stop); });
    });
    tracking = std::jthread([this](const std::stop_token& stop) { guarded([&] { track_frames(stop); }); });
  }
  ~State() {
    // All are told before any is waited for.
    preparing.request_stop();
    tracking.request_stop();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  /// One thread at a time uses the system.
  struct Use {
    explicit Use(State& s) : state(s), lock(s.in_use) { state.in_slam = std::this_thread::get_id(); }
    ~Use() { state.in_slam = std::thread::id(); }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    State& state;
    std::lock_guard<std::mutex> lock;
  };

  template <class Work>
  void guarded(Work&& work) {
    try {
      work();
    } catch (...) {
      fail(std::current_exception());
    }
  }
  void fail(const std::exception_ptr& what) {
    const std::lock_guard lock(mutex);
    if (!failure) failure = what;
    waiting.close(failure);
    ready.close();
    changed.notify_all();
  }
  void check_not_tracking(const char* message) const {
    check_argument(in_slam.load() != std::this_thread::get_id(), message);
  }

  /// Throws what ended the tracking.
  void check_not_failed() {
    const std::lock_guard lock(mutex);
    if (failure) std::rethrow_exception(failure);
  }

  void push(Item item) {
    item.pushed_at = clock();
    {
      const std::lock_guard lock(mutex);
      if (failure) std::rethrow_exception(failure);
      last_t = item.frame.t;
      item.index = count.pushed++;
    }
    if (!waiting.push_newest(std::move(item))) return;
    const std::lock_guard lock(mutex);
    ++count.dropped;
    changed.notify_all();
  }
  void prepare_frames(const std::stop_token& stop);
  void prepare(Item& item);
  void track_frames(const std::stop_token& stop);
  void track(Item& item);
  void finish();

  CameraConfig camera;
  LiveOptions live_options;
  std::function<double()> clock;
  std::unique_ptr<Slam> slam;
  std::mutex in_use;                       // of slam
  std::atomic<std::thread::id> in_slam{};  // who uses it
  FramePreparation preparation;
  std::unique_ptr<LateMasks> masks;

  std::mutex pushing;  // one frame after the other
  mutable std::mutex mutex;
  std::condition_variable changed;
  LiveStatistics count;
  std::size_t finished = 0;  // frames that were tracked or lost, and told of
  std::vector<float> latencies;
  std::optional<double> last_t;  // of the last frame pushed [s]
  std::exception_ptr failure;

  BoundedQueue<Item> waiting, ready{1};
  std::jthread preparing, tracking;  // last: they use all of the above
};

void LiveSlam::State::prepare_frames(const std::stop_token& stop) {
  // A frame is taken when there is a use for it: one that waits is as new as it can be.
  while (ready.wait_for_room(stop)) {
    std::optional<Item> item = waiting.pop(stop);
    if (!item) return;
    prepare(*item);
    if (!ready.push(std::move(*item), stop)) return;
  }
}

void LiveSlam::State::prepare(Item& item) {
  RgbdFrame& frame = item.frame;
  if (!item.image.empty()) {
    const double delay = frame.depth_delay;
    frame = frame_of_images(item.image, item.depth, {frame.t, frame.ns}, camera);
    frame.depth_delay = delay;
    item.image.release();
    item.depth.release();
  }
  frame.index = item.index;
  if (!frame.features) preparation(frame);
  if (item.prior) item.mask_age = 0;
  if (!masks) return;
  LateMasks::Carried carried = masks->next(frame);
  item.network_ms = carried.network_ms;
  item.keeper_ms = carried.keeper_ms;
  if (item.prior || !carried.masks) return;
  item.prior = std::move(carried.masks);
  item.mask_age = carried.age;
}

void LiveSlam::State::track_frames(const std::stop_token& stop) {
  while (std::optional<Item> item = ready.pop(stop)) track(*item);
}

void LiveSlam::State::track(Item& item) {
  LiveResult result;
  result.index = item.index;
  result.t = item.frame.t;
  result.ns = item.frame.ns;
  result.stamp = item.frame.stamp;
  result.mask_age = item.mask_age;
  result.network_ms = item.network_ms;
  result.keeper_ms = item.keeper_ms;
  result.frame = &item.frame;
  result.prior = item.prior ? &*item.prior : nullptr;
  const Use use(*this);
  result.track = slam->track(item.frame, item.prior);
  result.latency = clock() - item.pushed_at;
  {
    const std::lock_guard lock(mutex);
    ++(result.track.ok() ? count.tracked : count.lost);
    latencies.push_back(static_cast<float>(result.latency));
  }
  if (live_options.result) live_options.result(result);
  const std::lock_guard lock(mutex);
  ++finished;
  changed.notify_all();
}

void LiveSlam::State::finish() {
  {
    std::unique_lock lock(mutex);
    changed.wait(lock, [this] { return failure || finished + count.dropped == count.pushed; });
    if (failure) std::rethrow_exception(failure);
  }
  const Use use(*this);
  slam->finish();
}

LiveSlam::LiveSlam(const CameraConfig& camera, const SlamOptions& options, const LiveOptions& live)
    : state_(std::make_unique<State>(camera, options, live)) {}

LiveSlam::~LiveSlam() = default;

void LiveSlam::push(const cv::Mat& image, const cv::Mat& depth, double t, double depth_delay) {
  push_images(image, depth, {t, 0}, depth_delay);
}

void LiveSlam::push(const cv::Mat& image, const cv::Mat& depth, std::chrono::nanoseconds t,
                    double depth_delay) {
  push_images(image, depth, time_of(t.count()), depth_delay);
}

void LiveSlam::push_images(const cv::Mat& image, const cv::Mat& depth, const TimeStamp& time,
                           double depth_delay) {
  const std::lock_guard one(state_->pushing);
  state_->check_not_failed();  // before what is wrong with a frame that nobody will see
  check_images(image, depth, time.t, state_->camera);
  State::Item item;
  item.frame.t = time.t;
  item.frame.ns = time.ns;
  item.frame.depth_delay = depth_delay;
  check_times(item.frame, state_->last_t);
  item.image = image.clone();
  item.depth = depth.clone();
  state_->push(std::move(item));
}

void LiveSlam::push(const RgbdFrame& frame, const std::optional<Masks>& prior) {
  const std::lock_guard one(state_->pushing);
  state_->check_not_failed();
  check_input(frame, prior, state_->camera, state_->last_t);
  State::Item item;
  item.frame = frame;
  item.prior = prior;
  state_->push(std::move(item));
}

void LiveSlam::finish() {
  state_->check_not_tracking("LiveSlam::finish() must not be called by a function of the options");
  state_->finish();
}

LiveStatistics LiveSlam::statistics() const {
  const State& s = *state_;
  LiveStatistics result;
  std::vector<float> sorted;
  {
    const std::lock_guard lock(s.mutex);
    result = s.count;
    sorted = s.latencies;
  }
  if (s.masks) result.masks = s.masks->seen();
  if (sorted.empty()) return result;
  std::sort(sorted.begin(), sorted.end());
  result.latency_median = static_cast<double>(sorted[sorted.size() / 2]);
  result.latency_p95 = static_cast<double>(
      sorted[static_cast<std::size_t>(static_cast<double>(sorted.size() - 1) * 0.95 + 0.5)]);
  result.latency_max = static_cast<double>(sorted.back());
  return result;
}

Slam& LiveSlam::slam() {
  return *state_->slam;
}

}  // namespace dynslam::runtime
