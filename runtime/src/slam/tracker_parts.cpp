// SPDX-License-Identifier: BSD-3-Clause
#include "slam/tracker_parts.hpp"

#include "io/argument_check.hpp"

namespace dynslam::runtime {
namespace {

/// The options as the parts take them: what goes for several is the same in all, and what the method lacks is
/// off.
TrackerOptions completed(TrackerOptions options) {
  if (options.additions == Additions::by_mode)
    options.additions = additions(options.method, options.dynamics);
  options.pose.depth_noise = options.points.depth_noise = options.depth_noise;
  options.points.average = !options.bundle;
  options.geometry.method = options.method;
  options.geometry.own_reference.use = false;  // keyframes serve
  options.geometry.pose_check.use = false;     // what moves was looked for before the pose is given
  if (options.method != MotionMethod::full) options.search.revise = false;
  return options;
}

PriorMaskOptions prior_options(const TrackerOptions& o) {
  return {uses_semantic(o.dynamics), o.semantic_dilation, o.arbitration.min_left};
}

KeyframeInserterOptions<double> inserter_options(const TrackerOptions& o) {
  KeyframeInserterOptions<double> result;
  result.policy = o.keyframes;
  result.coverage = o.coverage;
  result.points = o.points;
  result.loops = o.loops;
  result.close_loops = o.close_loops;
  result.depth_noise = o.depth_noise;
  result.first_points_of_all = o.method == MotionMethod::full && uses_geometry(o.dynamics);
  return result;
}

BundleScheduleOptions schedule_options(const TrackerOptions& o) {
  return {o.bundle_delay,       o.loop_bundle_window, o.loop_bundle_delay,
          o.redundant_keyframe, o.spare_keyframes,    o.depth_noise};
}

}  // namespace

Tracker::Parts::Parts(const CameraConfig& config, const TrackerOptions& given)
    : camera(checked(config)),
      options(completed(given)),
      extractor(options.features),
      last(options.search, camera.readout_time, camera.height),
      last_images(options.alignment, options.additions == Additions::all),
      prior_mask(prior_options(options)),
      solver(camera.model, camera.width, camera.height, extractor.scales(), options.matching, options.pose,
             options.search),
      locator(options, camera.model),
      background(options.search, camera.model, options.feature_margin),
      relocaliser(camera.model.pinhole(), camera.model, options.depth_noise, options.relocalisation,
                  options.search),
      revision(options.search),
      static_pose({options.arbitration, options.search.min_inliers, options.feature_margin}),
      inserter(camera.model.pinhole(), camera.model, camera.width, camera.height, inserter_options(options)),
      bundles(camera.model.pinhole(), options.local_bundle, schedule_options(options)) {
  if (uses_geometry(options.dynamics))
    motion.emplace(camera.model, MotionDetectionOptions{options.geometry, options.reference_distance,
                                                        options.feature_margin});
}

}  // namespace dynslam::runtime
