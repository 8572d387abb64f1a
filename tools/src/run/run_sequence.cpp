// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/run/run_sequence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "dynslam/runtime/config/options_file.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/inspect/readout.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/slam.hpp"
#include "dynslam/runtime/slam/frame_preparation.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "dynslam/runtime/stopwatch.hpp"
#include "io/make_folder.hpp"
#include "io/process_memory.hpp"
#include "io/space_reserve.hpp"
#include "run/evidence_log.hpp"
#include "run/recorded_pace.hpp"
#include "run/run_request.hpp"
#include "run/run_summary.hpp"
#include "run/run_timings.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLiveTrajectory = "trajectory_live.txt";

fs::path separate_file(const fs::path& out, int map) {
  return out / fmt::format("trajectory_map{}.txt", map);
}

CameraConfig camera_of_run(const Sequence& sequence, const RunOptions& options) {
  CameraConfig camera = camera_of(sequence, options.camera);
  if (options.readout_time) camera.readout_time = *options.readout_time;
  return camera;
}

/// A run: its parts, and what it has so far.
class Run {
 public:
  Run(const RunOptions& options, const RunWatch& watch, const std::atomic<bool>& stop);
  /// Tracks all frames, or as many as there are before the stop. @throws what ends the run
  void track(const std::function<void(const Progress&)>& progress);
  [[nodiscard]] const Sequence& sequence() const { return sequence_; }
  [[nodiscard]] const CameraConfig& camera() const { return camera_; }
  /// Saves what was computed; each part also where another one fails.
  void save();
  /// Does a part of the run; the first failure of all is kept for the end.
  template <class Part>
  void attempt(Part&& part) {
    try {
      part();
    } catch (const InferenceStopped&) {  // as the run is
    } catch (...) {
      if (!failure_) failure_ = std::current_exception();
    }
  }
  /// @throws the first failure, and where no frame was tracked at all
  RunSummary summary();

 private:
  void prepare_outputs();
  void note_problem(std::string problem);
  void start_stages();
  std::optional<SegmentedFrame> next();
  void take(SegmentedFrame& input);
  void take_live(const RgbdFrame& frame);
  void note(const RgbdFrame& frame, const TrackResult& result, const cv::Mat& semantic,
            const RunTimings::Row& times);
  void save_at_times();
  void report(const std::function<void(const Progress&)>& progress) const;
  void count_missing_masks();
  void save_progress();
  void take_trajectories();
  void write_files();
  void write_summary();

  const RunOptions& options_;
  const RunWatch& watch_;
  const std::atomic<bool>& stop_;
  FileHandle lock_;  // on the folder of the results
  Sequence sequence_;
  CameraConfig camera_;
  std::optional<MaskSource> masks_;
  std::unique_ptr<Slam> own_slam_;
  Slam* slam_ = nullptr;  // that one, or that of live_
  std::unique_ptr<FramePreparation> prepare_;
  std::unique_ptr<FrameStream> stream_;
  std::unique_ptr<SegmentationStage> segmentation_;
  RunSummary summary_;
  RunTimings timings_;
  MapSize map_size_;  // at the last keyframe
  std::exception_ptr failure_;
  std::optional<SpaceReserve> reserve_;
  std::optional<EvidenceLog> evidence_;
  std::size_t unlisted_ = 0;  // problems that are not in the summary
  bool earlier_run_ = false;  // there was one in the folder of the results
  LostFrames lost_;           // those that are in it
  bool any_depth_ = false;    // a depth image had a valid depth
  Stopwatch wall_, since_saved_;
  double elapsed_ms_ = 0, unsaved_ms_ = 0;
  // A live run: its results come on another thread, which has all of the above while it holds the mutex.
  std::mutex mutex_;
  RecordedPace pace_;
  std::unique_ptr<LiveSlam> live_;  // last: its threads use all of the above
};

