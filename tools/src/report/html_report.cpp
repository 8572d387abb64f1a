// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/report/html_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "report/payload.hpp"
#include "report/pictures.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;
using reporting::json;

constexpr std::string_view kPlace = "@DYNSLAM_REPORT@";  // in the page, where the runs go
constexpr std::size_t kVoxels = 150'000, kLeastVoxels = 20'000;

/// JSON that may stand in a <script>: nothing in it ends that.
std::string script_text(const json& payload) {
  // Names of files are bytes; JSON has text alone.
  const std::string text = payload.dump(-1, ' ', false, json::error_handler_t::replace);
  std::string result;
  result.reserve(text.size());
  for (const char c : text) {
    switch (c) {  // none of them stands outside a string
      case '<':
        result += "\\u003c";
        break;
      case '>':
        result += "\\u003e";
        break;
      case '&':
        result += "\\u0026";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::vector<RunFolder> read_runs(const ReportOptions& options) {
  std::vector<RunFolder> runs;
  for (const fs::path& given : options.runs) {
    for (const fs::path& folder : folders_of_runs(given)) runs.push_back(read_run_folder(folder));
  }
  if (runs.empty()) throw UsageError("a report is about the folder of one run at least");
  for (std::size_t i = 0; i < runs.size(); ++i) {  // folders of one name in several places
    std::size_t same = 0;
    for (std::size_t k = 0; k < i; ++k) same += runs[k].name == runs[i].name ? 1 : 0;
    if (same > 0) runs[i].name += fmt::format(" ({})", same + 1);
  }
  return runs;
}

json summary_of(const RunFolder& run) {
  constexpr std::size_t kProblems = 50;
  json summary;
  for (const char* key : {"frames", "tracked", "lost", "broken", "fps", "peak_rss_mb", "interrupted",
                          "masks_rejected", "live", "separate_maps"}) {
    if (run.summary.contains(key)) summary[key] = run.summary[key];
  }
  summary["problems"] = json::array();
  for (const auto& problem : run.summary["problems"]) {
    if (summary["problems"].size() < kProblems) summary["problems"].push_back(problem);
  }
  summary["problem_count"] = run.summary["problems"].size();
  return summary;
}

json run_payload(const reporting::Source& source, const RunFolder& run, std::vector<std::string>& thinned) {
  json j = reporting::trajectory_payload(source, run, thinned);
  j["name"] = run.name;
  j["mode"] = std::string(to_string(run.options.dynamics));
  j["method"] = run.summary["configuration"]["method"];
  j["tau"] = run.options.tracker.geometry.weights.tau;
  j["summary"] = summary_of(run);
  j["times"] = reporting::times_payload(source, run, thinned);
  j["graph"] = reporting::graph_payload(source, run, j["align"], thinned);
  j["map"] = reporting::map_payload(run, std::max(kLeastVoxels, kVoxels / source.runs.size()), thinned);
  j["mask_figures"] = reporting::mask_payload(source, run);
  j["config"] = run.config;
  j["versions"] = run.summary["versions"];
  return j;
}

/// Everything but the pictures.
json payload_of(const reporting::Source& source, std::vector<std::string>& thinned) {
  const fs::path root =
      source.sequence.root.has_filename() ? source.sequence.root : source.sequence.root.parent_path();
  json j{{"version", DYNSLAM_VERSION},
         {"sequence",
          {{"name", root.filename().string()},
           {"format", source.sequence.format},
           {"frames", source.sequence.frames.size()},
           {"seconds", reporting::number(source.t1 - source.t0, 3)},
           {"camera", source.camera.name},
           {"width", source.camera.width},
           {"height", source.camera.height}}},
         {"truth", reporting::truth_payload(source)},
         {"view", reporting::view_payload(source)},
         {"runs", json::array()}};
  for (const RunFolder& run : source.runs) j["runs"].push_back(run_payload(source, run, thinned));
  return j;
}

std::vector<std::string> missing_of(const reporting::Source& source) {
  std::vector<std::string> missing;
  for (const RunFolder& run : source.runs) {
    if (run.evidence) continue;
    std::string lacks = "the edges of its graph";
    if (run.options.dynamics != DynamicsMode::none) {
      lacks += " and the keypoints of its frames";
      if (!fs::exists(run.folder / "masks")) lacks = "masks, " + lacks;
    }
    missing.push_back(
        fmt::format("{} was run without --report, the page lacks {}: run it again with --report",
                    run.folder.string(), lacks));
  }
  return missing;
}

}  // namespace

fs::path report_page() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  fs::path page = program.parent_path().parent_path() / "share" / "dynslam" / "report" / "report.html";
  if (error || !fs::is_regular_file(page, error))
    throw UsageError(
        "this program was built without the page of reports: npm was missing or reached no registry, or "
        "DYNSLAM_REPORT was off (docs/report.md)");
  return page;
}

ReportResult write_report(const ReportOptions& options) {
  const fs::path page_file = options.page.empty() ? report_page() : options.page;
  const std::string page = read_file(page_file);
  const std::size_t place = page.find(kPlace);
  if (place == std::string::npos || page.find(kPlace, place + 1) != std::string::npos)
    throw InputError(page_file.string(), 0,
                     fmt::format("is no page of reports: {} stands there not once", kPlace));
  const reporting::Source source = reporting::open_source(read_runs(options), options.sequence);
  std::vector<std::string> thinned;
  json payload = payload_of(source, thinned);
  const reporting::Pictures pictures(source);
  const std::size_t fixed = page.size() + script_text(payload).size();

  ReportResult result;
  result.file = options.out.empty() ? options.runs.front() / "report.html" : options.out;
  result.missing = missing_of(source);
  for (const reporting::PictureLevel& level : reporting::picture_levels(source.sequence.frames.size())) {
    if (fixed + pictures.estimate(level) > options.max_bytes) continue;
    result.thinned = thinned;
    pictures.put(level, payload, result.thinned);
    payload["thinned"] = result.thinned;
    std::string text = page;
    text.replace(place, kPlace.size(), script_text(payload));
    result.bytes = text.size();
    if (result.bytes > options.max_bytes) continue;  // the few frames of the estimate were not typical
    write_file(result.file, text);
    return result;
  }
  throw InputError(
      result.file.string(), 0,
      fmt::format("would have {} bytes without any picture, and {} are allowed", fixed, options.max_bytes));
}

}  // namespace dynslam::runtime
