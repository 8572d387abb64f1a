// SPDX-License-Identifier: BSD-3-Clause
#include "config/field_list.hpp"

namespace dynslam::runtime::config {
namespace {

constexpr ConfigRange kCells = between(0, 100);  // around each cell: the whole image, where cells are many

}  // namespace

void list(FieldList& f, PatchAlignmentOptions<float>& o) {
  f("max_iterations", o.max_iterations, "", "iterations of the alignment", between(1, 1000));
  f("tolerance", o.tolerance, "px", "step that ends the iteration", kPositive);
  f("max_shift", o.max_shift, "px", "distance from the start beyond which a match is refused", kPositive);
  f("min_correlation", o.min_correlation, "", "smallest zero-mean normalised cross-correlation of a match",
    kCosine);
}

void list(FieldList& f, PatchMatchOptions& o) {
  f("min_gradient", o.min_gradient, "grey^2/px^2",
    "texture that a patch needs: smaller eigenvalue of the mean gradient product", kNotNegative);
  f("min_area", o.min_area, "", "smallest area of the patch's image, as a share of the patch", kPositive);
  f("max_area", o.max_area, "", "largest area of the patch's image, as a multiple of the patch", kPositive);
  f("coarser", o.coarser, "", "how much larger than wanted the pixels of a level may be", kPositive);
  f.table("alignment", o.alignment);
}

void list(FieldList& f, PatchSearchOptions& o) {
  f("min_gradient", o.min_gradient, "grey^2/px^2",
    "texture below which a level is passed over: smaller eigenvalue of the mean gradient product",
    kNotNegative);
  f.table("alignment", o.alignment);
}

void list(FieldList& f, ReferenceOptions& o) {
  f("points", o.points, "keypoints", "keypoints of the reference that are used at most", from(1));
  f("max_depth", o.max_depth, "m", "depth beyond which nothing is judged", kPositive);
  f("levels", o.levels, "", "pyramid levels that are searched", between(1, 10));
  f("at_rest_px", o.at_rest_px, "px", "distance from the expected place up to which a keypoint is at rest",
    kPositive);
  f("confirmed_px", o.confirmed_px, "px",
    "greatest distance between what the search found and the patch there", kPositive);
  f("border_px", o.border_px, "px", "distance from the image border within which keypoints are left out",
    between(4, 1000));
  f("min_in_view", o.min_in_view, "", "share of its keypoints in view below which a reference is replaced",
    kShare);
  f("min_found", o.min_found, "", "share of its keypoints found below which a reference is replaced", kShare);
  f("pause", o.pause, "frames", "frames after which a keypoint that was not found is searched again", kCount);
  f.table("match", o.match);
  f.table("search", o.search);
}

void list(FieldList& f, StaticWeightScales<double>& o) {
  f("photometric", o.photometric, "grey values", "smallest scale of the photometric errors", kPositive);
  f("reprojection", o.reprojection, "px", "smallest scale of the reprojection errors", kPositive);
  f("depth", o.depth, "sensor standard deviations", "smallest scale of the depth errors", kPositive);
}

void list(FieldList& f, StaticWeightsOptions<double>& o) {
  // left out: seed: [general] seed goes for all
  f("nu", o.nu, "", "degrees of freedom of the t-distribution", kPositive);
  f("numerator", o.numerator, "",
    "numerator of Eq (7); \"auto\": nu and the number of errors, so that a typical static point has weight 1",
    kPositive);
  f("tau", o.tau, "", "weight below which a keypoint is dynamic", kPositive);
  f("min_matches", o.min_matches, "", "matches outside the mask from which scales and F are estimated",
    between(8, 1e6));
  f("epipolar_px", o.epipolar_px, "px", "distance from the epipolar line that makes a mismatch", kPositive);
  f("min_parallax_px", o.min_parallax_px, "px", "median parallax below which F is not estimated",
    kNotNegative);
  f.table("floors", o.floors);
  f.table("depth_noise", o.depth_noise);
}

void list(FieldList& f, KeypointRegionOptions& o) {
  f("radius", o.radius, "image widths", "distance within which other keypoints count", kShare);
  f("support", o.support, "keypoints", "dynamic keypoints that must be there, itself included", from(1));
}

void list(FieldList& f, RelativeStep<float>& o) {
  f("base", o.base, "m", "step in depth between neighbouring cells of one surface: constant part",
    kNotNegative);
  f("quad", o.quad, "1/m", "growth of that with the square of the depth", kNotNegative);
}

void list(FieldList& f, PoolingOptions& o) {
  f("coupling", o.coupling, "", "weight of a neighbour on the same surface", kNotNegative);
  f("sweeps", o.sweeps, "", "over rows and columns", between(0, 100));
  f.table("step", o.step);
}

void list(FieldList& f, DepthGridOptions& o) {
  f("columns", o.columns, "cells", "cells across the image", between(8, 10000));
  f("max_half_angle", o.max_half_angle, "rad", "half the field of view of a camera that names no pinhole",
    between(0.1, 1.5));
  f("edge_base", o.edge_base, "m", "difference of depths in one cell that makes an edge: constant part",
    kNotNegative);
  f("edge_quad", o.edge_quad, "1/m", "growth of that with the square of the depth", kNotNegative);
}

void list(FieldList& f, FreeSpaceMargins<float>& o) {
  f("consistent_base", o.consistent_base, "m",
    "difference of depths up to which they are one surface: constant part", kNotNegative);
  f("consistent_quad", o.consistent_quad, "1/m", "growth of that with the square of the depth", kNotNegative);
  f("violation_base", o.violation_base, "m",
    "distance by which something stands in space that was seen to be free: constant part", kNotNegative);
  f("violation_quad", o.violation_quad, "1/m", "growth of that with the square of the depth", kNotNegative);
}

void list(FieldList& f, FreeSpaceOptions& o) {
  f("lags", std::span<double>(o.lags), "s",
    "ages of the views that the present one is compared with, ascending", between(1e-4, 10));
  f("old_lag", o.old_lag, "s", "time after which a mover has left its own volume", between(1e-4, 60));
  f("rest_lag", o.rest_lag, "s", "time after which what has stayed is at rest, even if it moved before",
    between(1e-4, 60));
  f("follow_lag", o.follow_lag, "s", "age up to which views, besides the last one, pass their beliefs on",
    between(0, 60));
  f("memory", o.memory, "s", "time in which a belief without new evidence falls to 1/e", between(0.001, 60));
  f("prior", o.prior, "", "log-odds that a surface moves of which nothing is known", between(-10, 0));
  f("unseen", o.unseen, "", "confidence in that", between(0.00001, 1));
  f("violated", o.violated, "", "log-likelihood ratio of a surface where the space was free, per view",
    kNotNegative);
  f("supported", o.supported, "", "and against motion, of one that was there already, per view",
    kNotNegative);
  f("bound", o.bound, "", "of what all views together say", kNotNegative);
  f("min_depth", o.min_depth, "m", "distance from an earlier camera within which nothing is judged",
    kNotNegative);
  f("max_depth", o.max_depth, "m", "depth beyond which nothing is judged", kPositive);
  f("depth_time_uncertainty", o.depth_time_uncertainty, "s",
    "difference that there may be between the time of a depth image and that of its pose", between(0, 1));
  f("max_shift", o.max_shift, "cells", "greatest shift of a depth image beside its pose", between(0, 100));
  f.table("margins", o.margins);
}

void list(FieldList& f, MaskGrowingOptions& o) {
  f("min_seeds", o.min_seeds, "cells", "size below which a group of seeds is noise", kCount);
  f("min_region", o.min_region, "cells", "size below which a region is dropped", kCount);
  f("max_hole", o.max_hole, "cells", "size up to which a hole in a mask is filled", kCount);
  f("max_fraction", o.max_fraction, "", "share of the valid depth above which a region has leaked", kShare);
  f.table("step", o.step);
}

void list(FieldList& f, UnmeasuredOptions& o) {
  f("reach", o.reach, "", "how far a mask may enter what has no depth, as a share of the width", kShare);
  f("contrast", o.contrast, "grey levels", "edge that costs as much as the whole reach", kPositive);
}

void list(FieldList& f, MovedOutlineOptions& o) {
  f("foreground", o.foreground, "",
    "share of a surface's outline beside which something farther is seen from which on it is in the "
    "foreground",
    kShare);
  f("least", o.least, "cells", "least outline of such a surface", kCount);
  f("surface", o.surface, "cells", "smallest surface", kCount);
  f("gap", o.gap, "cells", "without depth between a surface and what lies behind it, at most", kCells);
  f("beside", o.beside, "cells", "beside an outline in which what has gone or come is looked for", kCells);
}

void list(FieldList& f, SupportPlaneOptions& o) {
  f("area", o.area, "m^2", "of the smallest plane that is a surface apart from the objects on it", kPositive);
  f("least", o.least, "cells", "size of the smallest surface that is split", from(3));
  f("planes", o.planes, "", "planes of a surface at most; 0: none is split off", between(0, 100));
  f("hypotheses", o.hypotheses, "", "planes that are tried", between(0, 10000));
  f("samples", o.samples, "cells", "that judge them", from(3));
  f("base", o.base, "m",
    "distance along the ray within which a cell at depth z is on a plane: base + quad z^2", kNotNegative);
  f("quad", o.quad, "1/m", "see base", kNotNegative);
}

void list(FieldList& f, SurfaceEvidenceOptions& o) {
  f("share", o.share, "", "share by which more of a surface must have moved than of the others",
    between(0, 2));
  f("slope", o.slope, "", "log-likelihood ratio per share beyond that", kNotNegative);
  f("most", o.most, "", "greatest log-likelihood ratio for motion", kNotNegative);
  f("most_rest", o.most_rest, "", "and for rest", kNotNegative);
  f("perimeter", o.perimeter, "", "least outline of a surface of n cells, in sqrt(n) sides", kNotNegative);
  f("outline", o.outline, "cells", "least outline that is evidence", kCount);
  f("keypoints", o.keypoints, "", "least keypoints that are", kCount);
  f("keypoint_edge", o.keypoint_edge, "",
    "distance to something nearer, as a share of the image's width, within which a dynamic keypoint does not "
    "count",
    kShare);
}

void list(FieldList& f, MotionBeliefOptions& o) {
  f("most", o.most, "", "largest log-odds of motion", kPositive);
  f("min_region", o.min_region, "cells", "size below which a dynamic region is dropped", kCount);
  f("max_hole", o.max_hole, "cells", "size up to which a hole in a dynamic region is filled", kCount);
  f.table("free_space", o.free_space);
  f.table("supports", o.supports);
  f.table("outlines", o.outlines);
  f.table("surfaces", o.surfaces);
  f.table("pooling", o.pooling);
}

void list(FieldList& f, MotionSegmenterOptions<double>& o) {
  // left out: method: [tracker] method goes for all
  // left out: own_reference: the tracker's keyframes are the references
  // left out: locating: the tracker gives the pose
  // left out: pose_check: and knows it
  f.table("reference", o.reference);
  f.table("weights", o.weights);
  f.table("grid", o.grid);
  f.table("belief", o.belief);
  f.table("regions", o.regions);
  f.table("growing", o.growing);
  f.table("unmeasured", o.unmeasured);
  f("margin", o.margin, "", "by which the mask is widened, as a share of the image's width", kShare);
}

}  // namespace dynslam::runtime::config
