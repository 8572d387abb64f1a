// SPDX-License-Identifier: BSD-3-Clause
#include "run/run_summary.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core/version.hpp>
#include <string>
#include <system_error>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/map_io.hpp"

namespace dynslam::runtime {
namespace {

nlohmann::json configuration(const RunOptions& options, const CameraConfig& camera) {
  const TrackerOptions& t = options.tracker;
  return {{"sequence", options.sequence.string()},
          {"format", options.format},
          {"topics", options.topics},
          {"rate", options.rate},
          {"camera", camera.name},
          {"readout_time", camera.readout_time},
          {"dynamics", std::string(to_string(options.dynamics))},
          {"method", std::string(to_string(t.method))},
          {"masks", options.masks.string()},
          {"model", options.segmentation.segmenter.model.string()},
          {"segment_every", options.segmentation.every},
          {"segment_async", options.segmentation.async},
          {"load_map", options.load_map.string()},
          {"save_map", options.save_map.string()},
          {"loops", t.close_loops},
          {"map", options.map},
          {"map_resolution", options.map_resolution},
          {"max_frames", options.max_frames},
          {"seed", options.seed},
          {"schedule", std::string(to_string(options.schedule))},
          {"features", t.features.features},
          {"nu", t.pose.nu},
          {"geometry_nu", t.geometry.weights.nu},
          {"tau", t.geometry.weights.tau}};
}

nlohmann::json live(const RunOptions& options, const RunSummary& s) {
  nlohmann::json j{{"speed", options.live_speed}, {"dropped", s.dropped}, {"reproducible", false}};
  if (!s.live) return j;
  j["latency"] = {{"median_ms", 1000 * s.live->latency_median},
                  {"p95_ms", 1000 * s.live->latency_p95},
                  {"max_ms", 1000 * s.live->latency_max}};
  j["frames_seen_by_network"] = s.live->masks;
  return j;
}

}  // namespace

std::string summary_json(const RunOptions& options, const CameraConfig& camera, const RunSummary& s) {
  nlohmann::json j;
  j["frames"] = s.frames;
  j["tracked"] = s.tracked;
  j["lost"] = s.lost;
  j["broken"] = s.broken;
  if (options.schedule == Schedule::live) j["live"] = live(options, s);
  j["interrupted"] = s.interrupted;
  j["problems"] = s.problems;
  j["warnings"] = s.warnings;
  for (const auto& [name, value] : s.stages)
    j["stages"][name] = {{"median_ms", value.median_ms}, {"p95_ms", value.p95_ms}};
  j["separate_maps"] = nlohmann::json::array();
  for (const SeparateTrajectory& map : s.separate)
    j["separate_maps"].push_back({{"map", map.map}, {"frames", map.poses.size()}});
  j["loops"] = nlohmann::json::array();
  for (const LoopClosing& loop : s.loops) {
    j["loops"].push_back({{"keyframe", loop.keyframe},
                          {"seen_again", loop.seen_again},
                          {"inliers", loop.inliers},
                          {"merged", loop.merged},
                          {"shift_m", loop.D.translation().norm()}});
  }
  if (!s.masks_from.empty()) j["masks"] = {{"read_as", s.masks_from}, {"frames_marked", s.masked}};
  j["masks_rejected"] = s.masks_rejected.size();
  j["mask_rejected"] = nlohmann::json::array();
  for (const auto& [stamp, why] : s.masks_rejected)
    j["mask_rejected"].push_back({{"frame", stamp}, {"reason", std::string(to_string(why))}});
  j["fps"] = s.fps;
  j["peak_rss_mb"] = s.peak_rss_mb;
  j["configuration"] = configuration(options, camera);
  j["versions"] = {
      {"dynslam", DYNSLAM_VERSION},
      {"opencv", CV_VERSION},
      {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
      {"compiler", __VERSION__}};
  // Names of files are bytes; JSON has text alone.
  return j.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

void check_broken(const RunOptions& options, const RunSummary& summary) {
  if (static_cast<double>(summary.broken) <= options.max_broken * static_cast<double>(summary.frames)) return;
  throw InputError(
      options.sequence.string(), 0,
      fmt::format("{} of {} frames are broken, more than the share of {} that --max-broken allows; "
                  "first problem: {}",
                  summary.broken, summary.frames, options.max_broken, summary.problems.front()));
}

void refuse_without_poses(const RunOptions& options, const RunSummary& summary, bool any_depth) {
  if (!any_depth && summary.lost > 0)
    throw InputError(
        options.sequence.string(), 0,
        fmt::format("no frame could be tracked: none of {} depth images has a valid depth", summary.lost));
  if (!options.load_map.empty())
    throw InputError(options.load_map.string(), 0, "the camera never found itself in this map");
  throw InputError(options.sequence.string(), 0,
                   summary.problems.empty()
                       ? "no frame could be tracked"
                       : "no frame could be tracked; first problem: " + summary.problems.front());
}

void note_leftovers(const RunOptions& options, RunSummary& summary) {
  namespace fs = std::filesystem;
  std::vector<std::string> names;
  if (!options.map && fs::exists(options.out / kMapFile)) names.emplace_back(kMapFile);
  const fs::path folder = options.out / "masks";
  std::error_code error;
  const std::size_t masks = fs::equivalent(folder, options.masks, error) ? 0 : count_pngs(folder);
  const std::size_t own = options.save_masks ? summary.frames - summary.broken : 0;
  if (masks > own) names.push_back(fmt::format("{} masks", masks - own));
  if (!names.empty())
    summary.warnings.push_back(
        fmt::format("{} still holds {} of an earlier run", options.out.string(), fmt::join(names, " and ")));
}

void drop_found(const LostFrames& lost, RunSummary& summary) {
  const auto& poses = summary.trajectory;
  const auto found = [&](double t) {
    const auto at = std::lower_bound(poses.begin(), poses.end(), t,
                                     [](const auto& p, double time) { return p.t < time; });
    return at != poses.end() && at->t == t;
  };
  // From the end, where places before stay what they are.
  for (auto frame = lost.rbegin(); frame != lost.rend(); ++frame) {
    if (found(frame->first))
      summary.problems.erase(summary.problems.begin() + static_cast<std::ptrdiff_t>(frame->second));
  }
}

}  // namespace dynslam::runtime
