// SPDX-License-Identifier: BSD-3-Clause
#include "slam/frame_locator.hpp"

#include "slam/prior_mask.hpp"

namespace dynslam::runtime {
namespace {

/// Where only so few inliers make a start, a mask is arbitrated by as few.
MaskArbitrationOptions<double> arbitration_of_starts(const TrackerOptions& options) {
  MaskArbitrationOptions<double> result = options.arbitration;
  result.min_inliers = options.search.weak_inliers;
  return result;
}

PoseResult<double> pose_of(const PoseEstimate<double>& estimate) {
  PoseResult<double> pose;
  pose.T_c_w = estimate.frame.T_c_w;
  pose.covariance = estimate.covariance;
  pose.inliers = estimate.inliers;
  pose.status = PoseStatus::converged;
  return pose;
}

/// Whether a pose, of what a mask leaves, agrees with a far more certain one of all, or is `times` as far
/// from the predicted pose.
bool leads_farther(const PoseEstimate<double>& rest, const PoseEstimate<double>& all, double times,
                   const SE3<double>& T_predicted_w, const MaskArbitrationOptions<double>& options) {
  if (arbitrate_mask(pose_of(rest), pose_of(all), options) != MaskVerdict::kept) return true;
  const auto off = [&](const PoseEstimate<double>& found) {
    return (found.frame.T_c_w * T_predicted_w.inverse()).log().norm();
  };
  return off(rest) > times * off(all);
}

}  // namespace

FrameLocator::FrameLocator(const TrackerOptions& options, const AnyCamera<double>& camera)
    : options_(options.search),
      arbitration_(arbitration_of_starts(options)),
      camera_(camera),
      search_(options.search, options.seed) {}

bool FrameLocator::locate(LocalMap& map, const LastFrame<double>& last, LastImages& images,
                          PoseSolver& solver, FrameState& now) {
  return search_.locate(
      now.evidence(map, last), solver,
      [&](const SE3<double>& predicted) { return images.align(now.image->pyramid, camera_, predicted); },
      [&] { now.done(Stage::initial_pose); }, now.pose);
}

bool FrameLocator::locate_by_alignment(LocalMap& map, const LastFrame<double>& last, LastImages& images,
                                       PoseSolver& solver, FrameState& now) {
  return search_.locate_by_alignment(
      now.evidence(map, last), solver,
      [&](const SE3<double>& predicted) { return images.align(now.image->pyramid, camera_, predicted); },
      options_.weak_inliers, now.pose);
}

bool FrameLocator::locate_with_prior(LocalMap& map, const LastFrame<double>& last, LastImages& images,
                                     PoseSolver& solver, FrameState& now) {
  const bool certain = locate(map, last, images, solver, now);
  if (now.semantic.empty() || (certain && !now.mask_covers_view)) return certain;
  bool by_rest = certain;
  if (!certain) {
    solver.restart(now.evidence(map, last), now.pose);
    by_rest = locate_by_alignment(map, last, images, solver, now);
  }
  const PoseSolver::Attempt rest = solver.save(now.pose);
  const cv::Mat semantic = now.semantic;
  const MaskVerdict before = now.result.mask_rejected;
  PriorMask::reject(now.mask_covers_view ? MaskVerdict::covers_view : MaskVerdict::starved, now);
  solver.restart(now.evidence(map, last), now.pose);
  const bool by_all = locate(map, last, images, solver, now);
  if (!by_rest || (by_all && leads_farther(rest.estimate, now.pose, certain ? 2 : 1, last.predicted_pose(),
                                           arbitration_)))
    return by_all;
  solver.restore(now.evidence(map, last), rest, now.pose);
  now.semantic = semantic;
  now.result.mask_rejected = before;
  return true;
}

}  // namespace dynslam::runtime
