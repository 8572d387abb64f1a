// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam.hpp"

#include <map>
#include <string>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/time_stamp.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "io/argument_check.hpp"
#include "io/folder_draft.hpp"
#include "io/frame_of_images.hpp"
#include "slam/event_journal.hpp"
#include "slam/frame_poses.hpp"
#include "slam/input_check.hpp"
#include "slam/run_map.hpp"
#include "slam/separate_maps.hpp"

namespace dynslam::runtime {
namespace {

TrackerOptions tracker_options(const SlamOptions& options) {
  TrackerOptions result = options.tracker;
  result.dynamics = options.dynamics;
  result.seed = result.geometry.weights.seed = options.seed;
  return result;
}

SemanticMapperOptions mapper_options(const SlamOptions& options) {
  SemanticMapperOptions result = options.mapper;
  result.resolution = options.map_resolution;
  result.max_bytes = options.map_memory;
  if (options.network) result.classes = with_classes(result.classes, options.network->segmenter.map_classes);
  return result;
}

/// What the camera says of its depth goes before the options' defaults, and what was set before both.
SlamOptions with_noise_of(const CameraConfig& camera, SlamOptions options) {
  if (!camera.depth_noise) return options;
  // Poses and points reckon with more than the sensor's noise: the colour image was taken at another time.
  // The factor is the one between the two defaults.
  constexpr double kTiming = 4;
  auto& tracking = options.tracker.depth_noise;
  auto& weights = options.tracker.geometry.weights.depth_noise;
  auto& map = options.mapper.scan.noise;
  if (tracking == TrackerOptions().depth_noise) tracking = camera.depth_noise->times(kTiming);
  if (weights == DepthNoise<double>()) weights = *camera.depth_noise;
  if (map == DepthNoise<float>()) map = camera.depth_noise->cast<float>();
  return options;
}

/// Puts a keyframe into an octree. @param frames  those that were tracked, @param map  where they are now
void insert_scan(const TrackResult& result, const RgbdFrame& frame, const std::optional<Masks>& prior,
                 const FramePoses& frames, const LocalMap& map, RunMap& octree) {
  std::optional<SE3<double>> T_w_earlier;
  if (prior && prior->earlier) T_w_earlier = frames.pose_at(prior->earlier->t, map);
  octree.insert(result, frame, prior, T_w_earlier);
}

/// Puts the scans of a map that was begun while the camera was lost into an octree.
/// @param frames     those that were tracked
/// @param keyframes  where they are now
/// @param first      id there of the map's first keyframe
void insert_scans(const SeparateMap& map, const FramePoses& frames, const LocalMap& keyframes, int first,
                  RunMap& octree) {
  for (const SeparateMap::Scan& scan : map.scans()) {
    TrackResult result = scan.result;
    result.reference += first;
    result.T_w_c = keyframes.pose(result.reference).inverse();
    insert_scan(result, scan.frame, scan.prior, frames, keyframes, octree);
  }
}

}  // namespace

struct Slam::State {
  State(const CameraConfig& c, const SlamOptions& o)
      : camera(c),
        options(with_noise_of(c, o)),
        tracker(std::make_unique<Tracker>(c, tracker_options(options))),
        journal(o.events),
        separate(std::make_unique<SeparateMaps>(c, tracker_options(options), o.new_map, o.map)) {
    if (o.map) octree = std::make_unique<RunMap>(c, mapper_options(options), options.mapped);
  }

  /// Runs what leaves the map in pieces where it throws.
  template <class Step>
  void step(Step&& work) {
    const bool before = std::exchange(whole, false);
    work();
    whole = before;
  }
  /// Has a map that was begun while the camera was lost become part of the main one.
  void join(SeparateMap& map, double t);
  /// Poses of the frames of a map, smoothed where the end is known.
  [[nodiscard]] std::vector<StampedPose<double>> trajectory(const FramePoses& of, const LocalMap& map) const {
    const bool smooth = finished && options.trajectory.smooth && options.tracker.method == MotionMethod::full;
    return smooth ? of.smoothed(map, options.trajectory) : of.poses(map, false);
  }
  /// Saves a map that was never joined beside the main one in its folder.
  void save_beside(const SeparateMap& map, const std::filesystem::path& folder);

