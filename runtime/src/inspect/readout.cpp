// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/inspect/readout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "median.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::size_t kMaxTrials = 12;
constexpr double kSettled = 0.0005;  // between two trials [s]
constexpr double kTooVague = 0.001;  // standard deviation [s]: the camera hardly moves

ReadoutTrial try_readout(const Sequence& sequence, CameraConfig camera, double assumed) {
  camera.readout_time = assumed;
  TrackerOptions options;
  options.dynamics = DynamicsMode::geometric;
  // A point of a surface just come into view stands where the assumed time puts it, and speaks for that.
  options.additions = additions(options.method, options.dynamics);
  options.additions->proven_points = true;
  Tracker tracker(camera, options);
  tracker.measure_readout();
  ReadoutTrial trial;
  trial.assumed = assumed;
  FrameStream stream(sequence, camera);
  while (const auto frame = stream.next()) {
    if (!frame->frame) continue;  // broken ones are `info`'s to tell of
    const TrackResult result = tracker.track(*frame->frame, std::nullopt);
    trial.tracked += result.ok() ? 1 : 0;
  }
  tracker.finish();
  trial.correction = tracker.readout()->correction();
  trial.sigma = tracker.readout()->sigma();
  return trial;
}

/// Median time between frames [s].
double interval_of(const Sequence& sequence) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < sequence.frames.size(); ++i)
    intervals.push_back(sequence.frames[i].t_rgb - sequence.frames[i - 1].t_rgb);
  return median_of(intervals);
}

}  // namespace

ReadoutReport measure_readout(const Sequence& sequence, const CameraConfig& camera,
                              const std::function<void(const ReadoutTrial&)>& progress) {
  ReadoutReport report;
  report.frames = sequence.frames.size();
  const double longest = std::min(0.2, interval_of(sequence));  // rows are read before the next frame's are
  // Too short a time asks for more, too long a one for less: regula falsi between the two (Illinois).
  std::optional<ReadoutTrial> low, high;
  double next = 0;
  while (report.trials.size() < kMaxTrials) {
    const ReadoutTrial now = report.trials.emplace_back(try_readout(sequence, camera, next));
    if (progress) progress(now);
    if (2 * now.tracked < report.frames) {
      report.why_not = fmt::format("only {} of {} frames are tracked", now.tracked, report.frames);
      return report;
    }
    if (!(now.sigma < kTooVague)) {
      report.why_not = "the camera moves too little";
      return report;
    }
    const bool ask_more = now.correction > 0;
    std::optional<ReadoutTrial>&side = ask_more ? low : high, &other = ask_more ? high : low;
    if (side && other) other->correction /= 2;  // else that end might stay for good
    side = now;
    if (!other) {
      if (report.trials.size() > 1) {
        report.why_not = "rows say nothing of it: turn the camera quicker, in all directions";
        return report;
      }
      next = std::copysign(longest, now.correction);
      continue;
    }
    const double last = next;
    next = (low->assumed * high->correction - high->assumed * low->correction) /
           (high->correction - low->correction);
    if (std::abs(next - last) < kSettled) {
      report.readout = next;
      return report;
    }
  }
  report.why_not = fmt::format("no time needs no correction; the last was {:.4f} s", next);
  return report;
}

}  // namespace dynslam::runtime
