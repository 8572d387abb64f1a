// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "dynslam/track/frame_revision.hpp"
#include "dynslam/track/keyframe_inserter.hpp"
#include "dynslam/track/last_frame.hpp"
#include "dynslam/track/relocaliser.hpp"
#include "slam/background_check.hpp"
#include "slam/bundle_schedule.hpp"
#include "slam/frame_locator.hpp"
#include "slam/last_images.hpp"
#include "slam/motion_detection.hpp"
#include "slam/prior_mask.hpp"
#include "slam/static_pose.hpp"

namespace dynslam::runtime {

/// What belongs to nobody else: the map, the last frame, and the parts that work on them.
struct Tracker::Parts {
  using Camera = AnyCamera<double>;

  /// @throws what checked() says of the camera
  Parts(const CameraConfig& config, const TrackerOptions& given);

  const CameraConfig camera;
  const TrackerOptions options;
  FeatureExtractor extractor;
  LocalMap map;
  PlaceIndex places;
  LastFrame<double> last;
  LastImages last_images;
  PriorMask prior_mask;
  PoseSolver solver;
  FrameLocator locator;
  BackgroundCheck background;
  Relocaliser<Camera> relocaliser;
  FrameRevision<Camera> revision;
  std::optional<MotionDetection> motion;  // where the mode asks the geometry
  StaticPose static_pose;
  KeyframeInserter<Camera> inserter;
  BundleSchedule bundles;

  struct Sequence {
    std::size_t frames = 0;        // tracked or lost so far
    std::optional<double> last_t;  // of the frame before [s]
    std::size_t map_begin = 0;     // index of the frame that began the map
    bool began_at_rest = false;    // the last frame did, by a camera whose motion nobody knew
  } sequence;
};

}  // namespace dynslam::runtime
