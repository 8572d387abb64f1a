// SPDX-License-Identifier: BSD-3-Clause
// A row of a table of inputs: what the program says of each, and the rule that holds for all.
#pragma once

#include <doctest/doctest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "dynslam/runtime/io/map_io.hpp"
#include "user_input.hpp"

namespace dynslam::test {

inline bool all_zero(const std::filesystem::path& folder) {
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    const cv::Mat image = cv::imread(file.path().string(), cv::IMREAD_UNCHANGED);
    if (cv::countNonZero(image.reshape(1)) > 0) return false;
  }
  return true;
}

/// The rule for all rows: where nothing was tracked, masked, mapped or converted, a line says so.
inline void check_not_silent(const std::string& command, const std::filesystem::path& out,
                             const ProgramResult& result) {
  CHECK_FALSE(result.out.empty());
  if (result.code != 0) {
    CHECK(mentions(result.out, "dynslam: error: "));
    return;
  }
  if (command.starts_with("convert ") && all_zero(out / "depth"))
    CHECK(mentions(result.out, "depth images have no depth at all"));
  if (command.starts_with("masks ") && all_zero(out))
    CHECK(mentions(result.out, "none of the masks marks anything dynamic"));
  if (!command.starts_with("run ")) return;
  const auto summary = nlohmann::json::parse(text_of(out / "summary.json"));
  CHECK(summary["tracked"].get<int>() > 0);
  const std::string mode = summary["configuration"]["dynamics"];
  if (mode == "semantic" || mode == "both")
    CHECK(mentions(result.out, "no a-priori mask marks anything") ==
          (summary["masks"]["frames_marked"].get<int>() == 0));
  if (std::filesystem::exists(out / "map.sot"))
    CHECK(mentions(result.out, "no voxel is occupied") ==
          !runtime::has_occupied(*runtime::load_map(out / "map.sot")));
}

/// @param cases  folder of the reported inputs, CASES in the commands
inline void check_row(const UserInput& row, const std::filesystem::path& cases = {}) {
  CAPTURE(row.name);
  const TemporaryFolder folder;
  const std::filesystem::path sequence = folder.path / "seq", out = folder.path / "out";
  copy_sequence(sequence);
  if (row.change) row.change(sequence);
  const std::string command = filled(
      filled(filled(row.command, "SEQ", sequence.string()), "OUT", out.string()), "CASES", cases.string());
  const ProgramResult result = call(command);
  CAPTURE(command);
  CAPTURE(result.out);
  CHECK(result.code == row.code);
  for (const std::string& text : row.says) {
    CAPTURE(text);
    CHECK(mentions(result.out, text));
  }
  for (const std::string& text : row.never_says) {
    CAPTURE(text);
    CHECK_FALSE(mentions(result.out, text));
  }
  check_not_silent(command, out, result);
}

}  // namespace dynslam::test
