// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dynslam/geometry/so3.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "report/run_folder.hpp"

/// What a report holds, part by part, as the page's scripts read it (tools/report/src/). Times are seconds
/// since the first frame, lengths metres, angles degrees; numbers are rounded to what a page can show.
namespace dynslam::runtime::reporting {

using nlohmann::json;

struct Source {
  Sequence sequence;
  CameraConfig camera;
  std::vector<RunFolder> runs;
  double t0 = 0, t1 = 0;  ///< first and last frame [s]
  SO3<double> R_first;    ///< the camera at the beginning, which angles are measured from
};

/// Opens the sequence of the runs. @throws InputError
[[nodiscard]] Source open_source(std::vector<RunFolder> runs, const std::filesystem::path& sequence);

/// A number with so many decimals; null where it is not finite.
[[nodiscard]] json number(double value, int decimals);

/// Every how many of `count` things are kept so that at most `most` are.
[[nodiscard]] std::size_t stride_for(std::size_t count, std::size_t most);

/// {"t", "p": x y z of each, "a": pan tilt roll of each}; null without ground truth.
[[nodiscard]] json truth_payload(const Source& source);
/// {"up": the mean direction that cameras have above them, "first": the camera that angles are measured from,
/// 3x3 by rows}.
[[nodiscard]] json view_payload(const Source& source);
/// {"trajectory": like the truth's, moved beside it, "align": 4x4 by columns, "aligned", "why", "error":
/// {"t", "e", "r"}, "table": to_json(TrajectoryReport) or null}
[[nodiscard]] json trajectory_payload(const Source& source, const RunFolder& run,
                                      std::vector<std::string>& thinned);

/// {"columns", "t", "cells": one list per column, "stages": {name: [p50, p95]}}
[[nodiscard]] json times_payload(const Source& source, const RunFolder& run,
                                 std::vector<std::string>& thinned);

/// {"nodes": [[id, t, x, y, z]], "edges": [[i, j, points]], "loops": likewise, "complete"}; ends are
/// positions in `nodes`, which lie beside the truth. @param align  see trajectory_payload()
[[nodiscard]] json graph_payload(const Source& source, const RunFolder& run, const json& align,
                                 std::vector<std::string>& thinned);

/// {"edge", "low": corner, "count", "classes": [{"label", "name", "colour", "count"}], "voxels": base64, 11
/// bytes each: corner as three 16-bit numbers, binary logarithm of the size, label, red, green, blue}; null
/// without a map.
/// @param most  voxels; with more the octree is drawn at a lower depth
[[nodiscard]] json map_payload(const RunFolder& run, std::size_t most, std::vector<std::string>& thinned);

/// IoU, recall and precision of the fused masks, where run and sequence have them; else null. @throws
/// InputError
[[nodiscard]] json mask_payload(const Source& source, const RunFolder& run);

}  // namespace dynslam::runtime::reporting
