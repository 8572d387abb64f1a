// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/report.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "dynslam/runtime/evaluation/ablate.hpp"

using namespace dynslam::runtime;

namespace {

AblationRow row(DynamicsMode mode, double rmse) {
  AblationRow r;
  r.mode = mode;
  r.run.frames = 200;
  r.run.tracked = 150;
  r.run.lost = 49;
  r.run.broken = 1;
  TrajectoryReport report;
  report.ate.translation = {rmse, rmse / 2, rmse / 4, rmse / 8, 0, 1};
  report.rpe.translation = {2 * rmse, rmse, rmse, rmse, 0, 1};
  report.rpe.rotation_deg = {0, rmse, rmse, rmse, 0, 1};  // a baseline of 0 has no improvement
  r.trajectory = report;
  return r;
}

Ablation ablation() {
  Ablation a;
  a.sequence = "office";
  a.rows = {row(DynamicsMode::none, 0.5), row(DynamicsMode::both, 0.02)};
  return a;
}

/// The line of a text that begins with `start`, the first after `title`.
std::string line(const std::string& text, const std::string& title, const std::string& start) {
  std::istringstream in(text.substr(text.find(title)));
  for (std::string l; std::getline(in, l);) {
    if (l.rfind(start, 0) == 0) return l;
  }
  return {};
}

}  // namespace

TEST_CASE("cells: decimals, unit, no number, no minus zero") {
  CHECK(cell(1.23456, 2) == "1.23");
  CHECK(cell(94.5, 1, " %") == "94.5 %");
  CHECK(cell(std::numeric_limits<double>::infinity(), 2, " %") == "-");
  CHECK(cell(std::numeric_limits<double>::quiet_NaN(), 2) == "-");
  CHECK(cell(-0.00001, 2) == "0.00");
  CHECK(cell(-0.6, 0) == "-1");
}

TEST_CASE("what stands in a cell is text to Markdown, whatever is in it") {
  const Table table{"t", {"a"}, {{"<img onerror=x>"}, {"a|b"}, {"line\nbreak"}, {"\x1b[31m"}}};
  const std::string text = to_markdown(table);
  CHECK(text.find("&lt;img onerror=x&gt;") != std::string::npos);
  CHECK(text.find("a\\|b") != std::string::npos);
  CHECK(text.find("line\\x0abreak") == std::string::npos);  // the backslash is escaped, too
  CHECK(text.find("line\\\\x0abreak") != std::string::npos);
  CHECK(text.find('\x1b') == std::string::npos);
  CHECK(std::count(text.begin(), text.end(), '\n') == 8);
}

TEST_CASE("a text table aligns its columns, whatever the cells' lengths") {
  const std::string text =
      to_text(Table{"title", {"mode", "a", "long header"}, {{"x", "1.5", "2"}, {"a long name", "100.25"}}});
  CHECK(text ==
        "title\n"
        "mode              a  long header\n"
        "x               1.5            2\n"
        "a long name  100.25\n");
}

TEST_CASE("a Markdown table keeps its columns when a cell is missing or holds a bar") {
  const std::string text = to_markdown(Table{"title", {"mode", "a", "b"}, {{"x|y", "1"}}});
  CHECK(text == "### title\n\n| mode | a | b |\n|---|---:|---:|\n| x\\|y | 1 |  |\n");
}

TEST_CASE("the ablation's tables give errors, Eq (13) and coverage") {
  const std::string text = to_text(ablation());
  CHECK(line(text, "Absolute", "none").find("0.5000  0.2500  0.1250  0.0625") != std::string::npos);
  const std::string both = line(text, "Absolute", "both");
  CHECK(both.find("0.0200") != std::string::npos);
  CHECK(both.find("96.00 %") != std::string::npos);  // (0.5 - 0.02) / 0.5
  CHECK(line(text, "rotation", "both").find("inf") == std::string::npos);
  CHECK(line(text, "rotation", "both").find("nan") == std::string::npos);
  CHECK(line(text, "Coverage", "both").find("75.0 %") != std::string::npos);
  CHECK(to_markdown(ablation()).find("96.00 %") != std::string::npos);
}

TEST_CASE("a mode that cannot be compared is a row with its reason, not the end of the table") {
  Ablation a = ablation();
  a.rows.front().trajectory.reset();
  a.rows.front().not_comparable = "fewer than 3 poses";
  a.semantic_skipped = true;
  const std::string text = to_text(a);
  CHECK(line(text, "Absolute", "none").find('-') != std::string::npos);
  CHECK(line(text, "Absolute", "both").find("0.0200") != std::string::npos);
  CHECK(line(text, "Absolute", "both").find('%') == std::string::npos);  // nothing to compare with
  CHECK(text.find("none: no ATE and RPE: fewer than 3 poses") != std::string::npos);
  CHECK(text.find("semantic and both were not run") != std::string::npos);
  const auto json = to_json(a);
  CHECK(json["modes"]["none"]["not_comparable"] == "fewer than 3 poses");
  CHECK_FALSE(json["modes"]["both"].contains("ate_improvement_percent"));
}

TEST_CASE("ablation.json holds the figures of every mode") {
  const auto json = nlohmann::json::parse(to_json(ablation()).dump());
  CHECK(json["sequence"] == "office");
  const auto& both = json["modes"]["both"];
  CHECK(both["ate_m"]["rmse"].get<double>() == doctest::Approx(0.02));
  CHECK(both["ate_improvement_percent"].get<double>() == doctest::Approx(96.0));
  CHECK(both["coverage_percent"].get<double>() == doctest::Approx(75.0));
  CHECK(both["broken"] == 1);
}
