// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/pipeline.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/io/saved_map.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/slam/frame_preparation.hpp"
#include "dynslam/runtime/stopwatch.hpp"
#include "io/run_summary.hpp"
#include "io/run_timings.hpp"
#include "io/space_reserve.hpp"
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

/// Of two folders that need not exist, links followed.
bool lies_in(const fs::path& inner, const fs::path& outer) {
  const auto clean = [](const fs::path& path) {
    const fs::path full = fs::weakly_canonical(fs::absolute(path));
    return full.has_filename() ? full : full.parent_path();
  };
  const fs::path a = clean(inner), b = clean(outer);
  return std::mismatch(a.begin(), a.end(), b.begin(), b.end()).second == b.end();
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
  if (!options.save_map.empty() && lies_in(options.out, options.save_map))
    throw UsageError(fmt::format("--out {} lies in the folder of --save-map, which is replaced as a whole",
                                 options.out.string()));
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
  void load_map();
  void note_problem(std::string problem);
  std::optional<Input> next();
  void take(Input& input);
  void report(const std::function<void(const Progress&)>& progress) const;
  void count_missing_masks();
  void judge_broken();
  /// Trajectory as the map has it now.
  [[nodiscard]] std::vector<StampedPose<double>> poses(bool keyframes_alone) const;
  void save_progress();
  void save_map();
  void write_files();
  void write_summary();

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
  std::optional<SpaceReserve> reserve_;
  std::uint64_t loaded_id_ = 0;  // of the map that was loaded
  std::size_t unlisted_ = 0;     // problems that are not in the summary
  bool computing_ = false;       // a step is under way that leaves tracker or map in pieces where it fails
  Stopwatch wall_, since_saved_;
  double elapsed_ms_ = 0, unsaved_ms_ = 0;
};

Run::Run(const RunOptions& options)
    : options_(options),
      sequence_(load_sequence(options.sequence, sequence_options(options))),
      camera_(load_camera(options.camera.empty() ? sequence_.camera_hint : options.camera)) {
  if (uses_semantic(options.dynamics) && !uses_network(options)) masks_.emplace(options.masks, MaskOptions{});
  summary_.interrupted = true;  // until the run has ended
  prepare_outputs();
  const TrackerOptions tracking = tracker_options(options);
  tracker_ = std::make_unique<Tracker>(camera_, tracking);
  if (options.map) map_ = std::make_unique<RunMap>(camera_, options.map_resolution, options.map_memory);
  if (!options.load_map.empty()) load_map();
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
  write_summary();
  if (options_.save_masks) make_folder(options_.out / "masks");
  // For all text files at once, the trajectory beside the one that it replaces.
  constexpr std::uint64_t kPerFrame = 700, kOthers = 1 << 18;  // bytes
  reserve_.emplace(options_.out, kPerFrame * sequence_.frames.size() + kOthers);
}

void Run::load_map() {
  tracker_->load(load_slam_map(options_.load_map, camera_, &loaded_id_));
  const int keyframes = static_cast<int>(tracker_->map().keyframes().size());
  if (map_) map_->load(options_.load_map, {loaded_id_, keyframes});
}

void Run::note_problem(std::string problem) {
  constexpr std::size_t kListed = 10000;  // of a million broken frames
  if (summary_.problems.size() < kListed) {
    summary_.problems.push_back(std::move(problem));
  } else {
    ++unlisted_;
  }
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
      note_problem(input->result.error);
    }
    if (progress) report(progress);
    unsaved_ms_ += since_saved_.lap_ms();
    if (unsaved_ms_ >= 1000 * options_.save_every) save_progress();
  }
}

