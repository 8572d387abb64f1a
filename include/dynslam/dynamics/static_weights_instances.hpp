// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

// static_weights() as the library dynslam::core_instances has it: float and double, Pinhole and AnyCamera,
// images as ImageView. Linking that library defines DYNSLAM_CORE_INSTANCES, and a program's own files leave
// these out; without it this header is empty.
#ifdef DYNSLAM_CORE_INSTANCES
#include <cstdint>
#include <span>

#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image_view.hpp"

#ifdef DYNSLAM_INSTANCE_SCALAR  // a source of the library, which has one of them
#define DYNSLAM_FOR_INSTANCES(f) f(, DYNSLAM_INSTANCE_SCALAR, DYNSLAM_INSTANCE_CAMERA)
#else
#define DYNSLAM_FOR_INSTANCES(f) \
  f(extern, float, Pinhole);     \
  f(extern, double, Pinhole);    \
  f(extern, float, AnyCamera);   \
  f(extern, double, AnyCamera)
#endif

namespace dynslam {

#define DYNSLAM_STATIC_WEIGHTS(Extern, S, Camera)                                                          \
  Extern template const StaticWeightsResult<S>& static_weights<                                            \
      Camera<S>, ImageView<const std::uint8_t>, ImageView<const std::uint8_t>, ImageView<const float>, S>( \
      const Camera<S>&, std::span<const KeypointMatch<S>>, const ImageView<const std::uint8_t>&,           \
      const ImageView<const std::uint8_t>&, const ImageView<const float>&, const SE3<S>&,                  \
      const StaticWeightsOptions<S>&, StaticWeightsWorkspace<S>&)
DYNSLAM_FOR_INSTANCES(DYNSLAM_STATIC_WEIGHTS);
#undef DYNSLAM_STATIC_WEIGHTS

}  // namespace dynslam
#endif

#include "dynslam/pop_macros.hpp"
