// SPDX-License-Identifier: BSD-3-Clause
// Sequences x variants x modes x seeds: what a file means, that a sweep goes on where it stopped, and what is
// gathered.
#include "dynslam/runtime/evaluation/sweep.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>

#include "error_text.hpp"
#include "office.hpp"
#include "program.hpp"
#include "replayed_sequence.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::call, test::office, test::ProgramResult, test::shell;

namespace {

Sweep sweep_of(const std::string& text) {
  const test::TemporaryFolder folder;
  test::write_file(folder.path / "s.toml", text);
  return read_sweep(folder.path / "s.toml");
}

std::string sweep_refusal(const std::string& text) {
  const std::string error = test::error_of([&] { (void)sweep_of(text); });
  return error.empty() ? "accepted" : error;
}

/// A sweep of two runs on the office.
struct SmallSweep {
  test::TemporaryFolder folder;
  fs::path file = folder.path / "small.toml", out = folder.path / "results" / "small";
  SmallSweep() {
    fs::create_directory_symlink(office().sequence, folder.path / "office");
    write("");
  }
  void write(const std::string& more) const {
    test::write_file(
        file,
        "sequences = [\"office\"]\nmodes = [\"none\", \"geometric\"]\n[options]\nmax-frames = 40\n"
        "map = false\n" +
            more);
  }
  [[nodiscard]] ProgramResult sweep(const std::string& arguments = {}) const {
    return call("sweep " + file.string() + " " + arguments);
  }
  [[nodiscard]] nlohmann::json results() const {
    return nlohmann::json::parse(test::bytes(out / "sweep.json"));
  }
};

}  // namespace

TEST_CASE("a sweep is the product of its lists; a variant's option comes before everybody's") {
  const Sweep sweep = sweep_of(
      "# tables\nsequences = [\"../data/a\", \"/x/b.bag\"]  # two\nmodes = [\"none\", 'both']\nseeds = [3, "
      "4]\n"
      "out = \"elsewhere\"\n\n[options]\nmap = false\nmethod = \"full\"\n[variants.new]\n[variants.paper]\n"
      "method = \"paper\"\nfeatures = 1_500\n");
  CHECK(sweep.name == "s");
  CHECK(sweep.out == "elsewhere");
  CHECK(sweep.sequences == std::vector<std::string>{"a", "b"});
  CHECK(sweep.variants == std::vector<std::string>{"new", "paper"});
  REQUIRE(sweep.jobs.size() == 16);
  std::set<std::string> names;
  for (const SweepJob& job : sweep.jobs) names.insert(job.name);
  CHECK(names.size() == 16);
  CHECK(sweep.jobs.front().name == "a/new/none/seed-3");
  CHECK(sweep.jobs.front().arguments == std::vector<std::string>{"run", "../data/a", "--dynamics", "none",
                                                                 "--seed", "3", "--map", "false", "--method",
                                                                 "full"});
  CHECK(sweep.jobs.back().name == "b/paper/both/seed-4");
  CHECK(sweep.jobs.back().arguments == std::vector<std::string>{"run", "/x/b.bag", "--dynamics", "both",
                                                                "--seed", "4", "--method", "paper",
                                                                "--features", "1500", "--map", "false"});
  const Sweep least = sweep_of("sequences = [\"a/\"]\nmodes = [\"geometric\"]\n");
  REQUIRE(least.jobs.size() == 1);
  CHECK(least.jobs[0].name == "a/geometric");
}