void Run::take(Input& input) {
  const RgbdFrame& frame = *input.result.frame;
  if (masks_) input.prior = masks_->read(frame.stamp, camera_.width, camera_.height);
  computing_ = true;
  const TrackResult result = tracker_->track(frame, input.prior);
  computing_ = false;
  if (result.state == TrackingState::tracked || result.state == TrackingState::relocalised) {
    ++summary_.tracked;
    if (result.loop) summary_.loops.push_back(*result.loop);
    poses_.push_back({frame.t, result.reference, result.T_c_reference, result.keyframe});
  } else {
    ++summary_.lost;
    note_problem(fmt::format("{}: {}", frame.stamp, to_string(result.state)));
  }
  if (options_.save_masks) write_image(options_.out / "masks" / (frame.stamp + ".png"), result.dynamic_mask);
  if (result.keyframe && map_) {
    computing_ = true;
    map_->insert(result, frame, input.prior);
    if (result.loop) map_->follow(tracker_->map());
    computing_ = false;
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
  note_problem(
      fmt::format("{} of {} frames have no mask in {}", masks_->missing(), decoded, options_.masks.string()));
  if (masks_->missing() == decoded)  // the wrong folder, most likely
    throw InputError(options_.masks.string(), 0, "has no mask for any frame of the sequence");
}

void Run::judge_broken() {
  if (static_cast<double>(summary_.broken) <= options_.max_broken * static_cast<double>(summary_.frames))
    return;
  throw InputError(
      options_.sequence.string(), 0,
      fmt::format("{} of {} frames are broken, more than the share of {} that --max-broken allows; "
                  "first problem: {}",
                  summary_.broken, summary_.frames, options_.max_broken, summary_.problems.front()));
}

/// Each frame keeps its place beside its keyframe, which may have been adjusted since.
std::vector<StampedPose<double>> Run::poses(bool keyframes_alone) const {
  std::vector<StampedPose<double>> result;
  for (const FramePose& pose : poses_) {
    if (keyframes_alone && !pose.keyframe) continue;
    const SE3<double> T_reference = tracker_->map().pose(pose.reference);
    result.push_back({pose.t, (pose.T_c_reference * T_reference).inverse()});
  }
  return result;
}

/// What a kill leaves. A disk that is full now may have room again in the end. A long trajectory takes long
/// to write and is written less often: a twentieth of the time is spent here at most.
void Run::save_progress() {
  Stopwatch watch;
  try {
    write_trajectory(options_.out / "trajectory.txt", poses(false));
    write_summary();
  } catch (const InputError&) {
  }
  constexpr double kShare = 0.05;
  unsaved_ms_ = -watch.lap_ms() / kShare;
}

void Run::save(const std::atomic<bool>& stop) {
  const bool stopped = stop.load();
  attempt([&] { count_missing_masks(); });
  attempt([&] { judge_broken(); });
  attempt([&] {
    const bool whole = !std::exchange(computing_, true);
    tracker_->finish();
    if (map_) map_->follow(tracker_->map());
    if (map_) map_->finish();
    computing_ = !whole;
  });
  if (unlisted_ > 0) summary_.problems.push_back(fmt::format("and {} more problems", unlisted_));
  if (reserve_) reserve_->release();
  summary_.trajectory = poses(false);
  write_files();
  if (map_ && !computing_) attempt([&] { map_->save(options_.out); });
  attempt([&] { save_map(); });
  elapsed_ms_ += wall_.lap_ms();
  summary_.interrupted = stopped;
  summary_.stages = timings_.statistics();
  attempt([&] { write_summary(); });
}

/// Never makes a saved map poorer: of a run whose parts are damaged nothing takes the place of what is there.
void Run::save_map() {
  if (options_.save_map.empty() || tracker_->map().keyframes().empty()) return;
  if (computing_ && fs::exists(options_.save_map / "keyframes.bin"))
    throw InputError(options_.save_map.string(), 0, "stays as it was, because the run failed");
  save_slam_map(tracker_->map(), camera_, map_ && !computing_ ? &map_->mapper() : nullptr, options_.save_map,
                {options_.load_map, loaded_id_});
}

void Run::write_files() {
  attempt([&] { write_trajectory(options_.out / "trajectory.txt", summary_.trajectory); });
  attempt([&] { write_trajectory(options_.out / "keyframes.txt", poses(true)); });
  attempt([&] { timings_.write(options_.out / "timings.csv"); });
  attempt([&] { write_summary(); });
}

void Run::write_summary() {
  summary_.fps = elapsed_ms_ > 0 ? 1000.0 * static_cast<double>(summary_.frames) / elapsed_ms_ : 0.0;
  summary_.peak_rss_mb = peak_rss_mb();
  write_file(options_.out / "summary.json", summary_json(options_, camera_, summary_));
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
