// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/optim/readout_measurement.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/sequence.hpp"

namespace dynslam::runtime {

/// A run over a sequence as if its rows took a time to be read.
struct ReadoutTrial {
  double assumed = 0;     ///< [s]
  double correction = 0;  ///< ReadoutMeasurement::correction() [s]
  double sigma = 0;       ///< its standard deviation by scatter alone [s]
  std::size_t tracked = 0;
  std::size_t measured = 0;  ///< frames that said something of their rows
};

/// What measure_readout() found.
struct ReadoutReport {
  std::vector<ReadoutTrial> trials;
  std::size_t frames = 0;         ///< in each
  std::optional<double> readout;  ///< CameraConfig::readout_time that needs no correction [s]
  double half_width = 0;          ///< of its 95 % interval [s]
  std::string why_not;            ///< one line where there is none
};

/// Measures how long a camera takes to read the rows of its colour images, without ground truth: the sequence
/// is tracked with assumed times, and the time at which rows need no correction lies between two of them
/// (readout_between()). The scene should stand still while the camera turns quickly, up and down as well as
/// to the sides. An interval wider than a quarter of the time between two frames either way is no result.
/// @param camera    its readout_time is not used
/// @param progress  called after each run
[[nodiscard]] ReadoutReport measure_readout(const Sequence& sequence, const CameraConfig& camera,
                                            const std::function<void(const ReadoutTrial&)>& progress = {});

/// What measure_readout() says against a camera whose `readout_time` is 0, in a line with the key that mends
/// it; nullopt where the rows may all be of one time, or nothing can be measured.
[[nodiscard]] std::optional<std::string> readout_doubt(const Sequence& sequence, const CameraConfig& camera);
/// The same after a run, which itself says whether there is anything to be measured; then the frames that say
/// most are tracked anew, 90 at most. A line, or none.
/// @param run  Slam::readout() of the run with this camera
[[nodiscard]] std::vector<std::string> readout_doubts(const ReadoutMeasurement<double>& run,
                                                      const Sequence& sequence, const CameraConfig& camera);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
