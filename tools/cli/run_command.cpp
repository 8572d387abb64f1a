// SPDX-License-Identifier: BSD-3-Clause
#include "run_command.hpp"

#include <fmt/format.h>

#include <atomic>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "dynslam/runtime/config/options_file.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/ablate.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/inspect/inspect.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/report/html_report.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "dynslam/runtime/view/live_view.hpp"
#include "exit_codes.hpp"
#include "format_options.hpp"
#include "progress_line.hpp"
#include "report_command.hpp"
#include "run_lines.hpp"
#include "segmentation_options.hpp"
#include "validators.hpp"
#include "view_window.hpp"
#include "warnings.hpp"

namespace dynslam::app {
namespace {

namespace rt = dynslam::runtime;

std::atomic<bool> stop_requested{false};
std::atomic<std::int64_t> stop_requested_at{0};  // [ms]

/// The first signal asks the run to end, a later one ends the program at once. Within half a second it is the
/// same request: timeout(1) sends its signal to the process and to its group.
extern "C" void request_stop(int signal) {
  constexpr std::int64_t kSameRequest = 500;
  timespec time{};
  ::clock_gettime(CLOCK_MONOTONIC, &time);
  const std::int64_t now = 1 + std::int64_t{time.tv_sec} * 1000 + time.tv_nsec / 1000000;
  std::int64_t first = 0;
  if (stop_requested_at.compare_exchange_strong(first, now)) {
    stop_requested.store(true);
  } else if (now - first > kSameRequest) {
    std::signal(signal, SIG_DFL);
    ::raise(signal);  // comes once this one has been handled
  }
}

/// For the commands that save what they have when they are interrupted; the others simply end.
void stop_on_signals() {
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  // A terminal that is closed; with nohup the signal stays ignored.
  if (std::signal(SIGHUP, request_stop) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

std::string describe(const rt::Progress& p) {
  return fmt::format("{}/{} frames, {:.1f} frames/s, {:.0f} s left{}", p.done, p.total, p.fps, p.seconds_left,
                     p.lost > 0 ? fmt::format(", {} without a pose", p.lost) : std::string());
}

void add_slam_options(CLI::App& app, rt::RunOptions& o) {
  app.add_option_function<std::string>(
         "--method", [&o](const std::string& name) { o.tracker.method = *rt::parse_method(name); },
         "paper: masks as in Wen et al. 2021, with guards; full: the belief of motion, surface weights, "
         "motion prior")
      ->default_str("full")
      ->check(CLI::IsMember({"paper", "full"}));
  app.add_option("--map", o.map, "Build and save map.sot")->capture_default_str();
  app.add_flag_callback(
      "--no-map", [&o] { o.map = false; }, "As --map false");
  app.add_option("--map-resolution", o.map_resolution, "Edge of a voxel [m], 0.005 to 1")
      ->capture_default_str()
      ->check(number_in(0.005, 1.0));
  app.add_option_function<std::size_t>(
         "--map-memory", [&o](const std::size_t& megabytes) { o.map_memory = megabytes << 20U; },
         "MB that the map may take, 1 to 1000000; a run that needs more fails")
      ->default_str("2048")
      ->check(whole_in(1, 1000000));
  app.add_option("--loops", o.tracker.close_loops, "Close loops")->capture_default_str();
  app.add_flag_callback(
      "--no-loops", [&o] { o.tracker.close_loops = false; }, "As --loops false");
  app.add_option("--load-map", o.load_map, "Go on in the map that an earlier run saved in this folder");
  app.add_option("--save-map", o.save_map, "Save the map in this folder, for --load-map");
  app.add_option("--save-every", o.save_every,
                 "Seconds after which trajectory and summary so far are written again, 0.1 to 3600")
      ->capture_default_str()
      ->check(number_in(0.1, 3600));
  app.add_option("--max-broken", o.max_broken,
                 "Share of broken frames with which a run still succeeds, 0 to 1")
      ->capture_default_str()
      ->check(number_in(0, 1));
  app.add_option("--max-frames", o.max_frames, "Stop after so many frames (0: all)")
      ->capture_default_str()
      ->check(whole());
  app.add_option("--seed", o.seed, "Seed of every random choice")->capture_default_str()->check(whole());
  app.add_option("--features", o.tracker.features.features, "Keypoints per image, 100 to 10000")
      ->capture_default_str()
      ->check(whole_in(100, 10000));
  app.add_option("--nu", o.tracker.pose.nu, "Degrees of freedom of the pose optimisation's t-distribution")
      ->capture_default_str()
      ->check(positive());
  app.add_option("--geometry-nu", o.tracker.geometry.weights.nu,
                 "Degrees of freedom of the static weight's t-distribution")
      ->capture_default_str()
      ->check(positive());
  app.add_option("--tau", o.tracker.geometry.weights.tau, "Static weight below which a keypoint is dynamic")
      ->capture_default_str()
      ->check(positive());
}

void add_run_options(CLI::App& app, rt::RunOptions& o, std::string_view default_out) {
  app.add_option("sequence", o.sequence,
                 "Folder of a sequence: TUM, 7-Scenes, ... (see --format), or a recording of ROS 1 or 2")
      ->required();
  app.add_option("--out,-o", o.out, fmt::format("Folder for the results (default: {})", default_out));
  add_camera_option(app, o.camera);
  app.add_option(
         "--readout-time", o.readout_time,
         "Time in which the camera reads its rows [s], -0.2 to 0.2, in place of the camera's; 0: all at "
         "once")
      ->check(number_in(-0.2, 0.2));
  add_format_options(app, o.format, o.topics, o.rate);
  add_mask_options(app, o);
  app.add_flag("--report", o.report, "Write report.html, one file to look at in a browser");
  add_segmentation_options(app, o.segmentation);
  add_slam_options(app, o);
}

/// NAME of a sequence's folder, or of NAME.bag.
std::string sequence_name(const std::filesystem::path& sequence) {
  std::filesystem::path full = std::filesystem::weakly_canonical(std::filesystem::absolute(sequence));
  if (!full.has_filename()) full = full.parent_path();
  const bool folder = !std::filesystem::is_regular_file(full);
  return (folder ? full.filename() : full.stem()).string();
}

int interrupted() {
  std::cerr << "dynslam: interrupted; what was computed is saved\n";
  return kInterrupted;
}

/// A sequence's ground truth: its frames are not needed to the end.
struct Truth {
  std::vector<StampedPose<double>> poses;
  std::filesystem::path file;
  std::string missing, turned;  ///< as Sequence has them
};

/// ATE and RPE where the sequence has ground truth; what cannot be compared is said, not an error.
std::string accuracy(const rt::RunOptions& options, const Truth& truth, const rt::RunSummary& summary) {
  if (truth.poses.empty())
    return truth.missing.empty()
               ? ""
               : fmt::format("no ATE and RPE, for want of a ground truth: {}\n", truth.missing);
  try {
    const std::string turned = truth.turned.empty() ? "" : truth.turned + "\n";
    return turned + rt::to_text(rt::evaluate_run(summary.trajectory, summary.live_trajectory, truth.poses,
                                                 options.out, truth.file.string()));
  } catch (const rt::InputError& error) {
    return fmt::format("no ATE and RPE: {}\n", error.what());
  }
}

/// A window on a run.
struct View {
  View(const rt::RunOptions& options, const std::string& name)
      : window("dynslam: " + name), live(window, options, stop_requested) {}
  ViewWindow window;
  rt::LiveView live;
};

void end(View& view) {
  try {
    view.live.finish();
  } catch (const std::exception& error) {
    std::cerr << "dynslam: warning: --view ended before the run did: " << error.what() << '\n';
  }
}

/// A run writes its configuration into --out. That may be the file of --config where it is the same bytes.
/// @throws UsageError  it would be other ones
void check_config_stays(const CLI::App& command, const rt::RunOptions& options) {
  const CLI::Option* option = command.get_parent()->get_config_ptr();
  if (option == nullptr || option->empty()) return;
  const std::filesystem::path file = option->as<std::string>();
  std::error_code error;
  if (!std::filesystem::equivalent(file, options.out / "config.toml", error) ||
      rt::read_file(file) == rt::config_file(options))
    return;
  throw rt::UsageError(fmt::format(
      "--config {} would be replaced by the configuration of this run: name another --out", file.string()));
}

int run_sequence(const rt::RunOptions& options, bool with_view) {
  if (options.report) (void)rt::report_page();  // before hours are spent on the run
  stop_on_signals();
  std::optional<View> view;
  if (with_view) view.emplace(options, sequence_name(options.sequence));
  Truth truth;
  const auto opened = [&](const rt::Sequence& found, const rt::CameraConfig& camera) {
    truth = {found.groundtruth, found.truth_file, found.truth_missing, found.truth_turned};
    warn(found.notes);
    warn(rt::camera_doubts(found, camera));
    warn(rt::time_doubts(found));
    if (view) view->live.open(found, camera);
  };
  const rt::RunSummary summary = [&] {
    ProgressLine line;
    const auto show = [&](const rt::Progress& p) { line.show(describe(p)); };
    return rt::run_sequence(options, stop_requested, show, opened,
                            view ? view->live.watch() : rt::RunWatch());
  }();
  if (view) end(*view);
  view.reset();
  report_problems(summary, options.out);
  warn(summary.warnings);
  std::cout << fmt::format("{} of {} frames tracked ({} lost, {} broken), {:.1f} frames/s; results in {}\n",
                           summary.tracked, summary.frames, summary.lost, summary.broken, summary.fps,
                           options.out.string())
            << mask_report(options, summary) << map_report(options, summary) << separate_report(summary)
            << live_report(summary) << accuracy(options, truth, summary) << std::flush;
  if (summary.interrupted) return interrupted();
  if (options.report) print_report({options.out}, {});
  return 0;
}

int ablate_sequence(const rt::RunOptions& options) {
  if (options.report) (void)rt::report_page();
  stop_on_signals();
  const rt::Ablation ablation = [&] {
    ProgressLine line;
    return rt::ablate(options, stop_requested, [&](rt::DynamicsMode mode, const rt::Progress& p) {
      line.show(fmt::format("{}: {}", rt::to_string(mode), describe(p)));
    });
  }();
  for (const rt::AblationRow& row : ablation.rows) {
    const std::string mode(rt::to_string(row.mode));
    report_problems(row.run, options.out / mode, mode + ": ");
    rt::RunOptions run = options;
    run.dynamics = row.mode;
    std::cout << mask_report(run, row.run);
  }
  if (!ablation.rows.empty()) {
    std::cout << rt::to_text(ablation)
              << fmt::format("\ntables, plots, overlays and maps are in {}\n", options.out.string());
  }
  if (ablation.interrupted) return interrupted();
  if (options.report) {
    std::vector<std::filesystem::path> runs;
    for (const rt::AblationRow& row : ablation.rows)
      runs.push_back(options.out / std::string(to_string(row.mode)));
    print_report(runs, options.out / "report.html");
  }
  return 0;
}

}  // namespace

struct RunCommand::Options {
  CLI::App* command = nullptr;
  rt::RunOptions run;
  std::optional<rt::DynamicsMode> dynamics;  // empty: by what there is
  bool view = false;
  /// With what was not said chosen. @throws UsageError  an option that nothing would use
  [[nodiscard]] rt::RunOptions complete() const;
};

RunCommand::RunCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command = app.add_subcommand("run", "Track a sequence: trajectory, masks, map, timings");
  add_run_options(*o.command, o.run, "results/NAME");
  o.command
      ->add_option_function<std::string>(
          "--dynamics", [&o](const std::string& name) { o.dynamics = rt::parse_dynamics(name); },
          "Masks to use: none, semantic, geometric, both (default: both with --model or --masks, else "
          "geometric)")
      ->check(CLI::IsMember({"none", "semantic", "geometric", "both"}));
  o.command->add_flag("--verbose,-v", o.run.verbose,
                      "Say what was recognised: the network's outputs, values and classes");
  o.command->add_flag("--view", o.view, "Show the run in a window while it goes on");
  o.command->add_flag("--save-masks", o.run.save_masks,
                      "Write the masks (255 moves, 128 may move, 0 static)");
  o.command->add_flag_callback(
      "--live", [&o] { o.run.schedule = rt::Schedule::live; },
      "As from a camera: frames come at their recorded pace, late ones are dropped; results differ between "
      "runs");
  o.command->add_option("--live-speed", o.run.live_speed, "Pace of --live, as a multiple of the recorded one")
      ->capture_default_str()
      ->check(number_in(0.01, 1000));
}

RunCommand::~RunCommand() = default;

bool RunCommand::chosen() const {
  return o_->command->parsed();
}

rt::ConfigFields RunCommand::fields() const {
  return rt::config_fields(o_->run, o_->dynamics);
}

void RunCommand::finish_options() const {
  for (CLI::Option* option : o_->command->get_options()) {
    if (!option->empty()) option->run_callback();  // flags wait for their command otherwise
  }
}

rt::RunOptions RunCommand::Options::complete() const {
  rt::RunOptions options = run;
  if (options.out.empty()) options.out = std::filesystem::path("results") / sequence_name(options.sequence);
  const bool no_prior = options.masks.empty() && options.segmentation.segmenter.model.empty();
  options.dynamics = dynamics.value_or(no_prior ? rt::DynamicsMode::geometric : options.dynamics);
  check_used(*command, options);
  if (command->count("--live-speed") > 0 && options.schedule != rt::Schedule::live)
    throw rt::UsageError("--live-speed is the pace of --live: give that, too");
  return options;
}

void RunCommand::check() const {
  rt::check_request(o_->complete());
}

int RunCommand::run() const {
  const rt::RunOptions options = o_->complete();
  check_config_stays(*o_->command, options);
  if (!o_->dynamics && options.dynamics == rt::DynamicsMode::geometric) {
    std::cout
        << "no --model and no --masks: what moves is found by its geometry alone (--dynamics geometric)\n"
        << std::flush;
  }
  return run_sequence(options, o_->view);
}

struct AblateCommand::Options {
  CLI::App* command = nullptr;
  rt::RunOptions run;
  std::optional<rt::DynamicsMode> dynamics;  // of a configuration file; all are run
};

AblateCommand::AblateCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  o_->command = app.add_subcommand("ablate", "Run a sequence in all modes: tables, plots, overlays");
  add_run_options(*o_->command, o_->run, "results/NAME-ablation");
}

AblateCommand::~AblateCommand() = default;

bool AblateCommand::chosen() const {
  return o_->command->parsed();
}

rt::ConfigFields AblateCommand::fields() const {
  return rt::config_fields(o_->run, o_->dynamics);
}

int AblateCommand::run() const {
  rt::RunOptions options = o_->run;
  if (options.out.empty()) {
    options.out = std::filesystem::path("results") / sequence_name(options.sequence);
    options.out += "-ablation";
  }
  check_used(*o_->command, options);
  for (const rt::DynamicsMode mode : rt::kAblationModes) {
    rt::RunOptions run = options;
    run.out /= std::string(to_string(mode));
    check_config_stays(*o_->command, run);
  }
  return ablate_sequence(options);
}

}  // namespace dynslam::app
