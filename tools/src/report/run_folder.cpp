// SPDX-License-Identifier: BSD-3-Clause
#include "report/run_folder.hpp"

#include <fmt/format.h>

#include <limits>
#include <sstream>
#include <string_view>

#include "dynslam/runtime/config/options_file.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

/// A file that every finished run has.
fs::path present(const fs::path& folder, const char* name) {
  if (!fs::exists(folder / name))
    throw InputError((folder / name).string(), 0,
                     "is missing: the folder holds no finished run of this version");
  return folder / name;
}

nlohmann::json read_summary(const fs::path& file) {
  nlohmann::json j;
  try {
    j = nlohmann::json::parse(read_text(file));
    for (const char* number : {"frames", "tracked", "lost", "broken"}) (void)j.at(number).get<std::size_t>();
    (void)j.at("fps").get<double>();
    (void)j.at("configuration").at("sequence").get<std::string>();
    (void)j.at("configuration").at("method").get<std::string>();
    for (const auto& problem : j.at("problems")) (void)problem.get<std::string>();
    for (const auto& [key, value] : j.at("versions").items()) (void)value.get<std::string>();
  } catch (const nlohmann::json::parse_error&) {
    throw InputError(file.string(), 0, "is damaged: no JSON");
  } catch (const nlohmann::json::exception& error) {
    throw InputError(file.string(), 0, std::string("is no summary of a run: ") + error.what());
  }
  return j;
}

/// Words between commas, empty ones, too.
std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (std::size_t begin = 0;;) {
    const std::size_t end = line.find(',', begin);
    cells.push_back(trim(line.substr(begin, end - begin)));
    if (end == std::string_view::npos) return cells;
    begin = end + 1;
  }
}

void read_options(RunFolder& run, const fs::path& file) {
  std::optional<DynamicsMode> dynamics;
  ConfigFields fields = config_fields(run.options, dynamics);
  std::istringstream in(run.config);
  (void)read_config(in, file.string(), fields);  // a run of an earlier version has what is no more
  if (!dynamics) throw InputError(file.string(), 0, "does not say which masks the run used (dynamics)");
  run.options.dynamics = *dynamics;
  run.options.sequence = run.evidence ? run.evidence->sequence
                                      : fs::path(run.summary["configuration"]["sequence"].get<std::string>());
}

}  // namespace

RunTable parse_times(std::istream& in, const std::string& name) {
  LineReader lines(in);
  RunTable table;
  while (lines.next()) {
    const auto cells = cells_of(lines.line());
    if (table.columns.empty()) {
      table.columns.assign(cells.begin() + 1, cells.end());
      if (cells.front() != "timestamp" || table.columns.empty())
        throw InputError(name, lines.number(), "expected the names of the columns, timestamp first");
      continue;
    }
    if (cells.size() != table.columns.size() + 1)
      throw InputError(name, lines.number(),
                       fmt::format("{} columns instead of {}", cells.size(), table.columns.size() + 1));
    std::vector<double>& row = table.rows.emplace_back();
    table.stamps.emplace_back(cells.front());
    for (std::size_t i = 1; i < cells.size(); ++i) {
      const auto number = parse_number(cells[i]);
      if (!number && !cells[i].empty())
        throw InputError(name, lines.number(), fmt::format("'{}' is no number", cells[i]));
      row.push_back(number.value_or(std::numeric_limits<double>::quiet_NaN()));
    }
  }
  if (table.columns.empty()) throw InputError(name, 0, "is empty");
  return table;
}

bool RunFolder::has_map() const {
  return fs::exists(map_file_in(folder));
}

RunFolder read_run_folder(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string(), 0, "is no folder of a run");
  RunFolder run;
  run.folder = folder;
  const fs::path full = fs::weakly_canonical(fs::absolute(folder));
  run.name = (full.has_filename() ? full : full.parent_path()).filename().string();
  run.summary = read_summary(present(folder, "summary.json"));
  const fs::path config = present(folder, "config.toml");
  run.config = read_text(config);
  run.trajectory = read_trajectory(present(folder, "trajectory.txt"));
  run.keyframes = read_trajectory(present(folder, "keyframes.txt"));
  const fs::path times = present(folder, "timings.csv");
  std::istringstream in(read_text(times));
  run.times = parse_times(in, times.string());
  if (fs::exists(folder / "report.jsonl")) run.evidence = read_evidence(folder / "report.jsonl");
  read_options(run, config);
  return run;
}

std::vector<fs::path> folders_of_runs(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string(), 0, "is no folder of a run");
  if (fs::exists(folder / "summary.json") || !fs::exists(folder / "ablation.json")) return {folder};
  std::vector<fs::path> modes;
  for (const auto mode :
       {DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both}) {
    const fs::path one = folder / std::string(to_string(mode));
    if (fs::exists(one / "summary.json")) modes.push_back(one);
  }
  if (modes.empty()) throw InputError(folder.string(), 0, "is an ablation's, with none of its runs in it");
  return modes;
}

}  // namespace dynslam::runtime
