// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/pipeline.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <exception>
#include <functional>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/io/saved_map.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/slam/frame_preparation.hpp"
#include "dynslam/runtime/stopwatch.hpp"
#include "io/run_summary.hpp"
#include "io/run_timings.hpp"
#include "slam/run_map.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error || !fs::is_directory(path))
    throw InputError(path.string(), 0, "cannot be made a folder: " + error.message());
}

void write_mask(const fs::path& path, const cv::Mat& mask) {
  if (!cv::imwrite(path.string(), mask, {cv::IMWRITE_PNG_COMPRESSION, 1}))
    throw InputError(path.string(), 0, "cannot be written");
}

bool uses_network(const RunOptions& options) {
  return uses_semantic(options.dynamics) && !options.segmentation.segmenter.model.empty();
}

void check_request(const RunOptions& options) {
  if (uses_semantic(options.dynamics) && options.masks.empty() && !uses_network(options)) {
    throw UsageError(
        fmt::format("--dynamics {} needs a-priori masks: give --model FILE.onnx or --masks DIR, or use "
                    "--dynamics geometric",
                    to_string(options.dynamics)));
  }
  if (uses_network(options) && !options.masks.empty())
    throw UsageError("--model and --masks exclude each other");
}

SequenceOptions sequence_options(const RunOptions& options) {
  SequenceOptions result;
  result.max_frames = options.max_frames;
  return result;
}

TrackerOptions tracker_options(const RunOptions& options) {
  TrackerOptions result = options.tracker;
  result.dynamics = options.dynamics;
  result.seed = result.geometry.weights.seed = options.seed;
  return result;
}

/// A frame with its a-priori masks, as they come from the decoder and the segmentation.
struct Input {
  FrameResult result;
  std::optional<Masks> prior;
  double network_ms = 0, keeper_ms = 0;
};

/// A run: its parts, and what it has so far.
class Run {
 public:
  explicit Run(const RunOptions& options);
  /// Tracks all frames, or as many as there are before `stop`. @throws what ends the run
  void track(const std::atomic<bool>& stop, const std::function<void(const Progress&)>& progress);
  /// Saves what was computed; each part also where another one fails.
  void save(const std::atomic<bool>& stop);
  /// Does a part of the run; the first failure of all is kept for the end.
  template <class Part>
  void attempt(Part&& part) {
    try {
      part();
    } catch (...) {
      if (!failure_) failure_ = std::current_exception();
    }
  }
  /// @throws the first failure, and where no frame was tracked at all
  RunSummary summary();

 private:
  struct FramePose {  // of a tracked frame, relative to its keyframe
    double t;
    int reference;
    SE3<double> T_c_reference;
    bool keyframe;
  };

  void prepare_outputs();
  std::optional<Input> next();
  void take(Input& input);
  void report(const std::function<void(const Progress&)>& progress) const;
  void count_missing_masks();
  std::vector<StampedPose<double>> final_poses();
  void write_files(const std::vector<StampedPose<double>>& keyframes);

  const RunOptions& options_;
  Sequence sequence_;
  CameraConfig camera_;
  std::optional<MaskSource> masks_;
  std::unique_ptr<Tracker> tracker_;
  std::unique_ptr<RunMap> map_;
  std::unique_ptr<FramePreparation> prepare_;
  std::unique_ptr<FrameStream> stream_;
  std::unique_ptr<SegmentationStage> segmentation_;
  RunSummary summary_;
  RunTimings timings_;
  std::vector<FramePose> poses_;
  std::exception_ptr failure_;
  Stopwatch wall_;
  double elapsed_ms_ = 0;
};

Run::Run(const RunOptions& options)
    : options_(options),
      sequence_(load_sequence(options.sequence, sequence_options(options))),
      camera_(load_camera(options.camera.empty() ? sequence_.camera_hint : options.camera)) {
  if (uses_semantic(options.dynamics) && !uses_network(options)) masks_.emplace(options.masks, MaskOptions{});
  prepare_outputs();
  const TrackerOptions tracking = tracker_options(options);
  tracker_ = std::make_unique<Tracker>(camera_, tracking);
  if (options.map) map_ = std::make_unique<RunMap>(camera_, options.map_resolution);
  if (!options.load_map.empty()) {
    tracker_->load(load_slam_map(options.load_map, camera_));
    if (map_) map_->load(options.load_map);
  }
  if (!options.save_map.empty()) check_map_folder(options.save_map);
  prepare_ = std::make_unique<FramePreparation>(tracking);
  wall_ = Stopwatch();
  stream_ = std::make_unique<FrameStream>(sequence_, camera_,
                                          StreamOptions{.queue = 4, .prepare = std::ref(*prepare_)});
  if (uses_network(options))
    segmentation_ = std::make_unique<SegmentationStage>(*stream_, options.segmentation);
}

/// The output is proven writable before hours are spent on computing it.
void Run::prepare_outputs() {
  make_folder(options_.out);
  write_file(options_.out / "summary.json", "{}\n");
  if (options_.save_masks) make_folder(options_.out / "masks");
}

std::optional<Input> Run::next() {
  if (segmentation_) {
    auto segmented = segmentation_->next();
    if (!segmented) return std::nullopt;
    return Input{std::move(segmented->frame), std::move(segmented->masks), segmented->network_ms,
                 segmented->keeper_ms};
  }
  auto frame = stream_->next();
  if (!frame) return std::nullopt;
  return Input{std::move(*frame), std::nullopt, 0, 0};
}

