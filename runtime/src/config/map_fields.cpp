// SPDX-License-Identifier: BSD-3-Clause
#include "config/field_list.hpp"

namespace dynslam::runtime::config {

void list(FieldList& f, LocalMatchOptions<double>& o) {
  f("max_distance", o.max_distance, "bits", "greatest Hamming distance of a match", kHamming);
  f("last_ratio", o.last_ratio, "",
    "distance of a match as a share of the second best's, for the last frame's points", kShare);
  f("local_ratio", o.local_ratio, "", "the same for points of the local map", kShare);
  f("keyframes", o.keyframes, "keyframes", "neighbouring keyframes whose points are searched",
    between(1, 10000));
  f("patch_sigma", o.patch_sigma, "px",
    "standard deviation of a match by patch, in pixels of its level; a corner has 1", kPositive);
  f("min_cosine", o.min_cosine, "",
    "cosine of the widest angle between the directions from which a point was seen and is seen", kCosine);
  f("straight_cosine", o.straight_cosine, "",
    "cosine above which a point counts as seen from the same direction", kCosine);
  f("straight_radius", o.straight_radius, "px",
    "search radius around a point seen from the same direction, in pixels of its level", kPositive);
  f("oblique_radius", o.oblique_radius, "px",
    "search radius around a point seen from elsewhere, in pixels of its level", kPositive);
  f("corner_radius", o.corner_radius, "px",
    "search radius around the match of a patch for the corner at the same place", kPositive);
  f("corner_octaves", o.corner_octaves, "levels", "pyramid levels that may lie between the two",
    between(0, 32));
}

void list(FieldList& f, MatchedPoseOptions<double>& o) {
  // left out: depth_noise: [tracker.depth_noise] goes for poses, too
  f("nu", o.nu, "", "degrees of freedom of the t-distribution", kPositive);
  f("min_pixel_scale", o.min_pixel_scale, "",
    "smallest estimate of the pixel noise, as a share of what the features state", between(0.01, 1));
}

void list(FieldList& f, PointMakerOptions<double>& o) {
  // left out: average: holds where [tracker] bundle is false
  // left out: depth_noise: [tracker.depth_noise] goes for points, too
  f("max_depth", o.max_depth, "m", "depth up to which points are made", kPositive);
  f("spacing", o.spacing, "px", "distance that a new point keeps from tracked ones", kNotNegative);
  f("enough_known", o.enough_known, "",
    "features on surfaces known to be static from which others make no points", kCount);
  f("nearer", o.nearer, "", "share of the first distance below which a point's patch is cut anew", kPositive);
  f("farther", o.farther, "", "share of the first distance above which a point's patch is cut anew",
    kPositive);
  f("aside_cosine", o.aside_cosine, "",
    "cosine of the viewing angle beyond which a point's patch is cut anew", kCosine);
  f("turned", o.turned, "rad", "turn of the camera beyond which a point's patch is cut anew", kPositive);
}

void list(FieldList& f, KeyframeOptions<double>& o) {
  f("urgent", o.urgent, "matches", "matches of the map below which a keyframe does not wait", kCount);
  f("min_gap", o.min_gap, "1/30 s", "time between two keyframes when nothing is urgent", kCount);
  f("max_gap", o.max_gap, "1/30 s", "time after which there is a keyframe in any case", from(1));
  f("ratio", o.ratio, "", "share of the last keyframe's points in view below which there is a new one",
    kShare);
  f("translation", o.translation, "m", "distance from the last keyframe that makes a new one", kPositive);
  f("rotation", o.rotation, "rad", "turn from the last keyframe that makes a new one", kPositive);
}

void list(FieldList& f, CoverageOptions<double>& o) {
  f("translation", o.translation, "m",
    "greatest distance to an earlier keyframe that serves instead of a new one", kNotNegative);
  f("rotation", o.rotation, "rad", "greatest turn to that keyframe", kNotNegative);
  f("seen", o.seen, "",
    "matches of the frame that it takes, as a share of the points that the keyframe shows", kNotNegative);
  f("shared", o.shared, "",
    "share of what shows less, the frame's matches or the keyframe, that both must show", kShare);
  f("min_matches", o.min_matches, "", "matches of the frame below which the place needs more points", kCount);
}

void list(FieldList& f, BundleWindowOptions<double>& o) {
  f("window", o.window, "keyframes",
    "keyframes that are adjusted: the newest and those that share most points with it", between(1, 10000));
  f("fixed", o.fixed, "keyframes", "keyframes outside that see the same points and stay as they are",
    between(0, 10000));
  f("min_sights", o.min_sights, "", "observations of a point that it takes to adjust it", from(1));
  f("outlier_chi2", o.outlier_chi2, "",
    "squared normalised error above which an observation is removed from the map", kPositive);
}

void list(FieldList& f, BundleOptions<double>& o) {
  f("max_iterations", o.max_iterations, "", "systems solved at most, refused steps included",
    between(0, 10000));
  f("initial_damping", o.initial_damping, "", "damping of the first step (Levenberg-Marquardt)", kPositive);
  f("tolerance", o.tolerance, "", "relative decrease of the cost that ends the iteration", kNotNegative);
  f("min_damping", o.min_damping, "", "smallest damping", kPositive);
  f("max_damping", o.max_damping, "", "damping beyond which the adjustment has stalled", kPositive);
  f("held_depth", o.held_depth, "", "share of a point's information that is added in all directions",
    kNotNegative);
}

void list(FieldList& f, LocalBundleOptions& o) {
  list(f, static_cast<BundleWindowOptions<double>&>(o));
  f("nu", o.nu, "", "degrees of freedom of the residuals' t-distribution", kPositive);
  f.table("solver", o.solver);
}

void list(FieldList& f, LoopOptions& o) {
  f("min_votes", o.min_votes, "descriptors", "common descriptors from which geometry is checked", kCount);
  f("candidates", o.candidates, "keyframes", "keyframes whose geometry is checked", between(0, 1000));
  f("min_inliers", o.min_inliers, "points", "points that must fit one pose", from(4));
  f("min_agreement", o.min_agreement, "", "share of the measured depths that must fit the pose", kShare);
  f("min_gap", o.min_gap, "keyframes", "keyframes between the two ends", from(1));
  f("min_shared", o.min_shared, "points", "common points that make keyframes neighbours, so not a loop",
    from(1));
  f("strong_edge", o.strong_edge, "points",
    "common points from which neighbours hold together in the pose graph", from(1));
  f("strong_edges", o.strong_edges, "", "such neighbours per keyframe, beside its predecessor", kCount);
  f("drift_floor", o.drift_floor, "m", "drift of the position that tracking may have: constant part",
    kNotNegative);
  f("drift_per_metre", o.drift_per_metre, "", "drift of the position per metre of the way", kNotNegative);
  f("drift_per_radian", o.drift_per_radian, "m/rad", "drift of the position per turn of the camera",
    kNotNegative);
  f("turn_floor", o.turn_floor, "rad", "drift of the rotation that tracking may have: constant part",
    kNotNegative);
  f("turn_per_radian", o.turn_per_radian, "", "drift of the rotation per turn of the camera", kNotNegative);
  f("translation_sigma", o.translation_sigma, "m", "standard deviation of neighbours' relative positions",
    kPositive);
  f("rotation_sigma", o.rotation_sigma, "rad", "standard deviation of neighbours' relative rotations",
    kPositive);
  f("loop_sigma_factor", o.loop_sigma_factor, "",
    "factor on a loop's standard deviation, as its points are not independent", kPositive);
  f("loop_sigma_floor", o.loop_sigma_floor, "m, rad",
    "smallest standard deviation of a loop, however many points prove it", kPositive);
  f("merge_old", o.merge_old, "keyframes",
    "neighbours of the old end whose points are searched, to merge points mapped twice", between(0, 10000));
  f("merge_new", o.merge_new, "keyframes", "neighbours of the new end in which they are searched",
    between(0, 10000));
  f("merge_radius", o.merge_radius, "px", "half side of that search", kPositive);
  f("merge_distance", o.merge_distance, "bits", "greatest Hamming distance of two views of one point",
    kHamming);
  f("merge_depth", o.merge_depth, "", "share of the distance by which the depth of the point may differ",
    kNotNegative);
}

void list(FieldList& f, PlaceOptions& o) {
  f("min_matches", o.min_matches, "", "matches by descriptor from which geometry is checked", from(3));
  f("min_inliers", o.min_inliers, "points", "points that must fit one pose in the end", from(4));
  f("min_agreement", o.min_agreement, "", "share of the measured depths that must fit the pose", kShare);
  f("neighbours", o.neighbours, "keyframes", "keyframes around the candidate whose points are searched, too",
    between(0, 10000));
  f("neighbour_shared", o.neighbour_shared, "points", "common points that make a keyframe one of those",
    from(1));
  f("nu", o.nu, "", "degrees of freedom of the refinement's t-distribution", kPositive);
  f("proposed_distance", o.proposed_distance, "bits",
    "greatest Hamming distance of a match by descriptor alone", kHamming);
  f("proposed_ratio", o.proposed_ratio, "", "distance of that match as a share of the second best's", kShare);
  f("expected_distance", o.expected_distance, "bits",
    "greatest Hamming distance where geometry limits the search", kHamming);
  f("search_sigmas", o.search_sigmas, "", "half side of that search, in standard deviations of a corner",
    kPositive);
  f("max_search_sigma", o.max_search_sigma, "px", "greatest standard deviation of a corner in that search",
    between(1, 1000));
  f("rounds", o.rounds, "", "times that the pose is refined and matches are searched from it",
    between(1, 1000));
  f("depth_slack", o.depth_slack, "", "share of the distance by which a measured depth may differ",
    kNotNegative);
  f("depth_slack_sigmas", o.depth_slack_sigmas, "", "standard deviations by which it may differ beside that",
    kNotNegative);
  f("seed", o.seed, "", "seed of the samples, to which a frame's index is added");
}

}  // namespace dynslam::runtime::config
