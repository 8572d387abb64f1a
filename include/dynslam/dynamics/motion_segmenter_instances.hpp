// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

// MotionSegmenter as the library dynslam::core_instances has it: float and double, Pinhole and AnyCamera,
// images as ImageView, masks as ImageView or Image. See static_weights_instances.hpp.
#ifdef DYNSLAM_CORE_INSTANCES
#include <cstdint>

#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/dynamics/static_weights_instances.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_view.hpp"

namespace dynslam {

#define DYNSLAM_MOTION_SEGMENTER(Extern, S, Camera)                                                   \
  Extern template class MotionSegmenter<S, Camera<S>>;                                                \
  Extern template const MotionResult<S>& MotionSegmenter<S, Camera<S>>::segment(                      \
      const ImageView<const std::uint8_t>&, const ImageView<const float>&, double, const SE3<S>&,     \
      const ImageView<const std::uint8_t>&, IgnoreStages&&);                                          \
  Extern template PoseConsensusResult<S> MotionSegmenter<S, Camera<S>>::locate(                       \
      const ImageView<const std::uint8_t>&, const ImageView<const float>&, const SE3<S>&,             \
      const ImageView<const std::uint8_t>&);                                                          \
  Extern template void MotionSegmenter<S, Camera<S>>::remember(const SE3<S>&,                         \
                                                               const ImageView<const std::uint8_t>&); \
  Extern template void MotionSegmenter<S, Camera<S>>::remember(const SE3<S>&, const Image<std::uint8_t>&)
DYNSLAM_FOR_INSTANCES(DYNSLAM_MOTION_SEGMENTER);
#undef DYNSLAM_MOTION_SEGMENTER

}  // namespace dynslam
#endif

#include "dynslam/pop_macros.hpp"