TEST_CASE("mistakes in a sweep's file are told with their line") {
  const std::string good = "sequences = [\"a\"]\nmodes = [\"none\"]\n";
  CHECK(sweep_refusal(good) == "accepted");
  const auto fails = [](const std::string& text, const std::string& part) {
    const std::string reason = sweep_refusal(text);
    CAPTURE(text);
    CAPTURE(reason);
    CHECK(reason.find(part) != std::string::npos);
    CHECK(reason.find('\n') == std::string::npos);
  };
  fails("modes = [\"none\"]\n", "sequences is missing");
  fails("sequences = [\"a\"]\n", "modes is missing");
  fails(good + "mode = 1\n", "s.toml:3: unknown key 'mode', did you mean modes?");
  fails(good + "modes = [\"both\"]\n", "s.toml:3: key-value pair: cannot redefine existing array 'modes'");
  fails("sequences = [\"a\", \"b/a\"]\n", "s.toml:1: two sequences are called a");
  fails("sequences = []\n", "expected a list of sequences");
  fails("sequences = [\"a\",\n\"b\"\nmodes = [\"none\"]\n",
        "s.toml:3: array: expected comma or closing ']', saw 'm'");
  fails("modes = [\"all\"]\n", "'all' is none of none, semantic, geometric, both");
  fails(good + "seeds = [1, 1.5]\n", "'1.5' is no whole number");
  fails(good + "seeds = [2, 2]\n", "2 is given twice");
  fails(good + "[option]\n", "s.toml:3: unknown table [option]");
  fails(good + "[variants.a/b]\n", "s.toml:3: table header: expected ']', saw '/'");
  fails(good + "[variants.'a/b']\n", "'a/b' is no name for a variant");
  fails(good + "[variants.a]\n[variants.a]\n",
        "s.toml:4: table header: cannot redefine existing table 'variants.a'");
  fails(good + "[options]\nseed = 1\n", "s.toml:4: seed is no option of a sweep's runs");
  fails(good + "[options]\nmap\n", "s.toml:4: key-value pair: expected '=', saw '\\n'");
  fails(good + "[options]\nmap = [1]\n", "map: expected text, a number, true or false");
}

TEST_CASE("a sweep runs what is left, and gathers what `eval` says of each run") {
  const SmallSweep small;
  const ProgramResult first = small.sweep("--jobs 2");
  CAPTURE(first.out);
  CHECK(first.code == 0);
  CHECK(first.out.find("2 jobs, 0 done, 2 to run\n") == 0);
  const nlohmann::json results = small.results();
  REQUIRE(results["runs"].size() == 2);
  for (const auto& run : results["runs"]) {
    CHECK(run["done"] == true);
    const std::string folder = (small.out / run["job"].get<std::string>()).string();
    const ProgramResult eval = call("eval " + folder + " " + office().sequence.string() + " --json");
    CHECK(run["errors"] == nlohmann::json::parse(eval.out));
  }
  CHECK(results["results"][0]["mode"] == "none");
  CHECK(results["results"][0]["coverage_percent"]["mean"] == 100.0);
  CHECK(results["results"][1]["ate_m"]["rmse"]["mean"] == results["runs"][1]["errors"]["ate_m"]["rmse"]);
  CHECK(results["results"][1]["live"]["ate_m"]["rmse"]["max"] ==
        results["runs"][1]["errors"]["live"]["ate_m"]["rmse"]);
  CHECK(results["program"].get<std::string>().starts_with("dynslam "));
  CHECK(results["configuration"] == test::bytes(small.file));
  CHECK(test::bytes(small.out / "tables.md").find("| office | geometric |") != std::string::npos);
  const double final_ate = results["runs"][1]["errors"]["ate_m"]["rmse"],
               live_ate = results["runs"][1]["errors"]["live"]["ate_m"]["rmse"];
  CHECK(test::bytes(small.out / "tables.md")
            .find(fmt::format("| office | geometric | {0:.4f} | {0:.4f} | {1:.4f} | {1:.4f} |", final_ate,
                              live_ate)) != std::string::npos);
  CHECK(test::bytes(small.out / "tables.tex").find("office & geometric & ") != std::string::npos);

  // Nothing is left; a result that is missing or of other options is.
  CHECK(small.sweep().out.find("2 jobs, 2 done, 0 to run\n") == 0);
  CHECK(small.results() == results);
  fs::remove(small.out / "office" / "none" / "job.json");
  CHECK(small.sweep("--jobs-to " + (small.folder.path / "l").string()).out.find("1 done; 1 to run") !=
        std::string::npos);
  CHECK(small.sweep().code == 0);
  CHECK(small.results() == results);
  small.write("features = 700\n");
  const ProgramResult other = small.sweep("--gather");
  CHECK(other.code == 1);
  CHECK(other.out.find("2 of 2 jobs are not done") != std::string::npos);
  CHECK(small.results()["runs"][0]["failure"].get<std::string>().find("other options") != std::string::npos);
}

