// SPDX-License-Identifier: BSD-3-Clause
// What a sweep's runs come to: tables of mean and spread.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/sweep.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

struct SweepMeasure {
  const char *title, *key;
  int decimals;
  const Statistics<double>& (*of)(const TrajectoryReport&);
};
constexpr std::array<SweepMeasure, 3> kSweepMeasures{{
    {"Absolute trajectory error [m]", "ate_m", 4,
     [](const TrajectoryReport& r) -> const Statistics<double>& { return r.ate.translation; }},
    {"Relative pose error, translation [m/s]", "rpe_trans_m", 4,
     [](const TrajectoryReport& r) -> const Statistics<double>& { return r.rpe.translation; }},
    {"Relative pose error, rotation [deg/s]", "rpe_rot_deg", 4,
     [](const TrajectoryReport& r) -> const Statistics<double>& { return r.rpe.rotation_deg; }},
}};
constexpr std::array<std::pair<const char*, double Statistics<double>::*>, 4> kSweepFigures{{
    {"RMSE", &Statistics<double>::rmse},
    {"mean", &Statistics<double>::mean},
    {"median", &Statistics<double>::median},
    {"S.D.", &Statistics<double>::std},
}};

/// Runs that differ by their seed alone.
struct Group {
  const SweepJob* job = nullptr;  ///< the first
  std::vector<const SweepRun*> runs;
};

struct Spread {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::size_t count = 0;
  double mean = kNone, median = kNone, least = kNone, most = kNone;
  double deviation = 0;  ///< sample standard deviation; 0 for fewer than two
};

Spread spread_of(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });  // that could not be given
  Spread s;
  s.count = values.size();
  if (values.empty()) return s;
  std::sort(values.begin(), values.end());
  s.median = (values[values.size() / 2] + values[(values.size() - 1) / 2]) / 2;
  s.least = values.front();
  s.most = values.back();
  s.mean = 0;
  for (const double v : values) s.mean += v / static_cast<double>(values.size());
  double sum = 0;
  for (const double v : values) sum += (v - s.mean) * (v - s.mean);
  if (values.size() > 1) s.deviation = std::sqrt(sum / static_cast<double>(values.size() - 1));
  return s;
}

std::string text_of(const Spread& s, int decimals) {
  std::string text = cell(s.mean, decimals);
  if (s.count > 1) text += " ± " + cell(s.deviation, decimals);
  return text;
}

std::vector<Group> groups_of(const Sweep& sweep, const std::vector<SweepRun>& runs) {
  std::vector<Group> groups;
  for (std::size_t i = 0; i < sweep.jobs.size(); ++i) {
    const SweepJob& job = sweep.jobs[i];
    if (groups.empty() || groups.back().job->sequence != job.sequence ||
        groups.back().job->variant != job.variant || groups.back().job->mode != job.mode)
      groups.push_back({&job, {}});
    groups.back().runs.push_back(&runs[i]);
  }
  return groups;
}

/// @param which  of a run's trajectories: in the end, or as the frames came
Spread spread_of(const Group& group, const SweepMeasure& measure, double Statistics<double>::*figure,
                 std::optional<TrajectoryReport> SweepRun::*which = &SweepRun::trajectory) {
  std::vector<double> values;
  for (const SweepRun* run : group.runs) {
    if (run->*which) values.push_back(measure.of(*(run->*which)).*figure);
  }
  return spread_of(values);
}

std::string subject_of(const SweepJob& job) {
  return job.variant.empty() ? job.sequence : job.sequence + ", " + job.variant;
}

const Group* baseline_of(const std::vector<Group>& groups, const Group& group) {
  for (const Group& other : groups) {
    if (other.job->mode == "none" && subject_of(*other.job) == subject_of(*group.job)) return &other;
  }
  return nullptr;
}

Table measure_table(const std::vector<Group>& groups, const SweepMeasure& measure) {
  Table table{measure.title, {"sequence", "mode"}, {}};
  for (const auto& figure : kSweepFigures) table.header.emplace_back(figure.first);
  table.header.emplace_back("worst RMSE");
  table.header.emplace_back("RMSE impr.");
  for (const Group& group : groups) {
    std::vector<std::string> cells{subject_of(*group.job), group.job->mode};
    for (const auto& figure : kSweepFigures)
      cells.push_back(text_of(spread_of(group, measure, figure.second), measure.decimals));
    cells.push_back(cell(spread_of(group, measure, &Statistics<double>::rmse).most, measure.decimals));
    const Group* base = baseline_of(groups, group);
    if (base != nullptr && base != &group) {
      const double of = spread_of(*base, measure, &Statistics<double>::rmse).mean;
      cells.push_back(
          cell(improvement_percent(of, spread_of(group, measure, &Statistics<double>::rmse).mean), 2, " %"));
    }
    table.rows.push_back(std::move(cells));
  }
  return table;
}

