// SPDX-License-Identifier: BSD-3-Clause
#include "report_command.hpp"

#include <fmt/format.h>

#include <iostream>

#include "dynslam/runtime/report/html_report.hpp"
#include "validators.hpp"

namespace dynslam::app {
namespace {

void write(const runtime::ReportOptions& options) {
  const runtime::ReportResult result = runtime::write_report(options);
  std::cout << fmt::format("report: {}, {:.1f} MB\n", result.file.string(),
                           static_cast<double>(result.bytes) / 1e6);
  for (const std::string& line : result.missing) std::cerr << "dynslam: warning: " << line << '\n';
}

}  // namespace

void print_report(const std::vector<std::filesystem::path>& runs, const std::filesystem::path& out) {
  runtime::ReportOptions options;
  options.runs = runs;
  options.out = out;
  write(options);
}

struct ReportCommand::Options {
  CLI::App* command = nullptr;
  runtime::ReportOptions report;
  double megabytes = 15;
};

ReportCommand::ReportCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command = app.add_subcommand("report", "Write one HTML file about runs, to look at in a browser");
  o.command
      ->add_option("runs", o.report.runs,
                   "Folders that run or ablate wrote, of one sequence; several stand side by side")
      ->required();
  o.command->add_option("--out,-o", o.report.out, "File to write (default: report.html in the first folder)");
  o.command->add_option("--sequence", o.report.sequence,
                        "Where the sequence lies now (default: where it lay at the run)");
  o.command
      ->add_option("--max-mb", o.megabytes,
                   "Size that the file may have [MB], 2 to 500; what is more is thinned")
      ->capture_default_str()
      ->check(number_in(2, 500));
}

ReportCommand::~ReportCommand() = default;

bool ReportCommand::chosen() const {
  return o_->command->parsed();
}

int ReportCommand::run() const {
  runtime::ReportOptions options = o_->report;
  options.max_bytes = static_cast<std::size_t>(o_->megabytes * 1e6);
  write(options);
  return 0;
}

}  // namespace dynslam::app
