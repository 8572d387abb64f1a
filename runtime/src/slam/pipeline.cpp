// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/pipeline.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <octomap/octomap.h>
#include <Eigen/Core>
#include <algorithm>
#include <exception>
#include <fstream>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/io/saved_map.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/slam/frame_preparation.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/stopwatch.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

constexpr int kMapMaskMargin = 7;  // pixels around movers that never become map

/// Time of each stage per frame, in the order of kStageNames, with the wall time of the whole frame.
struct Timings {
  struct Row {
    std::string stamp;
    StageTimes times;
    double network_ms, keeper_ms;  // of the segmentation, on its own thread unless that is off
    double frame_ms;  // everything the main loop did for the frame, waiting for the reader included
  };
  std::vector<Row> rows;

  void write(const fs::path& path) const {
    std::ofstream out(path);
    out << "timestamp";
    for (const auto name : kStageNames) out << ',' << name;
    out << ",network,mask_keeper,frame\n";
    for (const Row& row : rows) {
      out << row.stamp;
      for (const double ms : row.times) out << fmt::format(",{:.3f}", ms);
      out << fmt::format(",{:.3f},{:.3f},{:.3f}\n", row.network_ms, row.keeper_ms, row.frame_ms);
    }
    out.flush();
    if (!out) throw InputError(path.string(), 0, "cannot be written");
  }

  [[nodiscard]] std::map<std::string, StageStatistics> statistics() const {
    std::map<std::string, StageStatistics> result;
    if (rows.empty()) return result;
    std::vector<double> values(rows.size());
    const auto add = [&](std::string name, auto&& value) {
      for (std::size_t i = 0; i < rows.size(); ++i) values[i] = value(rows[i]);
      std::sort(values.begin(), values.end());
      const auto last = static_cast<double>(values.size() - 1);
      result[std::move(name)] = {values[values.size() / 2],
                                 values[static_cast<std::size_t>(last * 0.95 + 0.5)]};
    };
    for (std::size_t s = 0; s < kStageNames.size(); ++s) {
      add(std::string(kStageNames[s]), [s](const Row& row) { return row.times[s]; });
    }
    add("network", [](const Row& row) { return row.network_ms; });
    add("mask_keeper", [](const Row& row) { return row.keeper_ms; });
    add("frame", [](const Row& row) { return row.frame_ms; });
    return result;
  }
};

/// A tracked frame's pose relative to its keyframe.
struct FramePose {
  double t;
  int reference;
  SE3<double> T_c_reference;
  bool keyframe;
};

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

nlohmann::json summary_json(const RunOptions& options, const CameraConfig& camera, const RunSummary& s) {
  nlohmann::json j;
  j["frames"] = s.frames;
  j["tracked"] = s.tracked;
  j["lost"] = s.lost;
  j["broken"] = s.broken;
  j["interrupted"] = s.interrupted;
  j["problems"] = s.problems;
  for (const auto& [name, value] : s.stages)
    j["stages"][name] = {{"median_ms", value.median_ms}, {"p95_ms", value.p95_ms}};
  j["loops"] = nlohmann::json::array();
  for (const LoopClosing& loop : s.loops) {
    j["loops"].push_back({{"keyframe", loop.keyframe},
                          {"seen_again", loop.seen_again},
                          {"inliers", loop.inliers},
                          {"merged", loop.merged},
                          {"shift_m", loop.D.translation().norm()}});
  }
  j["fps"] = s.fps;
  j["peak_rss_mb"] = s.peak_rss_mb;
  const TrackerOptions& t = options.tracker;
  j["configuration"] = {{"sequence", options.sequence.string()},
                        {"camera", camera.name},
                        {"dynamics", std::string(to_string(options.dynamics))},
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
                        {"features", t.features.features},
                        {"nu", t.nu},
                        {"geometry_nu", t.geometry.nu},
                        {"tau", t.geometry.tau}};
  j["versions"] = {
      {"dynslam", DYNSLAM_VERSION},
      {"opencv", CV_VERSION},
      {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
      {"compiler", __VERSION__}};
  return j;
}

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream out(path);
  out << text;
  out.flush();
  if (!out) throw InputError(path.string(), 0, "cannot be written");
}

void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error || !fs::is_directory(path))
    throw InputError(path.string(), 0, "cannot be made a folder: " + error.message());
}

void write_mask(const fs::path& path, const cv::Mat& mask) {
  if (!cv::imwrite(path.string(), mask, {cv::IMWRITE_PNG_COMPRESSION, 1})) {
    throw InputError(path.string(), 0, "cannot be written");
  }
}