Table mode_table(const Sweep& sweep, const std::vector<Group>& groups) {
  Table table{"Absolute trajectory error by mode, RMSE [m]", {"sequence"}, {}};
  table.header.insert(table.header.end(), sweep.modes.begin(), sweep.modes.end());
  for (const Group& group : groups) {
    const std::string subject = subject_of(*group.job);
    if (table.rows.empty() || table.rows.back().front() != subject) table.rows.push_back({subject});
    table.rows.back().push_back(
        text_of(spread_of(group, kSweepMeasures[0], &Statistics<double>::rmse), kSweepMeasures[0].decimals));
  }
  return table;
}

/// Seeds are few, and one that fails is no outlier: the median and the worst of them.
Table seed_table(const std::vector<Group>& groups) {
  const SweepMeasure& ate = kSweepMeasures[0];
  Table table{"Absolute trajectory error over the seeds, RMSE [m]",
              {"sequence", "mode", "median", "worst", "live: median", "worst"},
              {}};
  for (const Group& group : groups) {
    std::vector<std::string> cells{subject_of(*group.job), group.job->mode};
    for (const auto which : {&SweepRun::trajectory, &SweepRun::live}) {
      const Spread s = spread_of(group, ate, &Statistics<double>::rmse, which);
      cells.push_back(cell(s.median, ate.decimals));
      cells.push_back(cell(s.most, ate.decimals));
    }
    table.rows.push_back(std::move(cells));
  }
  return table;
}

Spread coverage_of(const Group& group) {
  std::vector<double> shares;
  for (const SweepRun* run : group.runs) {
    if (run->done && run->frames > 0)
      shares.push_back(100.0 * static_cast<double>(run->tracked) / static_cast<double>(run->frames));
  }
  return spread_of(shares);
}

Table coverage_table(const std::vector<Group>& groups) {
  Table table{"Coverage: share of the frames with a pose [%]",
              {"sequence", "mode", "runs", "done", "compared", "coverage"},
              {}};
  for (const Group& group : groups) {
    const auto count = [&](auto&& what) {
      return std::to_string(std::count_if(group.runs.begin(), group.runs.end(), what));
    };
    table.rows.push_back({subject_of(*group.job), group.job->mode, std::to_string(group.runs.size()),
                          count([](const SweepRun* r) { return r->done; }),
                          count([](const SweepRun* r) { return r->trajectory.has_value(); }),
                          text_of(coverage_of(group), 1)});
  }
  return table;
}

std::vector<std::string> remarks(const Sweep& sweep, const std::vector<SweepRun>& runs) {
  std::vector<std::string> lines{
      "± : sample standard deviation over the seeds; worst: the largest of theirs; impr.: improvement of the "
      "mean over none in percent (Eq 13)",
      "live: the poses as track() returned them, trajectory_live.txt; all else is of trajectory.txt"};
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (!runs[i].failure.empty()) lines.push_back(sweep.jobs[i].name + ": " + runs[i].failure);
  }
  return lines;
}

std::string latex(std::string_view given) {
  std::string result;
  const std::string text_on_a_line = printable(given);
  const std::string_view text = text_on_a_line;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text.substr(i).starts_with("±")) {
      result += "$\\pm$";
      i += std::string_view("±").size() - 1;
    } else if (text[i] == '\\') {
      result += "\\textbackslash{}";
    } else if (text[i] == '~' || text[i] == '^') {
      result += fmt::format("\\{}{{}}", text[i]);
    } else {
      if (std::string_view("_%&#${}").find(text[i]) != std::string_view::npos) result += '\\';
      result += text[i];
    }
  }
  return result;
}

std::string latex(const Table& table) {
  const std::size_t left = table.header.size() > 1 && table.header[1] == "mode" ? 2 : 1;
  std::string text = fmt::format("% {}\n\\begin{{tabular}}{{{}{}}}\n\\hline\n", table.title,
                                 std::string(left, 'l'), std::string(table.header.size() - left, 'r'));
  const auto add = [&](const std::vector<std::string>& row) {
    for (std::size_t c = 0; c < table.header.size(); ++c)
      text += (c > 0 ? " & " : "") + (c < row.size() ? latex(row[c]) : std::string());
    text += " \\\\\n";
  };
  add(table.header);
  text += "\\hline\n";
  std::for_each(table.rows.begin(), table.rows.end(), add);
  return text + "\\hline\n\\end{tabular}\n";
}

nlohmann::json json_of(const Spread& s) {
  return {{"mean", s.mean},  // NaN becomes null
          {"spread", s.deviation}, {"median", s.median}, {"min", s.least},
          {"max", s.most},         {"runs", s.count}};
}

/// Frames and poses of a run. @throws InputError naming file, field and reason
void take_summary(const fs::path& file, SweepRun& run) {
  const nlohmann::json summary = nlohmann::json::parse(read_text(file), nullptr, false);
  if (!summary.is_object()) throw InputError(file.string(), 0, "is no JSON object, or was cut");
  const auto count = [&](const char* key) {
    const auto found = summary.find(key);
    if (found == summary.end() || !found->is_number_unsigned())
      throw InputError(file.string(), 0, fmt::format("\"{}\" is no whole number", key));
    return found->get<std::size_t>();
  };
  const std::size_t frames = count("frames"), tracked = count("tracked");
  if (tracked > frames)
    throw InputError(file.string(), 0, fmt::format("\"tracked\" is {} of {} frames", tracked, frames));
  run.frames = frames;
  run.tracked = tracked;
}

}  // namespace