Run::Run(const RunOptions& options, const RunWatch& watch, const std::atomic<bool>& stop)
    : options_(options),
      watch_(watch),
      stop_(stop),
      sequence_(load_sequence(options.sequence, sequence_options(options))),
      camera_(camera_of_run(sequence_, options)),
      pace_(options.live_speed, options.live_gap) {
  if (uses_semantic(options.dynamics) && !uses_network(options)) {
    check_masks_are_there(options, sequence_);
    masks_.emplace(options.masks, mask_options(options));
  }
  check_inputs_stay(options, sequence_);
  summary_.interrupted = true;  // until the run has ended
  start_stages();               // a model or map that is refused leaves earlier results as they are
  prepare_outputs();
}

void Run::start_stages() {
  StreamOptions stream{.queue = 4};
  SlamOptions slam = slam_options(options_);
  slam.mapped = watch_.mapped;
  if (slam.network) slam.network->segmenter.stop = &stop_;
  if (options_.schedule == Schedule::live) {
    LiveOptions live = options_.live;
    live.clock = nullptr;
    live.result = [this](const LiveResult& r) {
      const std::lock_guard lock(mutex_);
      note(*r.frame, r.track, r.prior != nullptr ? r.prior->dynamic : cv::Mat(),
           {r.stamp, r.track.times, r.network_ms, r.keeper_ms, 0, 0, {}, 1000 * r.latency, r.mask_age});
      save_at_times();
    };
    live_ = std::make_unique<LiveSlam>(camera_, slam, live);
    slam_ = &live_->slam();
  } else {
    own_slam_ = std::make_unique<Slam>(camera_, slam);
    slam_ = own_slam_.get();
    prepare_ = std::make_unique<FramePreparation>(options_.tracker);
    stream.prepare = std::ref(*prepare_);
  }
  if (camera_.readout_time == 0 && !options_.readout_time && !live_) slam_->measure_readout();
  if (!options_.load_map.empty()) slam_->load(options_.load_map);
  if (!options_.save_map.empty()) check_map_folder(options_.save_map);
  wall_ = Stopwatch();
  stream_ = std::make_unique<FrameStream>(sequence_, camera_, stream);
  if (uses_network(options_) && !live_) {
    SegmentationStageOptions network = options_.segmentation;
    network.segmenter.labels = mask_options(options_).map_labels;
    network.segmenter.stop = &stop_;
    segmentation_ = std::make_unique<SegmentationStage>(*stream_, network);
  }
}

/// The output is proven writable before hours are spent on computing it.
void Run::prepare_outputs() {
  make_folder(options_.out);
  lock_ = lock_folder(options_.out);
  earlier_run_ = fs::exists(options_.out / "summary.json");
  write_file(options_.out / "config.toml", config_file(options_));
  write_summary();
  for (int map = 2; fs::remove(separate_file(options_.out, map)); ++map) {  // of an earlier run
  }
  if (options_.save_masks) make_folder(options_.out / "masks");
  fs::remove(options_.out / "report.jsonl");  // of an earlier run
  if (options_.report)
    evidence_.emplace(options_.out / "report.jsonl", sequence_, cv::Size(camera_.width, camera_.height));
  // For all text files at once, each trajectory beside the one that it replaces.
  constexpr std::uint64_t kPerFrame = 900, kOthers = 1 << 18;  // bytes
  reserve_.emplace(options_.out, kPerFrame * sequence_.frames.size() + kOthers);
}

void Run::note_problem(std::string problem) {
  constexpr std::size_t kListed = 10000;  // of a million broken frames
  if (summary_.problems.size() < kListed) {
    summary_.problems.push_back(std::move(problem));
  } else {
    ++unlisted_;
  }
}

std::optional<SegmentedFrame> Run::next() {
  if (segmentation_) return segmentation_->next();
  auto frame = stream_->next();
  if (!frame) return std::nullopt;
  return SegmentedFrame{std::move(*frame), {}};
}