using MappedPoses = std::vector<std::pair<int, SE3<double>>>;  // keyframe, T_w_c that the octree has

/// Has the octree made again where a correction of the poses (a loop, bundle adjustment) is worth it.
/// Scans go in at once, with the pose known then, so that the map shows what is there now; a map that
/// waited for final poses would be late by as much as a robot drives in a loop.
void follow_poses(SemanticMapper& mapper, const LocalMap& map, double resolution, MappedPoses& mapped) {
  constexpr double kRange = 3.0;              // metres at which a turn is judged
  const double worth_it = 0.25 * resolution;  // a surface's shift that is
  bool moved = false;
  for (const auto& [keyframe, T_w_c] : mapped) {
    const SE3<double> now = map.pose(keyframe).inverse();
    const double turn = (now.so3() * T_w_c.so3().inverse()).log().norm();
    moved = moved || (now.translation() - T_w_c.translation()).norm() + kRange * turn > worth_it;
  }
  if (!moved) return;
  for (auto& [keyframe, T_w_c] : mapped) T_w_c = map.pose(keyframe).inverse();
  mapper.repose(mapped);
}

}  // namespace

RunSummary run_sequence(const RunOptions& options, const std::atomic<bool>& stop,
                        const std::function<void(const Progress&)>& progress) {
  const bool network = uses_semantic(options.dynamics) && !options.segmentation.segmenter.model.empty();
  if (uses_semantic(options.dynamics) && options.masks.empty() && !network) {
    throw UsageError(
        fmt::format("--dynamics {} needs a-priori masks: give --model FILE.onnx or --masks DIR, or use "
                    "--dynamics geometric",
                    to_string(options.dynamics)));
  }
  if (network && !options.masks.empty()) throw UsageError("--model and --masks exclude each other");
  SequenceOptions sequence_options;
  sequence_options.max_frames = options.max_frames;
  const Sequence sequence = load_sequence(options.sequence, sequence_options);
  const CameraConfig camera = load_camera(options.camera.empty() ? sequence.camera_hint : options.camera);
  std::optional<MaskSource> masks;
  if (uses_semantic(options.dynamics) && !network) masks.emplace(options.masks, MaskOptions{});

  // The output is proven writable before hours are spent on computing it.
  make_folder(options.out);
  write_text(options.out / "summary.json", "{}\n");
  if (options.save_masks) make_folder(options.out / "masks");

  TrackerOptions tracker_options = options.tracker;
  tracker_options.dynamics = options.dynamics;
  tracker_options.seed = tracker_options.geometry.seed = options.seed;
  Tracker tracker(camera, tracker_options);
  std::unique_ptr<SemanticMapper> mapper;
  if (options.map) {
    SemanticMapperOptions mapper_options;
    mapper_options.resolution = options.map_resolution;
    mapper = std::make_unique<SemanticMapper>(camera.model, camera.width, camera.height, mapper_options);
  }

  MappedPoses mapped;
  if (!options.load_map.empty()) {
    tracker.load(load_slam_map(options.load_map, camera));
    if (mapper && fs::exists(options.load_map / "scans.bin"))
      mapped = mapper->load_scans(options.load_map / "scans.bin");
  }
  if (!options.save_map.empty()) check_map_folder(options.save_map);

  RunSummary summary;
  Timings timings;
  std::vector<FramePose> poses;
  std::exception_ptr failure;
  Stopwatch wall;
  double elapsed_ms = 0;
  FramePreparation prepare(tracker_options);
  FrameStream stream(sequence, camera, {.queue = 4, .prepare = std::ref(prepare)});
  std::unique_ptr<SegmentationStage> segmentation;
  if (network) segmentation = std::make_unique<SegmentationStage>(stream, options.segmentation);
  const cv::Mat margin =
      cv::getStructuringElement(cv::MORPH_RECT, {2 * kMapMaskMargin + 1, 2 * kMapMaskMargin + 1});
  cv::Mat never_map;
  try {
    while (!stop.load()) {
      std::optional<FrameResult> next;
      std::optional<Masks> prior;
      double network_ms = 0, keeper_ms = 0;
      if (segmentation) {
        if (auto segmented = segmentation->next()) {
          next = std::move(segmented->frame);
          prior = std::move(segmented->masks);
          network_ms = segmented->network_ms;
          keeper_ms = segmented->keeper_ms;
        }
      } else {
        next = stream.next();
      }
      if (!next) break;
      ++summary.frames;
      if (!next->frame) {
        ++summary.broken;
        summary.problems.push_back(next->error);
      } else {
        const RgbdFrame& frame = *next->frame;
        if (masks) prior = masks->read(frame.stamp, camera.width, camera.height);
        TrackResult result = tracker.track(frame, prior);
        const bool tracked =
            result.state == TrackingState::tracked || result.state == TrackingState::relocalised;
        if (tracked) {
          ++summary.tracked;
          if (result.loop) summary.loops.push_back(*result.loop);
          poses.push_back({frame.t, result.reference, result.T_c_reference, result.keyframe});
        } else {
          ++summary.lost;
          summary.problems.push_back(fmt::format("{}: {}", frame.stamp, to_string(result.state)));
        }
        if (options.save_masks)
          write_mask(options.out / "masks" / (frame.stamp + ".png"), result.dynamic_mask);
        if (result.keyframe) {
          if (mapper) {
            cv::dilate(result.dynamic_mask, never_map, margin);
            mapper->insert({result.T_w_c, frame.depth, never_map.clone(), prior ? prior->labels : cv::Mat(),
                            frame.bgr, result.reference});
            mapped.emplace_back(result.reference, result.T_w_c);
            if (result.loop) follow_poses(*mapper, tracker.map(), options.map_resolution, mapped);
          }
        }
        const double lap = wall.lap_ms();
        elapsed_ms += lap;
        timings.rows.push_back({frame.stamp, result.times, network_ms, keeper_ms, lap});
      }
      if (progress) {
        const double fps = elapsed_ms > 0 ? 1000.0 * static_cast<double>(summary.frames) / elapsed_ms : 0.0;
        const auto left = static_cast<double>(sequence.frames.size() - summary.frames);
        progress({summary.frames, sequence.frames.size(), fps, fps > 0 ? left / fps : 0.0, summary.lost});
      }
    }
  } catch (...) {  // what was computed is saved first
    failure = std::current_exception();
  }
  summary.interrupted = stop.load();
  const std::size_t decoded = summary.frames - summary.broken;
  if (masks && masks->missing() > 0) {
    summary.problems.push_back(
        fmt::format("{} of {} frames have no mask in {}", masks->missing(), decoded, options.masks.string()));
    if (masks->missing() == decoded && !failure) {  // the wrong folder, most likely
      failure = std::make_exception_ptr(
          InputError(options.masks.string(), 0, "has no mask for any frame of the sequence"));
    }
  }
  // Final poses: each frame keeps its place beside its keyframe, which may have been adjusted since.
  tracker.finish();
  std::vector<StampedPose<double>> keyframes;
  for (const FramePose& pose : poses) {
    const SE3<double> T_reference = tracker.map().pose(pose.reference);
    summary.trajectory.push_back({pose.t, (pose.T_c_reference * T_reference).inverse()});
    if (pose.keyframe) keyframes.push_back(summary.trajectory.back());
  }
  if (mapper) {
    try {
      follow_poses(*mapper, tracker.map(), options.map_resolution, mapped);
      mapper->finish();
      mapper->save(options.out / "map.ot");
      export_map(mapper->tree(), options.out / "map_color.ot");  // for octovis, which knows no labels
    } catch (...) {
      if (!failure) failure = std::current_exception();
    }
  }
  if (!options.save_map.empty() && !tracker.map().keyframes().empty()) {
    try {
      save_slam_map(tracker.map(), camera, failure ? nullptr : mapper.get(), options.save_map);
    } catch (...) {
      if (!failure) failure = std::current_exception();
    }
  }
  elapsed_ms += wall.lap_ms();
  summary.fps = elapsed_ms > 0 ? 1000.0 * static_cast<double>(summary.frames) / elapsed_ms : 0.0;
  summary.peak_rss_mb = peak_rss_mb();
  summary.stages = timings.statistics();

  write_trajectory(options.out / "trajectory.txt", summary.trajectory);
  write_trajectory(options.out / "keyframes.txt", keyframes);
  timings.write(options.out / "timings.csv");
  write_text(options.out / "summary.json", summary_json(options, camera, summary).dump(2) + "\n");
  if (failure) std::rethrow_exception(failure);
  if (summary.tracked == 0 && !summary.interrupted && !options.load_map.empty())
    throw InputError(options.load_map.string(), 0, "the camera never found itself in this map");
  if (summary.tracked == 0 && !summary.interrupted) {
    throw InputError(options.sequence.string(), 0,
                     summary.problems.empty()
                         ? "no frame could be tracked"
                         : "no frame could be tracked; first problem: " + summary.problems.front());
  }
  return summary;
}

}  // namespace dynslam::runtime