std::vector<SweepRun> gather_sweep(const Sweep& sweep, const fs::path& out, const std::string& program) {
  std::vector<SweepRun> runs;
  for (const SweepJob& job : sweep.jobs) {
    SweepRun& run = runs.emplace_back();
    run.done = is_done(job, out, program);
    if (!run.done) {
      run.failure = fs::exists(out / job.name / "job.json")
                        ? "failed, or is of other options or another program"
                        : "was not run";
      continue;
    }
    try {
      take_summary(out / job.name / "summary.json", run);
      SequenceOptions reading;
      for (std::size_t i = 0; i + 1 < job.arguments.size(); ++i) {
        if (job.arguments[i] == "--format") reading.format = job.arguments[i + 1];
        if (job.arguments[i] == "--topics") reading.topics = job.arguments[i + 1];
        if (job.arguments[i] == "--rate") reading.rate = std::stod(job.arguments[i + 1]);
      }
      RunReport report = evaluate_run(out / job.name, job.path, reading);
      run.trajectory = report.trajectory;
      if (!report.trajectory.notes.empty())
        run.failure = fmt::format("{}", fmt::join(report.trajectory.notes, "; "));
      run.live = report.live;
    } catch (const InputError& error) {  // one that cannot be compared is a result, too
      run.failure = error.what();
    }
  }
  return runs;
}

std::vector<Table> tables(const Sweep& sweep, const std::vector<SweepRun>& runs) {
  const std::vector<Group> groups = groups_of(sweep, runs);
  std::vector<Table> result;
  for (const SweepMeasure& measure : kSweepMeasures) result.push_back(measure_table(groups, measure));
  result.push_back(mode_table(sweep, groups));
  result.push_back(seed_table(groups));
  result.push_back(coverage_table(groups));
  return result;
}

std::string to_markdown(const Sweep& sweep, const std::vector<SweepRun>& runs, const std::string& program) {
  std::string text = fmt::format("## {}\n\n{}\n", markdown_text(sweep.name), markdown_text(program));
  for (const Table& table : tables(sweep, runs)) text += '\n' + to_markdown(table);
  text += '\n';
  for (const std::string& line : remarks(sweep, runs)) text += "- " + markdown_text(line) + '\n';
  std::string fence = "```";
  while (sweep.text.find(fence) != std::string::npos) fence += '`';
  return text + '\n' + fence + "toml\n" + sweep.text + (sweep.text.ends_with('\n') ? "" : "\n") + fence +
         '\n';
}

std::string to_latex(const Sweep& sweep, const std::vector<SweepRun>& runs, const std::string& program) {
  std::string text = fmt::format("% {}: {}\n", printable(sweep.name), printable(program));
  for (const std::string& line : remarks(sweep, runs)) text += "% " + printable(line) + '\n';
  for (const Table& table : tables(sweep, runs)) text += '\n' + latex(table);
  return text;
}

nlohmann::json to_json(const Sweep& sweep, const std::vector<SweepRun>& runs, const std::string& program) {
  nlohmann::json j{{"sweep", sweep.name}, {"program", program}, {"configuration", sweep.text}};
  j["results"] = nlohmann::json::array();
  for (const Group& group : groups_of(sweep, runs)) {
    nlohmann::json one{{"sequence", group.job->sequence},
                       {"variant", group.job->variant},
                       {"mode", group.job->mode},
                       {"coverage_percent", json_of(coverage_of(group))}};
    for (const SweepMeasure& measure : kSweepMeasures) {
      for (const auto& [key, figure] :
           {std::pair{"rmse", &Statistics<double>::rmse}, std::pair{"mean", &Statistics<double>::mean},
            std::pair{"median", &Statistics<double>::median}, std::pair{"std", &Statistics<double>::std}}) {
        one[measure.key][key] = json_of(spread_of(group, measure, figure));
        one["live"][measure.key][key] = json_of(spread_of(group, measure, figure, &SweepRun::live));
      }
    }
    j["results"].push_back(std::move(one));
  }
  j["runs"] = nlohmann::json::array();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    nlohmann::json run{{"job", sweep.jobs[i].name},
                       {"arguments", sweep.jobs[i].arguments},
                       {"done", runs[i].done},
                       {"frames", runs[i].frames},
                       {"tracked", runs[i].tracked}};
    if (runs[i].trajectory) run["errors"] = to_json(RunReport{*runs[i].trajectory, runs[i].live, {}});
    if (!runs[i].failure.empty()) run["failure"] = runs[i].failure;
    j["runs"].push_back(std::move(run));
  }
  return j;
}

}  // namespace dynslam::runtime