void Run::track(const std::function<void(const Progress&)>& progress) {
  while (!stop_.load()) {
    std::optional<SegmentedFrame> input = next();
    if (!input) break;
    if (live_ && !pace_.wait(input->frame.record.t_rgb, stop_)) break;
    if (live_ && input->frame.frame) take_live(*input->frame.frame);
    const std::lock_guard lock(mutex_);
    ++summary_.frames;
    if (!input->frame.frame) {
      ++summary_.broken;
      note_problem(input->frame.error);
    } else if (!live_) {
      take(*input);
    }
    if (progress) report(progress);
    if (!live_) save_at_times();
  }
}

/// Hands a frame over, whose result comes on another thread, if it does.
void Run::take_live(const RgbdFrame& frame) {
  std::optional<Masks> prior;
  if (masks_) prior = masks_->read(frame.stamp, camera_.width, camera_.height);
  live_->push(frame, prior);
}

void Run::take(SegmentedFrame& input) {
  const RgbdFrame& frame = *input.frame.frame;
  std::optional<Masks>& prior = input.segmented.masks;
  if (masks_) prior = masks_->read(frame.stamp, camera_.width, camera_.height);
  const TrackResult result = slam_->track(frame, prior);
  note(frame, result, prior ? prior->dynamic : cv::Mat(),
       {frame.stamp, result.times, input.segmented.network_ms, input.segmented.keeper_ms, 0, 0, {}});
}

/// @param semantic  the a-priori mask, for a report and for who watches; empty: none
void Run::note(const RgbdFrame& frame, const TrackResult& result, const cv::Mat& semantic,
               const RunTimings::Row& times) {
  const std::string& stamp = frame.stamp;
  any_depth_ = any_depth_ || cv::countNonZero(frame.depth > 0) > 0;
  summary_.masked += !semantic.empty() && cv::countNonZero(semantic) > 0 ? 1 : 0;
  if (result.mask_rejected != MaskVerdict::kept)
    summary_.masks_rejected.emplace_back(stamp, result.mask_rejected);
  if (result.ok()) {
    ++summary_.tracked;
    if (result.loop) summary_.loops.push_back(*result.loop);
  } else {
    ++summary_.lost;
    if (unlisted_ == 0) lost_.emplace_back(frame.t, summary_.problems.size());
    note_problem(fmt::format("{}: {}", stamp, to_string(result.state)));
  }
  if (options_.save_masks) write_image(options_.out / "masks" / (stamp + ".png"), result.dynamic_mask);
  if (evidence_) evidence_->add(stamp, result, semantic, slam_->motion());
  const double lap = wall_.lap_ms();
  elapsed_ms_ += lap;
  if (result.keyframe) map_size_ = {live_keyframes(slam_->map()), live_points(slam_->map())};
  RunTimings::Row& row = timings_.rows.emplace_back(times);
  row.frame_ms = lap;
  row.rss_mb = rss_mb();
  row.map = map_size_;
  if (!watch_.frame) return;
  watch_.frame({frame.index + 1, sequence_.frames.size(), frame, result, semantic, *slam_});
  (void)wall_.lap_ms();
}

void Run::save_at_times() {
  unsaved_ms_ += since_saved_.lap_ms();
  if (unsaved_ms_ >= 1000 * options_.save_every) save_progress();
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
}

/// What a kill leaves. A disk that is full now may have room again in the end. A long trajectory takes long
/// to write and is written less often: a twentieth of the time is spent here at most.
void Run::save_progress() {
  Stopwatch watch;
  try {
    write_trajectory(options_.out / "trajectory.txt", slam_->trajectory());
    write_trajectory(options_.out / kLiveTrajectory, slam_->live_trajectory());
    write_summary();
  } catch (const InputError&) {
  }
  constexpr double kShare = 0.05;
  unsaved_ms_ = -watch.lap_ms() / kShare;
}

