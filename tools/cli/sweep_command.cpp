// SPDX-License-Identifier: BSD-3-Clause
#include "sweep_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commit.hpp"
#include "config_file.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/sweep.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "exit_codes.hpp"
#include "job_runner.hpp"
#include "run_command.hpp"
#include "validators.hpp"

namespace dynslam::app {
namespace {

namespace fs = std::filesystem;
namespace rt = dynslam::runtime;

/// What `run` would say of a job's options, now instead of after hours.
void check_options(const rt::SweepJob& job, const fs::path& file) {
  CLI::App app;
  app.require_subcommand(1);
  const RunCommand run(app);
  const auto config = add_config_option(app, {{"run", run.fields()}});
  std::vector<const char*> words{"dynslam"};
  for (const std::string& word : job.arguments) words.push_back(word.c_str());
  try {
    app.parse(arguments(static_cast<int>(words.size()), words.data()));
    run.check();
  } catch (const CLI::FileError&) {
    throw rt::InputError(file.string(), 0, job.name + ": the file of config cannot be opened");
  } catch (const CLI::ExtrasError&) {
    const auto unknown = app.remaining(true);  // the option's value before its name
    const auto name =
        std::ranges::find_if(unknown, [](const std::string& word) { return word.starts_with("--"); });
    throw rt::InputError(file.string(), 0,
                         fmt::format("{}: `run` has no option '{}'", job.name,
                                     name == unknown.end() ? unknown.front() : *name));
  } catch (const rt::InputError&) {
    throw;  // it names a file of its own
  } catch (const std::exception& error) {
    throw rt::InputError(file.string(), 0, fmt::format("{}: {}", job.name, error.what()));
  }
}

std::string shell_word(const std::string& word) {
  std::string result = "'";
  for (const char c : word) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

}  // namespace

struct SweepCommand::Options {
  CLI::App* command = nullptr;
  fs::path file, out, jobs_to;
  std::string jobs_as = "parallel", only;
  int jobs = 1;
  bool gather = false;

