// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/runtime/run/run_sequence.hpp"

namespace dynslam::runtime {

/// Of the map that tracking goes by.
struct MapSize {
  int keyframes = 0, points = 0;
};

/// Time of each stage per frame, in the order of kStageNames, with the wall time of the whole frame, and what
/// the run takes up by then.
struct RunTimings {
  struct Row {
    std::string stamp;
    StageTimes times;
    double network_ms, keeper_ms;  ///< of the segmentation, on its own thread unless that is off
    double frame_ms;  ///< everything the main loop did for the frame, waiting for the reader included
    double rss_mb;
    MapSize map;
    /// Of a live run: from the frame's coming to its result; age of its masks [s], nullopt: it had none.
    std::optional<double> latency_ms{}, mask_age{};
  };
  std::vector<Row> rows;

  /// Writes timings.csv. @throws InputError
  void write(const std::filesystem::path& path) const;
  [[nodiscard]] std::map<std::string, StageStatistics> statistics() const;
};

}  // namespace dynslam::runtime