TEST_CASE("a job that fails is told, does not stop the others, and is run again") {
  const SmallSweep small;
  test::write_file(
      small.file,
      "sequences = [\"absent\", \"office\"]\nmodes = [\"none\"]\n[options]\nmax-frames = 40\nmap = false\n");
  for (int again = 0; again < 2; ++again) {
    const ProgramResult r = small.sweep();
    CAPTURE(r.out);
    CHECK(r.code == 1);
    CHECK(r.out.find("absent/none: FAILED, dynslam: error: absent") != std::string::npos);
    CHECK(r.out.find("1 of 2 jobs are not done") != std::string::npos);
    CHECK(r.out.find(again == 0 ? "2 to run" : "1 to run") != std::string::npos);
    CHECK(small.results()["runs"][1]["done"] == true);
    CHECK(small.results()["results"][0]["ate_m"]["rmse"]["mean"].is_null());
  }
  small.write("fetures = 700\n");  // before anything runs
  const ProgramResult unknown = small.sweep();
  CHECK(unknown.code == 1);
  CHECK(test::mentions(unknown.out, "fetures"));
  CHECK(unknown.out.find("to run") == std::string::npos);
  CHECK(test::mentions(unknown.out, "`run` has no option '--fetures'"));
  test::write_file(small.file, "sequences = [\"office\"]\nmodes = [\"semantic\"]\n");
  test::check_one_line_error("sweep " + small.file.string(), 1, "office/semantic: --dynamics semantic needs");
  small.write("");
  const ProgramResult other = small.sweep("--only office/both");
  CHECK(other.code == 2);
  CHECK(test::mentions(other.out, "the sweep has no job 'office/both'"));
}

TEST_CASE("a job whose folder cannot be made fails, and the others go on") {
  const SmallSweep small;
  test::write_file(small.file,
                   "sequences = [\"office\"]\nmodes = [\"none\", \"geometric\"]\n[options]\nmax-frames = "
                   "20\nmap = false\n");
  const fs::path out = small.out / "office";
  fs::create_directories(out);
  test::write_file(out / "none", "a file");
  const ProgramResult r = small.sweep();
  CAPTURE(r.out);
  CHECK(r.code == 1);
  CHECK(test::mentions(r.out, "office/none: FAILED, "));
  CHECK(test::mentions(r.out, "cannot be made a folder"));
  CHECK(test::mentions(r.out, "office/geometric: done"));
  CHECK(test::mentions(r.out, "1 of 2 jobs are not done"));
}

TEST_CASE("a sweep that is interrupted ends its runs and goes on later") {
  const SmallSweep small;
  // Long enough that the first run does not end before the signal reaches it on a busy machine.
  const fs::path long_one = small.folder.path / "long";
  fs::create_directory(long_one);
  test::replay(office().sequence, long_one, 240);
  test::write_file(
      small.file,
      "sequences = [\"long\"]\nmodes = [\"none\", \"geometric\"]\n[options]\nmap = false\nfeatures = 3000\n");
  const std::string command = std::string(DYNSLAM_PROGRAM) + " sweep " + small.file.string();
  const std::string log = (small.folder.path / "log").string();
  const ProgramResult r = shell("( exec " + command + " > " + log + " 2>&1 ) & p=$!; while [ ! -s " +
                                (small.out / "long/none/log").string() + " ] && [ ! -e " +
                                (small.out / "long/none/summary.json").string() +
                                " ]; do sleep 0.02; done; kill -TERM $p; wait $p; echo code $?");
  CHECK(r.out.find("code 130") != std::string::npos);
  CHECK(test::bytes(log).find("interrupted; the same command goes on") != std::string::npos);
  CHECK_FALSE(fs::exists(small.out / "long" / "geometric"));
  CHECK(nlohmann::json::parse(test::bytes(small.out / "long/none/job.json"))["exit_code"] == 130);
  CHECK(small.sweep("--jobs 2").code == 0);
}