  [[nodiscard]] int run() const;
  [[nodiscard]] int run_only(const rt::Sweep& sweep, const JobPlace& place) const;
  void write_jobs(const rt::Sweep& sweep, const std::vector<const rt::SweepJob*>& open, const JobPlace& place,
                  const fs::path& list) const;
};

SweepCommand::SweepCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command =
      app.add_subcommand("sweep", "Run sequences x variants x modes x seeds, and gather them into tables");
  o.command->add_option("file", o.file, "Sweep: FILE.toml, see docs/sweeps.md")->required();
  o.command->add_option(
      "--out,-o", o.out,
      "Folder for the results (default: the file's `out`, or results/NAME beside the file)");
  o.command->add_option("--jobs,-j", o.jobs, "Runs at a time on this machine, 1 to 1024")
      ->capture_default_str()
      ->check(whole_in(1, 1024));
  auto* to = o.command->add_option(
      "--jobs-to", o.jobs_to, "Run nothing: write what is left to run into this file, for others to run");
  o.command
      ->add_option("--jobs-as", o.jobs_as, "parallel: a line per job; slurm: a script for an array of jobs")
      ->capture_default_str()
      ->check(CLI::IsMember({"parallel", "slurm"}))
      ->needs(to);
  auto* only = o.command->add_option("--only", o.only, "Run this job alone, as the lines of --jobs-to do");
  auto* gather = o.command->add_flag("--gather", o.gather, "Run nothing: gather what is there");
  to->excludes(only)->excludes(gather);
  only->excludes(gather);
}

SweepCommand::~SweepCommand() = default;

bool SweepCommand::chosen() const {
  return o_->command->parsed();
}

int SweepCommand::run() const {
  return o_->run();
}

int SweepCommand::Options::run_only(const rt::Sweep& sweep, const JobPlace& place) const {
  const auto job = std::find_if(sweep.jobs.begin(), sweep.jobs.end(),
                                [&](const rt::SweepJob& j) { return j.name == only; });
  if (job == sweep.jobs.end()) throw rt::UsageError(fmt::format("the sweep has no job '{}'", only));
  if (rt::is_done(*job, place.out, place.program)) return 0;
  int exit_code = 0;
  const bool ended = run_jobs({&*job}, place, 1, [&](const rt::SweepJob&, int code, const std::string& why) {
    exit_code = code;
    if (code != 0) std::cerr << only << ": " << why << '\n';
  });
  return ended ? exit_code : kInterrupted;
}

void SweepCommand::Options::write_jobs(const rt::Sweep& sweep, const std::vector<const rt::SweepJob*>& open,
                                       const JobPlace& place, const fs::path& list) const {
  const std::string call =
      fmt::format("{} sweep {} --out {} --only ", shell_word(place.executable),
                  shell_word((sweep.folder / file.filename()).string()), shell_word(place.out.string()));
  std::string text;
  if (jobs_as == "parallel") {
    for (const rt::SweepJob* job : open) text += call + shell_word(job->name) + '\n';
  } else {
    text = fmt::format("#!/bin/sh\n#SBATCH --job-name=dynslam-{}\n#SBATCH --output={}/slurm-%a.log\n",
                       sweep.name, place.out.string());
    text += open.empty()
                ? "exit 0\n"
                : fmt::format("#SBATCH --array=1-{}\ncase \"$SLURM_ARRAY_TASK_ID\" in\n", open.size());
    for (std::size_t i = 0; i < open.size(); ++i)
      text += fmt::format("{}) exec {}{} ;;\n", i + 1, call, shell_word(open[i]->name));
    if (!open.empty()) text += "esac\necho \"there is no job '$SLURM_ARRAY_TASK_ID'\" >&2\nexit 2\n";
  }
  fs::create_directories(place.out);
  rt::write_file(list, text);
}

int SweepCommand::Options::run() const {
  const rt::Sweep sweep = rt::read_sweep(file);
  const fs::path list = jobs_to.empty() ? jobs_to : fs::absolute(jobs_to);
  JobPlace place;
  if (out.empty()) {
    place.out = sweep.folder / (sweep.out.empty() ? fs::path("results") / sweep.name : fs::path(sweep.out));
  } else {
    place.out = fs::absolute(out);
  }
  place.out = place.out.lexically_normal();
  place.program = program_and_commit();
  place.executable = fs::read_symlink("/proc/self/exe").string();
  const fs::path named = fs::absolute(file);
  std::error_code none;
  if (fs::equivalent(list, named, none)) throw rt::UsageError("--jobs-to names the sweep itself");
  fs::current_path(sweep.folder);  // where relative paths of the file begin, here and in the jobs
  for (const rt::SweepJob& job : sweep.jobs) check_options(job, named);
  if (!only.empty()) return run_only(sweep, place);

  std::vector<const rt::SweepJob*> open;
  for (const rt::SweepJob& job : sweep.jobs) {
    if (!rt::is_done(job, place.out, place.program)) open.push_back(&job);
  }
  const std::size_t done = sweep.jobs.size() - open.size();
  if (!list.empty()) {
    write_jobs(sweep, open, place, list);
    std::cout << fmt::format("{} jobs, {} done; {} to run are in {}\n", sweep.jobs.size(), done, open.size(),
                             list.string());
    return 0;
  }
  fs::create_directories(place.out);
  if (!gather) {
    std::cout << fmt::format("{} jobs, {} done, {} to run\n", sweep.jobs.size(), done, open.size())
              << std::flush;
    std::size_t ended = 0;
    const bool all =
        run_jobs(open, place, jobs, [&](const rt::SweepJob& job, int code, const std::string& why) {
          std::cout << fmt::format("{}/{} {}: {}\n", ++ended, open.size(), job.name,
                                   code == 0 ? "done" : "FAILED, " + why)
                    << std::flush;
        });
    if (!all) {
      std::cerr << "dynslam: interrupted; the same command goes on\n";
      return kInterrupted;
    }
  }
  const std::vector<rt::SweepRun> runs = rt::gather_sweep(sweep, place.out, place.program);
  rt::write_file(place.out / "tables.md", rt::to_markdown(sweep, runs, place.program));
  rt::write_file(place.out / "tables.tex", rt::to_latex(sweep, runs, place.program));
  rt::write_file(place.out / "sweep.json", rt::to_json(sweep, runs, place.program).dump(2) + "\n");
  for (const rt::Table& table : rt::tables(sweep, runs)) std::cout << '\n' << rt::to_text(table);
  std::cout << fmt::format("\ntables.md, tables.tex and sweep.json are in {}\n", place.out.string());
  const auto missing = std::count_if(runs.begin(), runs.end(), [](const rt::SweepRun& r) { return !r.done; });
  if (missing > 0) {
    std::cerr << fmt::format("dynslam: error: {} of {} jobs are not done\n", missing, runs.size());
    return kInputFailure;
  }
  return 0;
}

}  // namespace dynslam::app