void Run::track(const std::atomic<bool>& stop, const std::function<void(const Progress&)>& progress) {
  while (!stop.load()) {
    std::optional<Input> input = next();
    if (!input) break;
    ++summary_.frames;
    if (input->result.frame) {
      take(*input);
    } else {
      ++summary_.broken;
      summary_.problems.push_back(input->result.error);
    }
    if (progress) report(progress);
  }
}

void Run::take(Input& input) {
  const RgbdFrame& frame = *input.result.frame;
  if (masks_) input.prior = masks_->read(frame.stamp, camera_.width, camera_.height);
  const TrackResult result = tracker_->track(frame, input.prior);
  if (result.state == TrackingState::tracked || result.state == TrackingState::relocalised) {
    ++summary_.tracked;
    if (result.loop) summary_.loops.push_back(*result.loop);
    poses_.push_back({frame.t, result.reference, result.T_c_reference, result.keyframe});
  } else {
    ++summary_.lost;
    summary_.problems.push_back(fmt::format("{}: {}", frame.stamp, to_string(result.state)));
  }
  if (options_.save_masks) write_mask(options_.out / "masks" / (frame.stamp + ".png"), result.dynamic_mask);
  if (result.keyframe && map_) {
    map_->insert(result, frame, input.prior);
    if (result.loop) map_->follow(tracker_->map());
  }
  const double lap = wall_.lap_ms();
  elapsed_ms_ += lap;
  timings_.rows.push_back({frame.stamp, result.times, input.network_ms, input.keeper_ms, lap});
}

void Run::report(const std::function<void(const Progress&)>& progress) const {
  const double fps = elapsed_ms_ > 0 ? 1000.0 * static_cast<double>(summary_.frames) / elapsed_ms_ : 0.0;
  const auto left = static_cast<double>(sequence_.frames.size() - summary_.frames);
  progress({summary_.frames, sequence_.frames.size(), fps, fps > 0 ? left / fps : 0.0, summary_.lost});
}

void Run::count_missing_masks() {
  if (!masks_ || masks_->missing() == 0) return;
  const std::size_t decoded = summary_.frames - summary_.broken;
  summary_.problems.push_back(
      fmt::format("{} of {} frames have no mask in {}", masks_->missing(), decoded, options_.masks.string()));
  if (masks_->missing() == decoded)  // the wrong folder, most likely
    throw InputError(options_.masks.string(), 0, "has no mask for any frame of the sequence");
}

/// Each frame keeps its place beside its keyframe, which may have been adjusted since. @return the keyframes'
std::vector<StampedPose<double>> Run::final_poses() {
  std::vector<StampedPose<double>> keyframes;
  for (const FramePose& pose : poses_) {
    const SE3<double> T_reference = tracker_->map().pose(pose.reference);
    summary_.trajectory.push_back({pose.t, (pose.T_c_reference * T_reference).inverse()});
    if (pose.keyframe) keyframes.push_back(summary_.trajectory.back());
  }
  return keyframes;
}

void Run::save(const std::atomic<bool>& stop) {
  summary_.interrupted = stop.load();
  attempt([&] { count_missing_masks(); });
  attempt([&] { tracker_->finish(); });
  const auto keyframes = final_poses();
  if (map_) {
    attempt([&] {
      map_->follow(tracker_->map());
      map_->save(options_.out);
    });
  }
  if (!options_.save_map.empty() && !tracker_->map().keyframes().empty()) {
    attempt([&] {
      save_slam_map(tracker_->map(), camera_, map_ && !failure_ ? &map_->mapper() : nullptr,
                    options_.save_map);
    });
  }
  elapsed_ms_ += wall_.lap_ms();
  summary_.fps = elapsed_ms_ > 0 ? 1000.0 * static_cast<double>(summary_.frames) / elapsed_ms_ : 0.0;
  summary_.peak_rss_mb = peak_rss_mb();
  summary_.stages = timings_.statistics();
  write_files(keyframes);
}

void Run::write_files(const std::vector<StampedPose<double>>& keyframes) {
  attempt([&] { write_trajectory(options_.out / "trajectory.txt", summary_.trajectory); });
  attempt([&] { write_trajectory(options_.out / "keyframes.txt", keyframes); });
  attempt([&] { timings_.write(options_.out / "timings.csv"); });
  attempt([&] { write_file(options_.out / "summary.json", summary_json(options_, camera_, summary_)); });
}

RunSummary Run::summary() {
  if (failure_) std::rethrow_exception(failure_);
  if (summary_.tracked > 0 || summary_.interrupted) return std::move(summary_);
  if (!options_.load_map.empty())
    throw InputError(options_.load_map.string(), 0, "the camera never found itself in this map");
  throw InputError(options_.sequence.string(), 0,
                   summary_.problems.empty()
                       ? "no frame could be tracked"
                       : "no frame could be tracked; first problem: " + summary_.problems.front());
}

}  // namespace

RunSummary run_sequence(const RunOptions& options, const std::atomic<bool>& stop,
                        const std::function<void(const Progress&)>& progress) {
  check_request(options);
  Run run(options);
  run.attempt([&] { run.track(stop, progress); });
  run.save(stop);
  return run.summary();
}

}  // namespace dynslam::runtime
