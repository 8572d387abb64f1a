// SPDX-License-Identifier: BSD-3-Clause
// The stages around the tracker: network, octree, and the run itself.
#include <array>

#include "config/field_list.hpp"

namespace dynslam::runtime::config {
namespace {

std::string_view engine_name(EngineKind kind) {
  constexpr std::array<std::string_view, 3> kNames{"auto", "onnxruntime", "opencv"};
  return kNames[static_cast<std::size_t>(kind)];
}

/// A mode, or "auto".
ConfigChoice mode_choice(std::optional<DynamicsMode>& mode) {
  ConfigChoice result{&mode,
                      {"auto"},
                      [&mode] { return mode ? std::string(to_string(*mode)) : "auto"; },
                      [&mode](std::string_view name) { mode = parse_dynamics(name); }};
  for (const auto one :
       {DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both})
    result.names.emplace_back(to_string(one));
  return result;
}

}  // namespace

void list(FieldList& f, DetectionOptions& o) {
  f("min_score", o.min_score, "", "score from which a detection counts", kShare);
  f("max_overlap", o.max_overlap, "",
    "intersection over union above which the weaker of two of a class is dropped", kShare);
  f("mask_threshold", o.mask_threshold, "", "probability from which a pixel belongs to an object", kShare);
  f("max_detections", o.max_detections, "", "detections kept per image, the strongest first",
    between(1, 10000));
}

void list(FieldList& f, SegmenterOptions& o) {
  f("model", o.model, "", "network file (.onnx); empty: none");
  f("engine",
    choice(o.engine, {EngineKind::automatic, EngineKind::onnxruntime, EngineKind::opencv}, &parse_engine,
           &engine_name),
    "what runs the network");
  f("kind",
    choice(o.kind, {ModelKind::automatic, ModelKind::yolo, ModelKind::mask_rcnn, ModelKind::semantic},
           &parse_model_kind, [](ModelKind kind) { return to_string(kind); }),
    "what the network's outputs mean");
  f("output",
    choice(o.output,
           {ModelOutput::automatic, ModelOutput::labels, ModelOutput::logits, ModelOutput::probability,
            ModelOutput::mask},
           &parse_model_output, [](ModelOutput output) { return to_string(output); }),
    "what the only channel of a semantic network holds");
  f("output_name", o.output_name, "", "output that is the segmentation; empty: found by name and shape");
  // left out: labels: those of the map that a run goes on in
  // left out: stop: of the program that runs the network
  f("threads", o.threads, "", "threads of the network", between(1, 64));
  f("memory", o.memory, "bytes", "memory that the network may take; one that needs more is refused",
    between(1 << 20, 1e12));
  f("dynamic_classes", o.dynamic_classes, "", "names of classes that move by themselves");
  f("map_classes", o.map_classes, "",
    "names of classes that the map labels, four of them beside chairs and displays; empty: chairs and "
    "displays, "
    "as far as the model has them");
  f("input", o.input, "px", "width and height of the network's input where it leaves them open",
    between(16, 8192));
  f.table("detection", o.detection);
}

void list(FieldList& f, MaskKeeperOptions& o) {
  f("max_age", o.max_age, "frames", "frames that a mask outlives its last detection", kCount);
  f("max_seconds", o.max_seconds, "s", "time that it does so instead; 0: max_age counts", kNotNegative);
  f("points", o.points, "corners", "corners that carry a mask", between(1, 10000));
  f("min_points", o.min_points, "corners", "corners followed below which a mask is dropped", from(1));
  f("depth_margin", o.depth_margin, "m", "margin around an object's depth that may be its own", kNotNegative);
  f("band", o.band, "px", "margin around a mask that may be added to it by depth, per image",
    between(0, 500));
  f("most_band", o.most_band, "px", "and in all while it is carried", between(0, 500));
  f("redetected", o.redetected, "", "share of a kept mask under new detections from which it is replaced",
    kShare);
  f("max_cover", o.max_cover, "", "share of the image above which kept masks are given up", kShare);
}

void list(FieldList& f, FrameSegmenterOptions& o) {
  f("every", o.every, "frames",
    "the network sees every so many frames; masks are carried between them; 0: one each `period`",
    between(0, 1000));
  f("period", o.period, "s", "time from one frame that the network sees to the next where `every` is 0",
    between(0.001, 1000));
  f("keep", o.keep, "", "cut masks to the object's depth and carry missed ones forward");
  f("cache", o.cache, "", "folder that keeps the network's masks between runs; empty: none");
  f.table("segmenter", o.segmenter);
  f.table("keeper", o.keeper);
}

void list(FieldList& f, SegmentationStageOptions& o) {
  list(f, static_cast<FrameSegmenterOptions&>(o));
  f("async", o.async, "", "run the network on a thread of its own, ahead of the tracker (same results)");
  f("queue", o.queue, "frames", "frames segmented ahead", between(1, 1000));
}

void list(FieldList& f, LogOddsParams<float>& o) {
  f("hit", o.hit, "log-odds", "log-odds of a voxel in which a surface is seen", between(0, 20));
  f("miss", o.miss, "log-odds", "log-odds of a voxel that is seen through", between(-20, 0));
  f("min", o.min, "log-odds", "lower bound of a voxel's sum", between(-20, -0.01));
  f("max", o.max, "log-odds", "upper bound of a voxel's sum", between(0.01, 20));
  f("occupied", o.occupied, "log-odds", "log-odds from which a voxel is occupied", between(-20, 20));
}

void list(FieldList& f, MapScanOptions& o) {
  f("pixel_stride", o.pixel_stride, "px", "one pixel of so many in both directions is used", between(1, 100));
  f("max_range", o.max_range, "m", "depth up to which surfaces are mapped; 0: by its noise, see range_edges",
    between(0, 100));
  f("range_edges", o.range_edges, "",
    "edges of a voxel that the standard deviation of depth may span at that range", kPositive);
  f("max_incidence", o.max_incidence, "rad",
    "angle between ray and surface normal beyond which a pixel is left out", between(0.01, 1.57));
  f("edge_reach", o.edge_reach, "px", "distance to the neighbours that this is measured with",
    between(1, 100));
  f("edge_sigmas", o.edge_sigmas, "", "standard deviations by which their depth may differ beside that",
    kNotNegative);
  f("carve_sigmas", o.carve_sigmas, "", "standard deviations before the surface at which a ray stops",
    kNotNegative);
  f("full_weight_edge", o.full_weight_edge, "",
    "standard deviations that a voxel's edge must span for a surface to count fully", kPositive);
  f("mover_label", o.mover_label, "", "label that is never a surface (people); -1: none", between(-1, 63));
  f.table("noise", o.noise);
}

void list(FieldList& f, SemanticMapperOptions& o) {
  // left out: resolution: [general] map_resolution
  // left out: max_bytes: [general] map_memory
  // left out: classes: [segmentation.segmenter] map_classes, and those of the map that a run goes on in
  // left out: retain_scans: a run's map follows corrected poses and needs its scans
  f("queue", o.queue, "keyframes", "keyframes that may wait with their images", between(1, 1000));
  f("scans_per_view", o.scans_per_view, "", "scans kept of one view; 0: all", kCount);
  f.table("scan", o.scan);
  f.table("occupancy", o.occupancy);
}

void list(FieldList& f, LiveOptions& o) {
  f("queue", o.queue, "frames", "frames that wait beside the two at work; one too many drops the oldest",
    between(1, 1000));
  f("mask_age", o.mask_age, "s", "time that a network's masks are carried forward at most", kNotNegative);
}

void list(FieldList& f, NewMapOptions& o) {
  f("begin", o.begin, "", "begin a new map after a loss that lasts, joined when the place is recognised");
  f("after", o.after, "s", "time that the camera is lost before", kNotNegative);
  f("agreeing", o.agreeing, "frames",
    "frames in a row in which both maps must agree where one lies in the other", from(1));
  f("agreement", o.agreement, "m", "distance between two such placings of the camera that counts as the same",
    kPositive);
  f("agreement_turn", o.agreement_turn, "rad", "and turn", kPositive);
  f("patience", o.patience, "frames",
    "frames in which they may disagree before the new map is left alone until a keyframe", from(1));
  f("scans", o.scans, "keyframes", "keyframes of a new map that are kept for the octree", between(2, 100000));
}

void list(FieldList& f, SmoothingOptions& o) {
  f("nu", o.nu, "", "degrees of freedom of the t-distribution of the poses' errors", kPositive);
  f("iterations", o.iterations, "", "of the weights by that", from(1));
  f("longest_gap", o.longest_gap, "s", "time without a pose over which nothing is known of the motion",
    kPositive);
  f("min_poses", o.min_poses, "frames", "poses in a row from which on they are smoothed", from(4));
  f("max_ratio", o.max_ratio, "", "between the largest and the smallest weight of two poses", from(1));
  f("max_move", o.max_move, "", "own standard deviations beyond which a pose is left where it was measured",
    kPositive);
  f("margin", o.margin, "", "ratio of squared errors of prediction that is more than chance", from(1));
}

void list(FieldList& f, TrajectoryOptions& o) {
  f("smooth", o.smooth, "", "smooth trajectory.txt in the end; not with the paper's method");
  list(f, static_cast<SmoothingOptions&>(o));
}

void list(FieldList& f, RunOptions& o) {
  // left out: sequence: given for each run
  // left out: out: given for each run
  // left out: verbose: changes nothing of the results
  // left out: save_map: given for each run, which would replace the map that it started from
  // left out: dynamics: config_fields() has it, which may leave it open
  f.section("general");
  f("seed", o.seed, "", "seed of every random choice");
  f("camera", o.camera, "", "fr1, fr2, fr3, bonn or a camera file; empty: from the sequence");
  f("readout_time", o.readout_time, "s",
    "time in which the camera reads its rows, 0: all at once; \"auto\": as the camera has it",
    between(-0.2, 0.2));
  f("format", o.format, "",
    "format of the sequence, see docs/your-own-data.md; empty: by looking at the folder");
  f("topics", o.topics, "", "topics of a bag, COLOUR,DEPTH; empty: by looking at it");
  f("rate", o.rate, "1/s", "frame rate of formats without time stamps", between(0.01, 10000));
  f("masks", o.masks, "", "folder of a-priori masks; empty: none");
  f("mask_labels", o.mask_labels, "",
    "what their values mean, \"15=person\" and the like or one of voc, coco, cityscapes, instances, binary; "
    "empty: "
    "by looking at them");
  f("save_masks", o.save_masks, "", "write the dynamic masks");
  f("report", o.report, "", "write report.html, and what it shows of each frame into report.jsonl");
  f("map", o.map, "", "build and save map.sot");
  f("map_resolution", o.map_resolution, "m", "edge of a voxel", between(0.005, 1));
  f("map_memory", o.map_memory, "bytes", "memory that the octree may take; a run that needs more fails",
    between(1 << 20, 1e12));
  f("load_map", o.load_map, "", "folder of an earlier run's map to go on in; empty: a new one");
  f("max_frames", o.max_frames, "frames", "frames after which the run stops; 0: all");
  f("save_every", o.save_every, "s", "time after which trajectory and summary so far are written again",
    between(0.1, 3600));
  f("max_broken", o.max_broken, "", "share of broken frames with which a run still succeeds", kShare);
  f("schedule",
    choice(o.schedule, {Schedule::deterministic, Schedule::live}, &parse_schedule,
           [](Schedule schedule) { return to_string(schedule); }),
    "deterministic: every frame is waited for; live: frames come at their recorded pace, those too many are "
    "dropped, and results differ between runs");
  f("live_speed", o.live_speed, "", "pace of a live run, as a multiple of the recorded one",
    between(0.01, 1000));
  f("live_gap", o.live_gap, "s", "time between two frames of a live run that is waited for at most",
    between(0.01, 1e6));
  f.section("");
  f.table("live", o.live);
  f.table("new_map", o.new_map);
  f.table("trajectory", o.trajectory);
  f.table("segmentation", o.segmentation);
  f.table("tracker", o.tracker);
  f.table("mapper", o.mapper);
}

}  // namespace dynslam::runtime::config

namespace dynslam::runtime {

ConfigFields config_fields(RunOptions& options, std::optional<DynamicsMode>& dynamics) {
  config::FieldList f;
  f.section("general");
  f("dynamics", config::mode_choice(dynamics),
    "masks that are used: none, semantic, geometric, both; auto: both where there is a model or masks, else "
    "geometric");
  list(f, options);
  return f.take();
}

}  // namespace dynslam::runtime
