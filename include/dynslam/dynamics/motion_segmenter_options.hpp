// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>

#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/free_space_history.hpp"
#include "dynslam/dynamics/locate_reference.hpp"
#include "dynslam/dynamics/method.hpp"
#include "dynslam/dynamics/moved_outlines.hpp"
#include "dynslam/dynamics/reference_keyframe.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/features/corners.hpp"
#include "dynslam/segment/mask_completion.hpp"
#include "dynslam/segment/mask_delay.hpp"
#include "dynslam/segment/mask_growing.hpp"

namespace dynslam {

/// Which dynamic keypoints start the growing. One may err; many close together that all move do not, and
/// outweigh the depth check, which is blind to motion inside a surface.
struct KeypointSeedOptions {
  double radius = 1 / 16.0;  ///< how near others count, as a share of the image's width
  int support = 8;  ///< dynamic ones that must be there, itself included, and not fewer than static ones
  /// The depth check takes what slides in its own plane for verified. Where `body` dynamic keypoints or more
  /// stand on a surface and a share `agreeing` of them has one motion, each speaks for what lies within
  /// `territory` of it over that surface, as a share of the image's width. An addition to the paper; 0:
  /// never.
  double territory = 0.05;
  /// How near to something nearer, as a share of the image's width, a keypoint's patch may show the other's
  /// rim, which moves then, so that it does not speak for what is here.
  double rim = 1 / 80.0;
  int body = 15;
  double agreeing = 0.8;
  /// Share of a connected surface from which on all of it is the body that stands on it, where moving
  /// keypoints are at least `outvoting` times as many as those at rest; above 1: never.
  double body_share = 0.3;
  double outvoting = 10;
};

/// When the segmenter takes a new reference keyframe by itself.
struct OwnReferenceOptions {
  bool use = true;               ///< false: the host gives them (set_reference)
  double max_age = 0.7;          ///< views must differ, and still show the same things [s]
  int corners_per_keypoint = 4;  ///< that are looked at: many lie on edges of the depth and cannot serve
  CornerOptions corners;         ///< on the pyramid's level 1, where noise is halved
};

/// Options of MotionSegmenter.
template <std::floating_point S>
struct MotionSegmenterOptions {
  Method method = Method::full;
  ReferenceOptions reference;
  OwnReferenceOptions own_reference;
  LocateOptions<S> locating;
  StaticWeightsOptions<S> weights;
  KeypointSeedOptions keypoint_seeds;
  DepthGridOptions grid;
  FreeSpaceOptions free_space;
  MovedOutlineOptions outlines;  ///< an addition to the paper
  MaskGrowingOptions growing;
  UnmeasuredOptions unmeasured;
  MaskDelayOptions delay;
};

}  // namespace dynslam
