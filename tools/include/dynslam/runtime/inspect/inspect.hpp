// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/sequence.hpp"

namespace dynslam::runtime {

/// Time stamps of a sequence's images.
struct StampReport {
  std::size_t colour_images = 0, depth_images = 0, pairs = 0;
  double duration = 0;                     ///< from the first pair to the last [s]
  double colour_rate = 0, depth_rate = 0;  ///< by the median interval [1/s]
  double delay_median = 0, delay_p95 = 0;  ///< depth time less colour time; of its absolute value [s]
  double delay_spread = 0;                 ///< median distance from the median [s]
  struct Gap {
    double t = 0, length = 0;  ///< start since the first pair, length [s]
    std::size_t missing = 0;   ///< frames
  };
  std::vector<Gap> gaps;  ///< between pairs, longer than 1.75 median intervals
};

/// How the edges of depth lie on those of colour.
struct EdgeReport {
  bool measured = false;            ///< false: too few edges
  double shift_x = 0, shift_y = 0;  ///< from the depth image's edges to the colour image's [px]
  double shift_gain = 1;            ///< agreement there over that without a shift
  int lag = 0;                      ///< whole frames by which depth comes late
  double late = 0;                  ///< frames by which depth comes late, between the whole ones
  double lag_gain = 1;              ///< agreement there over that of the pairs as they are
};

/// Ground truth against the motion of points that are followed through the images and have depth.
struct TruthReport {
  std::size_t poses = 0;
  double covered = 0;           ///< share of the pairs with a pose
  std::size_t bursts = 0;       ///< of frames with a pose at both ends
  std::size_t motions = 0;      ///< measured in them and compared
  std::size_t agreeing = 0;     ///< of them, those of about the true rotation and direction
  std::optional<double> scale;  ///< median of true over measured distance; empty: the camera hardly moved
};

/// What `dynslam info` found.
struct SequenceReport {
  Sequence sequence;  ///< as read
  std::optional<CameraConfig> camera;
  std::string camera_source;
  StampReport stamps;
  cv::Size colour_size, depth_size;         ///< of the first images
  std::size_t sampled = 0;                  ///< frames that were decoded
  double depth_valid = 0;                   ///< share of pixels
  std::array<double, 5> depth_quantiles{};  ///< 5, 25, 50, 75, 95 % [m]
  EdgeReport edges;
  TruthReport truth;
  std::vector<std::string> warnings;  ///< one line each, in order of weight
  bool undecodable = false;      ///< none of the frames looked at can be decoded
  std::string command;           ///< to run the sequence; empty where it cannot be
};

/// Options of inspect_sequence().
struct InspectOptions {
  SequenceOptions reading;
  std::string camera;      ///< empty: from the sequence
  std::size_t bursts = 4;  ///< of consecutive frames that are looked at, spread over the sequence
  std::size_t burst = 12;  ///< frames in each
};

/// Looks at a sequence: what it is, and warnings, each measured on its files.
/// @throws InputError, UsageError  as load_sequence()
[[nodiscard]] SequenceReport inspect_sequence(const std::filesystem::path& root,
                                              const InspectOptions& options = {});
/// Warnings of the camera of a sequence, one line each: against the one that the name of the folder or
/// the bag speaks of, its centre, its focal lengths.
[[nodiscard]] std::vector<std::string> camera_doubts(const Sequence& sequence, const CameraConfig& camera);
/// Warnings of the times of a sequence, one line each: stamps that are no seconds, a ground truth of
/// other times, with what would make them fit.
[[nodiscard]] std::vector<std::string> time_doubts(const Sequence& sequence);
/// As `info --json` prints it.
[[nodiscard]] nlohmann::json to_json(const SequenceReport& report);
/// As `info` prints it.
[[nodiscard]] std::string to_text(const SequenceReport& report);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
