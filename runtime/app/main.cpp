// SPDX-License-Identifier: BSD-3-Clause
// The `dynslam` command line.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>

#include "dynslam/runtime/ablate.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluate.hpp"
#include "dynslam/runtime/pipeline.hpp"
#include "dynslam/runtime/synth.hpp"
#include "dynslam/runtime/trajectory_io.hpp"

namespace {

namespace rt = dynslam::runtime;

constexpr int kInputFailure = 1, kUsageFailure = 2, kInterrupted = 130;

std::atomic<bool> stop_requested{false};
extern "C" void request_stop(int) { stop_requested.store(true); }

/// One line on a terminal, overwritten; nothing where the output is a file or a pipe.
class ProgressLine {
 public:
  void show(const std::string& text) {
    if (!terminal_) return;
    std::fprintf(stderr, "\r\033[K%s", text.c_str());
    std::fflush(stderr);
    shown_ = true;
  }
  ~ProgressLine() {
    if (shown_) std::fputs("\r\033[K", stderr);
  }

 private:
  bool terminal_ = isatty(STDERR_FILENO) != 0;
  bool shown_ = false;
};

std::string describe(const rt::Progress& p) {
  return fmt::format("{}/{} frames, {:.1f} frames/s, {:.0f} s left{}", p.done, p.total, p.fps, p.seconds_left,
                     p.lost > 0 ? fmt::format(", {} without a pose", p.lost) : std::string());
}

void add_run_options(CLI::App& app, rt::RunOptions& o) {
  app.add_option("sequence", o.sequence, "Folder in TUM RGB-D layout")->required();
  app.add_option("--out,-o", o.out, "Folder for the results")->required();
  app.add_option("--camera", o.camera, "fr1, fr2, fr3 or a camera file (default: from the sequence)");
  app.add_option("--masks", o.masks, "Folder of a-priori masks, <time stamp>.png: 0/255 masks, labels (8 bit) or instances (16 bit)");
  app.add_option("--map", o.map, "Build and save map.ot")->capture_default_str();
  app.add_option("--map-resolution", o.map_resolution, "Edge of a voxel [m]")->capture_default_str()->check(CLI::Range(0.005, 1.0));
  app.add_option("--max-frames", o.max_frames, "Stop after so many frames (0: all)")->capture_default_str();
  app.add_option("--seed", o.seed, "Seed of every random choice")->capture_default_str();
  app.add_option("--features", o.tracker.features.features, "Keypoints per image")->capture_default_str()->check(CLI::Range(100, 10000));
  app.add_option("--nu", o.tracker.nu, "Degrees of freedom of the pose optimisation's t-distribution")->capture_default_str()->check(CLI::PositiveNumber);
  app.add_option("--geometry-nu", o.tracker.geometry.nu, "Degrees of freedom of the static weight's t-distribution")->capture_default_str()->check(CLI::PositiveNumber);
  app.add_option("--tau", o.tracker.geometry.tau, "Static weight below which a keypoint is dynamic")->capture_default_str()->check(CLI::PositiveNumber);
}

void report_problems(const rt::RunSummary& s) {
  for (const std::string& problem : s.problems) std::cerr << "dynslam: warning: " << problem << '\n';
}

int run(const rt::RunOptions& options) {
  const rt::RunSummary summary = [&] {
    ProgressLine line;
    return rt::run_sequence(options, stop_requested, [&](const rt::Progress& p) { line.show(describe(p)); });
  }();
  report_problems(summary);
  std::cout << fmt::format("{} of {} frames tracked ({} lost, {} broken), {:.1f} frames/s; results in {}\n", summary.tracked, summary.frames,
                           summary.lost, summary.broken, summary.fps, options.out.string());
  if (summary.interrupted) {
    std::cerr << "dynslam: interrupted; what was computed is saved\n";
    return kInterrupted;
  }
  return 0;
}

int ablate(const rt::RunOptions& options) {
  const rt::Ablation ablation = [&] {
    ProgressLine line;
    return rt::ablate(options, stop_requested, [&](rt::DynamicsMode mode, const rt::Progress& p) {
      line.show(fmt::format("{}: {}", rt::to_string(mode), describe(p)));
    });
  }();
  for (const rt::AblationRow& row : ablation.rows) report_problems(row.run);
  std::cout << rt::to_text(ablation) << fmt::format("\ntables, plots, overlays and maps are in {}\n", options.out.string());
  if (ablation.interrupted) {
    std::cerr << "dynslam: interrupted; what was computed is saved\n";
    return kInterrupted;
  }
  return 0;
}

template <class Report>
int print(const Report& report, bool json) {
  std::cout << (json ? rt::to_json(report).dump() + "\n" : rt::to_text(report));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);