TEST_CASE("seeds have a mean, a spread, a median and a worst; the live trajectory has its own") {
  Sweep sweep = sweep_of("sequences = [\"a_b\"]\nmodes = [\"none\", \"both\"]\nseeds = [1, 2, 3]\n");
  std::vector<SweepRun> runs(6);
  for (std::size_t i = 0; i < 6; ++i) {
    runs[i].done = true;
    runs[i].frames = 100;
    runs[i].tracked = i < 3 ? 80 : 100;
    runs[i].trajectory.emplace();
    runs[i].trajectory->ate.translation.rmse = i < 3 ? 0.4 : 0.1 * static_cast<double>(i - 2);  // 0.1 0.2 0.3
    runs[i].live.emplace();
    runs[i].live->ate.translation.rmse = i < 3 ? 0.5 + 0.1 * static_cast<double>((i + 1) % 3) : 0.9;
  }
  runs[5].trajectory.reset();
  runs[4].live.reset();  // of an earlier version
  runs[5].live.reset();
  runs[5].failure = "cannot be aligned";
  const std::vector<Table> all = tables(sweep, runs);
  REQUIRE(all.size() == 6);
  CHECK(all[0].rows[0][2] == "0.4000 ± 0.0000");
  CHECK(all[0].rows[1][2] == "0.1500 ± 0.0707");  // of the two that can be compared
  CHECK(all[0].rows[1].back() == "62.50 %");
  CHECK(all[3].rows[0] == std::vector<std::string>{"a_b", "0.4000 ± 0.0000", "0.1500 ± 0.0707"});
  CHECK(all[0].header[6] == "worst RMSE");
  CHECK(all[0].rows[0][6] == "0.4000");
  CHECK(all[0].rows[1][6] == "0.2000");
  CHECK(all[4].header ==
        std::vector<std::string>{"sequence", "mode", "median", "worst", "live: median", "worst"});
  CHECK(all[4].rows[0] == std::vector<std::string>{"a_b", "none", "0.4000", "0.4000", "0.6000", "0.7000"});
  CHECK(all[4].rows[1] == std::vector<std::string>{"a_b", "both", "0.1500", "0.2000", "0.9000", "0.9000"});
  CHECK(all[5].rows[1] == std::vector<std::string>{"a_b", "both", "3", "3", "2", "100.0 ± 0.0"});
  CHECK(to_markdown(sweep, runs, "p").find("a_b/both/seed-3: cannot be aligned") != std::string::npos);
  CHECK(to_latex(sweep, runs, "p").find("a\\_b & both & 0.1500 $\\pm$ 0.0707 & ") != std::string::npos);
  const nlohmann::json json = to_json(sweep, runs, "p")["results"];
  CHECK(json[1]["ate_m"]["rmse"]["spread"].get<double>() == doctest::Approx(0.0707).epsilon(0.01));
  CHECK(json[1]["ate_m"]["rmse"]["max"] == 0.2);
  CHECK(json[1]["ate_m"]["rmse"]["median"].get<double>() == doctest::Approx(0.15));
  CHECK(json[0]["live"]["ate_m"]["rmse"]["median"] == 0.6);
  CHECK(json[1]["live"]["ate_m"]["rmse"]["runs"] == 1);
}

TEST_CASE("GNU parallel runs a sweep's lines, and a shell an array's tasks; the results are the same") {
  const SmallSweep here;
  CHECK(here.sweep().code == 0);
  const SmallSweep there;
  const std::string list = (there.folder.path / "jobs.txt").string();
  const auto same = [&](const char* mode) {
    return test::bytes(there.out / "office" / mode / "trajectory.txt") ==
           test::bytes(here.out / "office" / mode / "trajectory.txt");
  };
  // As Slurm calls a script, a task at a time.
  CHECK(there.sweep("--jobs-to " + list + " --jobs-as slurm").code == 0);
  CHECK(test::bytes(list).find("#SBATCH --array=1-2\n") != std::string::npos);
  CHECK(shell("SLURM_ARRAY_TASK_ID=2 sh " + list).code == 0);
  CHECK(same("geometric"));
  CHECK(shell("SLURM_ARRAY_TASK_ID=3 sh " + list + " 2>&1").code == 2);
  // What is left of it by parallel, or a line at a time where that is not installed.
  CHECK(there.sweep("--jobs-to " + list).out.find("2 jobs, 1 done; 1 to run") == 0);
  const bool parallel = shell("command -v parallel").code == 0;
  if (!parallel) MESSAGE("GNU parallel is not installed: a shell runs its lines");
  const ProgramResult run = shell(parallel ? "parallel --will-cite -j 2 < " + list + " 2>&1" : "sh " + list);
  CAPTURE(run.out);
  CHECK(run.code == 0);
  CHECK(same("none"));
  CHECK(there.sweep("--jobs-to " + list).out.find("0 to run") != std::string::npos);
  CHECK(test::bytes(list).empty());
  CHECK(there.sweep("--gather").code == 0);
  CHECK(there.results()["results"] == here.results()["results"]);
}
