// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>

#include "dynslam/runtime/io/sequence.hpp"
#include "io/bag/recording.hpp"

namespace dynslam::runtime::formats {

/// The sequence of a recording's topics of colour and depth images, with camera and ground truth.
/// @throws InputError, UsageError
[[nodiscard]] Sequence load_recording(std::shared_ptr<const bag::Recording> file,
                                      const std::filesystem::path& root, const SequenceOptions& options);

}  // namespace dynslam::runtime::formats
