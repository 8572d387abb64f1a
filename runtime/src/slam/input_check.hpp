// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/masks.hpp"

namespace dynslam::runtime {

/// Refuses what the tracker would read out of bounds or place in the wrong order: images of another size or
/// type than the camera's, masks that do not fit them, times that are not numbers or do not increase.
/// @param last_t  time of the frame before [s]; empty: there is none
/// @throws InputError with the frame, what it has and what was expected
void check_input(const RgbdFrame& input, const std::optional<Masks>& prior, const CameraConfig& camera,
                 const std::optional<double>& last_t);
/// The part of this that is about times.
void check_times(const RgbdFrame& input, const std::optional<double>& last_t);

}  // namespace dynslam::runtime