  CLI::App app("RGB-D semantic visual SLAM that keeps working when people and things move", "dynslam");
  app.set_version_flag("--version", "dynslam " DYNSLAM_VERSION);
  app.require_subcommand(1);
  app.set_config("--config", "", "Read options from a TOML file: a section per command, e.g. [run] and dynamics = \"both\"");
  app.fallthrough();  // --config may stand behind the command

  rt::RunOptions run_options;
  std::string dynamics = "both";
  CLI::App* run_command = app.add_subcommand("run", "Track a sequence: trajectory, masks, map, timings");
  add_run_options(*run_command, run_options);
  run_command->add_option("--dynamics", dynamics, "Masks to use: none, semantic, geometric, both")
      ->capture_default_str()
      ->check(CLI::IsMember({"none", "semantic", "geometric", "both"}));
  run_command->add_flag("--save-masks", run_options.save_masks, "Write the dynamic masks (255 = dynamic)");

  rt::RunOptions ablate_options;
  CLI::App* ablate_command = app.add_subcommand("ablate", "Run a sequence in all modes: tables, plots, overlays");
  add_run_options(*ablate_command, ablate_options);

  std::filesystem::path estimate, groundtruth;
  bool json = false;
  CLI::App* eval_command = app.add_subcommand("eval", "ATE and RPE (1 s) of a trajectory, as TUM's tools compute them");
  eval_command->add_option("estimate", estimate, "Trajectory in TUM format")->required();
  eval_command->add_option("groundtruth", groundtruth, "Ground truth in TUM format")->required();
  eval_command->add_flag("--json", json, "Print JSON");

  std::filesystem::path predicted, truth;
  CLI::App* masks_command = app.add_subcommand("eval-masks", "IoU, recall and precision of masks");
  masks_command->add_option("predicted", predicted, "Folder of PNG masks")->required();
  masks_command->add_option("truth", truth, "Folder of true masks of the same names")->required();
  masks_command->add_flag("--json", json, "Print JSON");

  rt::SynthOptions synth_options;
  std::filesystem::path synth_out;
  CLI::App* synth_command = app.add_subcommand("synth", "Make a synthetic sequence of an office with people");
  synth_command->add_option("out", synth_out, "Folder to make")->required();
  synth_command->add_option("--seed", synth_options.seed, "Layout, colours, people, noise")->capture_default_str();
  synth_command->add_option("--frames", synth_options.frames, "Number of frames")->capture_default_str();
  synth_command->add_option("--path", synth_options.path, "Camera path: static, xyz, rpy, halfsphere")->capture_default_str();
  synth_command->add_option("--scenario", synth_options.scenario, "walking, sitting, box, empty")->capture_default_str();
  synth_command->add_option("--walkers", synth_options.walkers, "People who walk")->capture_default_str();
  synth_command->add_option("--box", synth_options.box, "The first walker carries a box")->capture_default_str();
  synth_command->add_option("--noise", synth_options.noise, "Noise of colour and depth")->capture_default_str();
  synth_command->add_option("--fps", synth_options.fps, "Frames per second")->capture_default_str();
  synth_command->add_flag("--exposure-change", synth_options.exposure_change, "Exposure varies over time");
  synth_command->add_flag("--motion-blur", synth_options.motion_blur, "The shutter is open for half a frame");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    std::cerr << "dynslam: error: " << error.what() << " (see dynslam --help)\n";
    return kUsageFailure;
  }
  try {
    if (*run_command) {
      run_options.dynamics = *rt::parse_dynamics(dynamics);
      return run(run_options);
    }
    if (*ablate_command) return ablate(ablate_options);
    if (*eval_command) return print(rt::evaluate_trajectory(estimate, groundtruth), json);
    if (*masks_command) return print(rt::evaluate_masks(predicted, truth), json);
    ProgressLine line;
    rt::synthesize(synth_options, synth_out, [&](int done, int total) { line.show(fmt::format("{}/{} frames", done, total)); });
    return 0;
  } catch (const rt::UsageError& error) {
    std::cerr << "dynslam: error: " << error.what() << '\n';
    return kUsageFailure;
  } catch (const std::exception& error) {
    std::cerr << "dynslam: error: " << error.what() << '\n';
    return kInputFailure;
  }
}