void Run::save() {
  const bool stopped = stop_.load();
  if (live_) attempt([&] { live_->finish(); });  // or it has failed: nobody else uses what follows
  attempt([&] { count_missing_masks(); });
  if (masks_) summary_.masks_from = masks_->describe();
  if (segmentation_) summary_.masks_from = segmentation_->describe();
  attempt([&] { check_broken(options_, summary_); });
  attempt([&] { slam_->finish(); });
  take_trajectories();
  if (pace_.skipped() > 0)  // the first to be read
    summary_.problems.insert(
        summary_.problems.begin(),
        fmt::format(
            "{} gaps between frames are longer than live_gap = {} s and were not waited for, the first of "
            "{:.6g} s",
            pace_.skipped(), options_.live_gap, pace_.first_skipped()));
  if (unlisted_ > 0) summary_.problems.push_back(fmt::format("and {} more problems", unlisted_));
  if (reserve_) reserve_->release();
  write_files();
  if (options_.map && slam_->whole()) {
    attempt([&] { slam_->save_octree(options_.out); });
    summary_.nothing_mapped = !has_occupied(*slam_->octree());
  }
  if (!options_.save_map.empty()) attempt([&] { slam_->save(options_.save_map); });
  elapsed_ms_ += wall_.lap_ms();
  if (slam_->readout() && !stopped && !failure_)  // it takes seconds where there is something to be doubted
    attempt([&] { summary_.warnings = readout_doubts(*slam_->readout(), sequence_, camera_); });
  if (earlier_run_) attempt([&] { note_leftovers(options_, summary_); });
  summary_.interrupted = stopped;
  summary_.stages = timings_.statistics();
  attempt([&] { write_summary(); });
}

/// What was tracked. Frames that were lost have poses after all where a map that was begun meanwhile was
/// joined.
void Run::take_trajectories() {
  summary_.trajectory = slam_->trajectory();
  summary_.live_trajectory = slam_->live_trajectory();
  summary_.separate = slam_->separate_trajectories();
  const std::size_t later =
      summary_.trajectory.size() - std::min(summary_.trajectory.size(), summary_.tracked);
  summary_.tracked += later;
  summary_.lost -= std::min(later, summary_.lost);
  if (later > 0) drop_found(lost_, summary_);
}

void Run::write_files() {
  attempt([&] { write_trajectory(options_.out / "trajectory.txt", summary_.trajectory); });
  attempt([&] { write_trajectory(options_.out / kLiveTrajectory, summary_.live_trajectory); });
  attempt([&] { write_trajectory(options_.out / "keyframes.txt", slam_->keyframe_trajectory()); });
  for (const SeparateTrajectory& map : summary_.separate)
    attempt([&] { write_trajectory(separate_file(options_.out, map.map), map.poses); });
  attempt([&] { timings_.write(options_.out / "timings.csv"); });
  if (evidence_) attempt([&] { evidence_->finish(slam_->map(), summary_.loops); });
  attempt([&] { write_summary(); });
}

void Run::write_summary() {
  if (live_) {
    summary_.live = live_->statistics();
    summary_.dropped = summary_.live->dropped;
  }
  summary_.fps = elapsed_ms_ > 0 ? 1000.0 * static_cast<double>(summary_.frames) / elapsed_ms_ : 0.0;
  summary_.peak_rss_mb = peak_rss_mb();
  write_file(options_.out / "summary.json", summary_json(options_, camera_, summary_));
}

RunSummary Run::summary() {
  if (failure_) std::rethrow_exception(failure_);
  if (summary_.tracked > 0 || summary_.interrupted) return std::move(summary_);
  refuse_without_poses(options_, summary_, any_depth_);
}

}  // namespace

RunSummary run_sequence(const RunOptions& options, const std::atomic<bool>& stop,
                        const std::function<void(const Progress&)>& progress,
                        const std::function<void(const Sequence&, const CameraConfig&)>& opened,
                        const RunWatch& watch) {
  check_request(options);
  Run run(options, watch, stop);
  if (opened) opened(run.sequence(), run.camera());
  run.attempt([&] { run.track(progress); });
  run.save();
  return run.summary();
}

}  // namespace dynslam::runtime
