// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "dynslam/runtime/io/time_stamp.hpp"
#include "dynslam/runtime/slam.hpp"

namespace dynslam::runtime {

/// What happens with frames that come faster than they are tracked.
enum class Schedule {
  deterministic,  ///< each is waited for: the same frames give the same results
  live            ///< the oldest are dropped: the results depend on the machine's speed
};
/// A schedule by its name; empty: there is none of that name.
[[nodiscard]] std::optional<Schedule> parse_schedule(std::string_view name);
/// Name of a schedule.
[[nodiscard]] std::string_view to_string(Schedule schedule);

/// A frame that was tracked while the camera went on.
struct LiveResult {
  std::size_t index = 0;  ///< of the frame among those pushed, from 0; what is left out was dropped
  double t = 0;           ///< its time [s]
  std::int64_t ns = 0;    ///< the same in nanoseconds, as it was pushed; 0: unknown
  std::string stamp;      ///< its time as text, as it was pushed or with 6 decimals
  TrackResult track;
  double latency = 0;  ///< from push() until now [s]
  /// Time from the frame that the a-priori masks were found in to this one [s]; 0: they are its own; nullopt:
  /// there were none, or they were too old.
  std::optional<double> mask_age{};
  double network_ms = 0, keeper_ms = 0;  ///< of masks that came new with this frame; of carrying them here
  const RgbdFrame* frame = nullptr;      ///< what was tracked; valid during the call
  const Masks* prior = nullptr;          ///< its a-priori masks; null: none; valid during the call
  [[nodiscard]] bool mask_carried() const { return mask_age && *mask_age > 0; }
};

/// Options of LiveSlam.
struct LiveOptions {
  std::size_t queue = 1;  ///< frames that wait beside the two at work; one too many drops the oldest
  double mask_age = 1.5;  ///< time that a network's masks are carried forward at most [s]
  /// Called with each frame's result on the thread that tracks, whose time it takes.
  std::function<void(const LiveResult&)> result{};
  /// Seconds that latencies are measured in, on any thread; empty: a steady clock.
  std::function<double()> clock{};
};

/// What LiveSlam has done so far.
struct LiveStatistics {
  std::size_t pushed = 0;                                       ///< frames that came
  std::size_t dropped = 0;                                      ///< of these, never tracked
  std::size_t tracked = 0;                                      ///< with a pose
  std::size_t lost = 0;                                         ///< without one
  std::size_t masks = 0;                                        ///< frames that the network saw
  double latency_median = 0, latency_p95 = 0, latency_max = 0;  ///< of what was not dropped [s]
};

/// RGB-D SLAM from a camera that does not wait:
///
///     LiveOptions live;
///     live.result = [&](const LiveResult& r) { if (r.track.ok()) publish(r.t, r.track.T_w_c); };
///     LiveSlam slam(load_camera("fr3"), {}, live);
///     slam.push(bgr, depth, t);   // in the camera's thread, at once
///     ...
///     slam.finish();
///     slam.slam().trajectory();
///
/// Three threads of its own: one prepares a frame (features) while the one before is tracked on the second;
/// on the third the network of SlamOptions sees the newest frame whenever it is free. Its masks come late and
/// are carried to the present by optical flow and depth (MaskKeeper).
///
/// What another thread meets (a function that throws, the octree's limit) ends the tracking, and every push()
/// and finish() after it throws that; slam() still has what was tracked. Where no frame is dropped and no
/// network is used, the results are those of Slam, to the last bit.
class LiveSlam {
 public:
  /// @throws what Slam's constructor throws; UsageError for options that contradict each other
  explicit LiveSlam(const CameraConfig& camera, const SlamOptions& options = {},
                    const LiveOptions& live = {});
  /// Drops what waits; finish() comes before where that is to be tracked.
  ~LiveSlam();
  LiveSlam(const LiveSlam&) = delete;
  LiveSlam& operator=(const LiveSlam&) = delete;

  /// Hands over a frame, see Slam::track(). Never waits for the tracking; the images are copied. One thread
  /// at a time. @throws InputError with what it got and what was expected; what another thread met
  void push(const cv::Mat& image, const cv::Mat& depth, double t, double depth_delay = 0);
  /// The same with a time that keeps its nanoseconds.
  void push(const cv::Mat& image, const cv::Mat& depth, std::chrono::nanoseconds t, double depth_delay = 0);
  /// The same for a frame in the form that Slam keeps, with masks of its own where it has them. Its images
  /// must not change afterwards.
  void push(const RgbdFrame& frame, const std::optional<Masks>& prior = std::nullopt);

  /// Waits until all frames are tracked that were pushed and not dropped, and for what is computed beside
  /// them. More frames may follow. Not to be called by the functions of the options (UsageError).
  /// @throws what another thread met
  void finish();

  [[nodiscard]] LiveStatistics statistics() const;
  /// The system that tracks. It may be used by the functions of the options, before the first frame, and
  /// after finish() until the next frame.
  [[nodiscard]] Slam& slam();

 private:
  struct State;
  void push_images(const cv::Mat& image, const cv::Mat& depth, const TimeStamp& time, double depth_delay);
  std::unique_ptr<State> state_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
