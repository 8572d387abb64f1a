// SPDX-License-Identifier: BSD-3-Clause
#include "config/field_list.hpp"

namespace dynslam::runtime::config {

void list(FieldList& f, TrackerOptions& o) {
  // left out: dynamics: [general] dynamics goes for all
  // left out: seed: [general] seed goes for all
  f("method",
    choice(o.method, {MotionMethod::paper, MotionMethod::full}, &parse_method,
           [](MotionMethod method) { return to_string(method); }),
    "paper: the paper's steps alone; full: also free space, people at rest, additions");
  f("additions",
    choice(o.additions, {Additions::by_mode, Additions::none, Additions::all}, &parse_additions,
           [](Additions additions) { return to_string(additions); }),
    "to the paper's search for a pose: features count by the surface that they stand for and the predicted "
    "motion counts, too; matches of the local map that are far off are dropped before it is optimised; where "
    "few features lead from the last frame its grey values are another start; auto: all with the full method "
    "in all modes but none");
  f.table("features", o.features);
  f.table("depth_noise", o.depth_noise);
  f("initial_features", o.initial_features, "", "features with depth that it takes to start a map", from(1));
  f("semantic_dilation", o.semantic_dilation, "px", "margin added around a-priori masks", between(0, 500));
  f("feature_margin", o.feature_margin, "px", "margin around the fused mask in which features are not used",
    between(0, 500));
  f("bundle", o.bundle, "", "adjust the newest keyframes and their points (bundle adjustment)");
  f("bundle_delay", o.bundle_delay, "frames",
    "frames after which the adjustment's result is waited for and used", from(1));
  f("close_loops", o.close_loops, "", "close loops");
  f("loop_bundle_window", o.loop_bundle_window, "keyframes", "keyframes adjusted after a loop",
    between(1, 10000));
  f("loop_bundle_delay", o.loop_bundle_delay, "frames",
    "frames after which the result of that is waited for and used", from(1));
  f("redundant_keyframe", o.redundant_keyframe, "",
    "share of a keyframe's points that three others see, too, above which it is removed", kShare);
  f("spare_keyframes", o.spare_keyframes, "keyframes", "number of newest keyframes that are never removed",
    from(1));
  f("reference_distance", o.reference_distance, "keyframes",
    "keyframes between the present one and the reference of the geometric masks", kCount);
  f.table("search", o.search);
  f.table("alignment", o.alignment);
  f.table("geometry", o.geometry);
  f.table("matching", o.matching);
  f.table("pose", o.pose);
  f.table("points", o.points);
  f.table("keyframes", o.keyframes);
  f.table("coverage", o.coverage);
  f.table("arbitration", o.arbitration);
  f.table("local_bundle", o.local_bundle);
  f.table("loops", o.loops);
  f.table("relocalisation", o.relocalisation);
}

void list(FieldList& f, FeatureOptions& o) {
  f("features", o.features, "", "features wanted per image", between(100, 10000));
  f("levels", o.levels, "", "levels of the image pyramid", between(1, 32));
  f("scale_factor", o.scale_factor, "", "scale between two levels", between(1.01, 2));
  f("fast_threshold", o.fast_threshold, "grey values", "threshold of the FAST detector", between(1, 255));
  f("fast_threshold_low", o.fast_threshold_low, "grey values",
    "threshold for cells in which the first one finds nothing", between(1, 255));
  f("cell", o.cell, "px", "side of the cells over which features are spread, in pixels of their level",
    between(4, 10000));
}

void list(FieldList& f, PoseTrackingOptions<double>& o) {
  f("min_inliers", o.min_inliers, "", "inliers that it takes to accept a pose", from(4));
  f("weak_inliers", o.weak_inliers, "",
    "inliers among the last frame's points that make a start, which the local map has to prove", from(4));
  f("sure_inliers", o.sure_inliers, "",
    "inliers among them with fewer of which the local map is matched again from the pose that it gave",
    kCount);
  f("settling_passes", o.settling_passes, "", "how often at most it is matched then", between(1, 100));
  f("settling_growth", o.settling_growth, "", "how many times the inliers have to grow for another time",
    between(1, 10));
  f("coasting_frames", o.coasting_frames, "frames",
    "lost for fewer frames, the camera is first looked for where its motion leads", kCount);
  f("near_radius", o.near_radius, "px",
    "radius of the first search for the last frame's points, in pixels of their level", kPositive);
  f("far_radius", o.far_radius, "px", "radius of the second search", kPositive);
  f("aligned_starts", o.aligned_starts, "",
    "whether the last frame's grey values are a start where few features lead from it");
  f("surface_weights", o.surface_weights, "",
    "whether the last frame's points count by the surface that they stand for");
  f("prior_share", o.prior_share, "", "weight of the predicted motion, as a share of all matches",
    between(0, 100));
  f("prior_speed", o.prior_speed, "m/s", "standard deviation of the change of velocity between two frames",
    kPositive);
  f("prior_turn", o.prior_turn, "rad/s",
    "standard deviation of the change of angular velocity between two frames", kPositive);
  f("strict_local_map", o.strict_local_map, "",
    "whether matches of the local map that are far off are dropped before the pose is optimised");
  f("local_chi2", o.local_chi2, "",
    "squared normalised error above which a match of the local map is dropped", kPositive);
  f("candidates", o.candidates, "keyframes", "keyframes tried per lost frame", between(0, 1000));
  f("max_speed", o.max_speed, "m/s",
    "greatest speed of the camera: a place farther away is taken for another one that looks alike",
    kPositive);
  f("max_turn", o.max_turn, "rad/s", "greatest angular velocity of the camera", kPositive);
  f("turn_doubt", o.turn_doubt, "rad/s",
    "how well the motion between frames tells the camera's turn while it reads its rows; 0: it is taken for "
    "it",
    kNotNegative);
  f("revise", o.revise, "",
    "whether a frame is placed once more by the motion that the next one tells, where rows are read one "
    "after the other");
  f("longest_delay", o.longest_delay, "s",
    "longest delay of a depth image over which the velocity is trusted", kNotNegative);
  f("young_frames", o.young_frames, "frames",
    "of a map, in which the pose is compared with the motion of what lies behind; 0: never", kCount);
  f("foreground_share", o.foreground_share, "",
    "of a pose's matches that lies on what stands before the room, up to which it is not compared", kShare);
}

void list(FieldList& f, ImageAlignmentOptions<double>& o) {
  f("rounds", o.rounds, "", "rounds per level, before each of which the residuals' scale is estimated",
    from(1));
  f("max_iterations", o.max_iterations, "", "steps per round", from(1));
  f("tolerance", o.tolerance, "", "relative decrease of the cost that ends a round", kNotNegative);
  f("nu", o.nu, "", "degrees of freedom of the t-distribution", kPositive);
  f("min_scale", o.min_scale, "grey values", "smallest scale of the residuals", kPositive);
  f("min_gradient", o.min_gradient, "grey values/px", "gradient from which a pixel counts", kNotNegative);
  f("max_pixels", o.max_pixels, "", "pixels per level", from(1));
  f("min_pixels", o.min_pixels, "", "pixels that a level needs", from(6));
  f("min_overlap", o.min_overlap, "", "share of the last frame's pixels that must be in view", kShare);
  f("outside_deviations", o.outside_deviations, "", "standard deviations that a pixel out of view costs",
    kNotNegative);
  f("initial_damping", o.initial_damping, "", "damping of the first step", kPositive);
  f("min_damping", o.min_damping, "", "smallest damping", kPositive);
}

void list(FieldList& f, MaskArbitrationOptions<double>& o) {
  f("min_left", o.min_left, "", "share of the features below which a mask is put to the test at once",
    kShare);
  f("min_inliers", o.min_inliers, "", "inliers that make a pose", from(4));
  f("doubt", o.doubt, "", "share of matching features below which a mask is put to the test", kShare);
  f("max_loss", o.max_loss, "", "growth of the pose's standard deviation that is accepted without a reason",
    kPositive);
  f("max_chi2", o.max_chi2, "", "squared normalised distance up to which two poses count as the same",
    kPositive);
  f("young", o.young, "frames", "in which a point was in view, below which it cannot tell of one motion");
  f("shared_translation", o.shared_translation, "m", "error of the map's position that all matches share",
    kPositive);
  f("shared_rotation", o.shared_rotation, "rad", "error of the map's rotation that all matches share",
    kPositive);
}

}  // namespace dynslam::runtime::config
