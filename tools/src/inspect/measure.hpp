// SPDX-License-Identifier: BSD-3-Clause
// What `dynslam info` measures. Internal to the runtime.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynslam/runtime/inspect/inspect.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"

namespace dynslam::runtime::inspect {

/// Consecutive frames; those that cannot be decoded are left out.
using Burst = std::vector<RgbdFrame>;

[[nodiscard]] StampReport measure_stamps(const Sequence& sequence);

/// Width and height by an image's head, without decoding it; nullopt where it cannot be read.
[[nodiscard]] std::optional<cv::Size> image_size(const FrameRecord& frame, ImageSource::Kind kind);

/// Warnings of the files: missing ones, sizes, pictures that repeat.
[[nodiscard]] std::vector<std::string> check_files(const Sequence& sequence, const CameraConfig* camera);

/// Where depth edges meet colour edges, by shift (up to a twentieth of the width) and by frames (up to 5).
[[nodiscard]] EdgeReport measure_edges(std::span<const Burst> bursts);

[[nodiscard]] TruthReport measure_truth(const Sequence& sequence, const CameraConfig& camera,
                                        std::span<const Burst> bursts);

/// Share of these times [s] at which a ground truth has a pose.
[[nodiscard]] double covered_share(const std::vector<StampedPose<double>>& truth,
                                   std::span<const double> times);

/// The median time between two [s]; 0 for fewer.
[[nodiscard]] double median_interval(std::span<const double> times);

/// The q-quantile; 0 for no values.
[[nodiscard]] double quantile(std::vector<double> values, double q);

}  // namespace dynslam::runtime::inspect