  CameraConfig camera;
  SlamOptions options;
  std::unique_ptr<Tracker> tracker;
  EventJournal journal;
  std::unique_ptr<RunMap> octree;
  std::unique_ptr<FrameSegmenter> network;
  std::unique_ptr<SeparateMaps> separate;
  FramePoses frames;
  std::vector<StampedPose<double>> live;  // as track() returned them
  std::size_t seen = 0;                   // frames
  std::optional<double> last_t;
  bool located = false;  // the last frame
  SavedScans loaded;
  std::map<std::pair<std::filesystem::path, int>, std::filesystem::path> beside;  // folders of separate maps
  bool whole = true;
  bool finished = false;  // nothing was tracked since
};

void Slam::State::join(SeparateMap& map, double t) {
  map.tracker().finish();
  const int first = tracker->adopt(map.tracker().map(), map.T_main_w());
  frames.take(map.frames(), first);
  if (octree) insert_scans(map, frames, tracker->map(), first, *octree);
  journal.joined({t, map.number, map.frames().size(), map.T_main_w()});
}

void Slam::State::save_beside(const SeparateMap& map, const std::filesystem::path& folder) {
  std::filesystem::path& own = beside[{folder, map.number}];
  for (int n = map.number; own.empty(); ++n) {  // what an earlier run left there stays
    const auto name = folder / ("map" + std::to_string(n));
    if (!std::filesystem::exists(name)) own = name;
  }
  LocalMap keyframes = map.tracker().map();
  std::unique_ptr<RunMap> scans;
  std::vector<int> names;
  if (octree && whole && !map.scans().empty()) {
    scans = std::make_unique<RunMap>(camera, mapper_options(options));
    insert_scans(map, map.frames(), keyframes, 0, *scans);
    scans->finish();
    names = scans->tidy(keyframes);
  }
  save_slam_map(keyframes, camera, scans ? &scans->mapper() : nullptr, own, {}, names);
}

Slam::Slam(const CameraConfig& camera, const SlamOptions& options)
    : state_(std::make_unique<State>(camera, options)) {
  if (!options.network) return;
  if (!uses_semantic(options.dynamics))
    throw UsageError("SlamOptions: a network needs the mode `semantic` or `both`");
  state_->network = std::make_unique<FrameSegmenter>(*options.network);
}

Slam::~Slam() = default;

TrackResult Slam::track(const cv::Mat& image, const cv::Mat& depth, double t,
                        const std::optional<Masks>& prior, double depth_delay) {
  RgbdFrame frame = frame_of_images(image, depth, {t, 0}, state_->camera);
  frame.depth_delay = depth_delay;
  return track_new(frame, prior);
}

TrackResult Slam::track_new(const RgbdFrame& frame, const std::optional<Masks>& prior) {
  if (prior || !state_->network) return track(frame, prior);
  check_input(frame, prior, state_->camera, state_->last_t);  // the network remembers what it has seen
  const FrameMasks segmented = state_->network->segment(frame, state_->seen);
  return track(frame, segmented.masks);
}

TrackResult Slam::track(const cv::Mat& image, const cv::Mat& depth, std::chrono::nanoseconds t,
                        const std::optional<Masks>& prior, double depth_delay) {
  RgbdFrame frame = frame_of_images(image, depth, time_of(t.count()), state_->camera);
  frame.depth_delay = depth_delay;
  return track_new(frame, prior);
}

TrackResult Slam::track(const RgbdFrame& frame, const std::optional<Masks>& prior) {
  State& s = *state_;
  s.journal.check_not_telling("Slam::track()");
  check_input(frame, prior, s.camera, s.last_t);
  s.last_t = frame.t;
  ++s.seen;
  s.finished = false;
  TrackResult result;
  s.located = false;
  s.journal.begin(*s.tracker);
  s.step([&] {
    result = s.tracker->track(frame, prior);
    s.located = result.ok();
    if (result.ok()) s.frames.add(frame, result);
    if (!result.keyframe || !s.octree) return;
    insert_scan(result, frame, prior, s.frames, s.tracker->map(), *s.octree);
    if (result.loop) s.octree->follow(s.tracker->map());
  });
  s.journal.note(*s.tracker, frame.t, &result);
  s.step([&] {
    const int begun = s.separate->begun();
    const std::unique_ptr<SeparateMap> joined = s.separate->see(frame, prior, result);
    if (s.separate->begun() != begun) s.journal.begun({frame.t, result.separate->map});
    if (joined) s.join(*joined, frame.t);
  });
  if (result.ok()) s.live.push_back({frame.t, result.T_w_c, frame.ns});
  s.journal.tell();
  return result;
}

void Slam::finish() {
  State& s = *state_;
  s.journal.check_not_telling("Slam::finish()");
  s.journal.begin(*s.tracker);
  s.step([&s] {
    s.tracker->finish();
    s.separate->finish();
    if (!s.octree) return;
    s.octree->follow(s.tracker->map());
    s.octree->finish();
  });
  s.finished = true;
  s.journal.note(*s.tracker, s.last_t.value_or(0), nullptr);
  s.journal.tell();
}

std::vector<StampedPose<double>> Slam::trajectory() const {
  return state_->trajectory(state_->frames, state_->tracker->map());
}

const std::vector<StampedPose<double>>& Slam::live_trajectory() const {
  return state_->live;
}

std::vector<StampedPose<double>> Slam::keyframe_trajectory() const {
  return state_->frames.poses(state_->tracker->map(), true);
}

std::vector<SeparateTrajectory> Slam::separate_trajectories() const {
  std::vector<SeparateTrajectory> result;
  for (const auto& map : state_->separate->maps()) {
    if (map->frames().size() > 0)
      result.push_back({map->number, state_->trajectory(map->frames(), map->tracker().map())});
  }
  return result;
}

const LocalMap& Slam::map() const {
  return state_->tracker->map();
}

const interop::SemanticOcTree* Slam::octree() const {
  return state_->octree ? &state_->octree->mapper().tree() : nullptr;
}

const MotionResult<double>* Slam::motion() const {
  return state_->located ? state_->tracker->motion() : nullptr;
}

void Slam::measure_readout() {
  state_->tracker->measure_readout();
}

const std::optional<ReadoutMeasurement<double>>& Slam::readout() const {
  return state_->tracker->readout();
}

/// Never makes a saved map poorer: of a map in pieces nothing takes the place of what is there.
void Slam::save(const std::filesystem::path& folder) {
  State& s = *state_;
  if (s.tracker->map().keyframes().empty()) return;
  if (s.whole) finish();
  if (!s.whole && std::filesystem::exists(folder / "keyframes.bin"))
    throw InputError(folder.string(), 0, "stays as it was, because the run failed");
  LocalMap map = s.tracker->map();
  const bool mapped = s.octree && s.whole;
  std::vector<int> names;  // scans that are taken over name their keyframes as they are
  if (mapped) names = s.octree->tidy(map);
  save_slam_map(map, s.camera, mapped ? &s.octree->mapper() : nullptr, folder, s.loaded, names);
  for (const auto& separate : s.separate->maps()) {
    if (separate->frames().size() > 0) s.save_beside(*separate, folder);
  }
}

void Slam::load(const std::filesystem::path& folder) {
  State& s = *state_;
  s.journal.check_not_telling("Slam::load()");
  s.loaded.folder = folder;
  std::optional<LocalMap> map;
  read_unchanged(folder, [&] {
    map = load_slam_map(folder, s.camera, &s.loaded.map_id);
    if (s.octree) s.octree->load(folder, {s.loaded.map_id, static_cast<int>(map->keyframes().size())});
  });
  s.tracker->load(std::move(*map));
  s.journal.loaded();
}

void Slam::save_octree(const std::filesystem::path& folder) {
  check_argument(state_->octree != nullptr, "Slam::save_octree(): no octree is built");
  if (state_->whole) finish();
  check_argument(state_->whole, "Slam::save_octree(): the octree is in pieces after an error");
  state_->octree->save(folder);
}

void Slam::reset() {
  state_->journal.check_not_telling("Slam::reset()");
  auto network = std::move(state_->network);
  state_ = std::make_unique<State>(state_->camera, state_->options);
  state_->network = std::move(network);
  if (state_->network) state_->network->reset();
}

bool Slam::whole() const {
  return state_->whole;
}

}  // namespace dynslam::runtime
