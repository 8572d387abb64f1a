// SPDX-License-Identifier: BSD-3-Clause
// The `dynslam` command line.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>

#include "config_file.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/ablate.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/slam/pipeline.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "map_command.hpp"

namespace {

namespace rt = dynslam::runtime;

constexpr int kInputFailure = 1, kUsageFailure = 2, kInterrupted = 130;

std::atomic<bool> stop_requested{false};

extern "C" void request_stop(int signal) {
  stop_requested.store(true);
  std::signal(signal, SIG_DFL);  // a second Ctrl-C ends the program at once
}

/// For the commands that save what they have when they are interrupted; the others simply end.
void stop_on_signals() {
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
}

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

/// A finite number within [low, high]; unlike CLI11's own, it refuses NaN.
CLI::Validator number_in(double low, double high) {
  return {[=](std::string& text) {
            const auto value = rt::parse_number(text);
            return value && *value >= low && *value <= high
                       ? std::string()
                       : fmt::format("'{}' is not a number from {} to {}", text, low, high);
          },
          ""};
}

/// A finite number above 0.
CLI::Validator positive() {
  return {[](std::string& text) {
            const auto value = rt::parse_number(text);
            return value && *value > 0 ? std::string() : fmt::format("'{}' is not a number above 0", text);
          },
          ""};
}

/// A whole number from 0; CLI11 would turn -1 into 2^64 - 1.
CLI::Validator whole() {
  return {[](std::string& text) {
            std::uint64_t value = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            return error == std::errc() && end == text.data() + text.size()
                       ? std::string()
                       : fmt::format("'{}' is not a whole number from 0", text);
          },
          ""};
}

void add_run_options(CLI::App& app, rt::RunOptions& o) {
  app.add_option("sequence", o.sequence, "Folder in TUM RGB-D layout")->required();
  app.add_option("--out,-o", o.out, "Folder for the results")->required();
  app.add_option("--camera", o.camera, "fr1, fr2, fr3 or a camera file (default: from the sequence)");
  app.add_option(
      "--masks", o.masks,
      "Folder of a-priori masks, <time stamp>.png: 0/255 masks, labels (8 bit) or instances (16 bit)");
  rt::SegmentationStageOptions& s = o.segmentation;
  app.add_option("--model", s.segmenter.model,
                 "Segmentation network, FILE.onnx: Mask R-CNN, YOLOv8/11-seg, DeepLab and the like");
  app.add_option_function<std::string>(
         "--engine", [&s](const std::string& name) { s.segmenter.engine = *rt::parse_engine(name); },
         "What runs the network: auto, onnxruntime, opencv")
      ->default_str("auto")
      ->check(CLI::IsMember({"auto", "onnxruntime", "opencv"}));
  app.add_option_function<std::string>(
         "--model-kind", [&s](const std::string& name) { s.segmenter.kind = *rt::parse_model_kind(name); },
         "What the network's outputs mean: auto, yolo, mask-rcnn, semantic")
      ->default_str("auto")
      ->check(CLI::IsMember({"auto", "yolo", "mask-rcnn", "semantic"}));
  app.add_option("--dynamic-classes", s.segmenter.dynamic_classes, "Classes that move by themselves")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--map-classes", s.segmenter.map_classes,
                 "Classes that the map labels (default: chairs and displays)")
      ->delimiter(',');
  app.add_option("--min-score", s.segmenter.detection.min_score, "Score from which a detection counts")
      ->capture_default_str()
      ->check(number_in(0.0, 1.0));
  app.add_option("--network-threads", s.segmenter.threads, "Threads of the network, 1 to 64")
      ->capture_default_str()
      ->check(number_in(1, 64));
  app.add_option("--segment-every", s.every,
                 "The network sees every so many frames; masks are carried between them")
      ->capture_default_str()
      ->check(number_in(1, 1000));
  app.add_option_function<std::string>(
         "--segment", [&s](const std::string& how) { s.async = how == "async"; },
         "sync: before each frame is tracked; async: ahead, on a thread of its own (same results)")
      ->default_str("async")
      ->check(CLI::IsMember({"sync", "async"}));
  app.add_option("--keep-masks", s.keep, "Cut masks to the object's depth and carry missed ones forward")
      ->capture_default_str();
  app.add_option("--cache-masks", s.cache, "Folder that keeps the network's masks for the next run");
  app.add_option("--map", o.map, "Build and save map.ot")->capture_default_str();
  app.add_option("--map-resolution", o.map_resolution, "Edge of a voxel [m], 0.005 to 1")
      ->capture_default_str()
      ->check(number_in(0.005, 1.0));
  app.add_option("--loops", o.tracker.close_loops, "Close loops")->capture_default_str();
  app.add_option("--load-map", o.load_map, "Go on in the map that an earlier run saved in this folder");
  app.add_option("--save-map", o.save_map, "Save the map in this folder, for --load-map");
  app.add_option("--max-frames", o.max_frames, "Stop after so many frames (0: all)")
      ->capture_default_str()
      ->check(whole());
  app.add_option("--seed", o.seed, "Seed of every random choice")->capture_default_str()->check(whole());
  app.add_option("--features", o.tracker.features.features, "Keypoints per image, 100 to 10000")
      ->capture_default_str()
      ->check(number_in(100, 10000));
  app.add_option("--nu", o.tracker.nu, "Degrees of freedom of the pose optimisation's t-distribution")
      ->capture_default_str()
      ->check(positive());
  app.add_option("--geometry-nu", o.tracker.geometry.nu,
                 "Degrees of freedom of the static weight's t-distribution")
      ->capture_default_str()
      ->check(positive());
  app.add_option("--tau", o.tracker.geometry.tau, "Static weight below which a keypoint is dynamic")
      ->capture_default_str()
      ->check(positive());
}

/// One line on stderr for all frames without a pose; summary.json lists every one.
void report_problems(const rt::RunSummary& s, const std::filesystem::path& out,
                     const std::string& prefix = {}) {
  if (s.problems.empty()) return;
  constexpr std::size_t kShown = 2;
  std::string text = fmt::format("dynslam: warning: {}{} broken and {} lost of {} frames: ", prefix, s.broken,
                                 s.lost, s.frames);
  for (std::size_t i = 0; i < std::min(kShown, s.problems.size()); ++i)
    text += (i > 0 ? "; " : "") + s.problems[i];
  if (s.problems.size() > kShown) {
    text += fmt::format("; and {} more, see {}", s.problems.size() - kShown, (out / "summary.json").string());
  }
  std::cerr << text << '\n';
}

int interrupted() {
  std::cerr << "dynslam: interrupted; what was computed is saved\n";
  return kInterrupted;
}

/// ATE and RPE where the sequence has ground truth; what cannot be compared is said, not an error.
std::string accuracy(const rt::RunOptions& options, const rt::RunSummary& summary) {
  const auto file = options.sequence / "groundtruth.txt";
  if (!std::filesystem::exists(file)) return {};
  try {
    return rt::to_text(rt::evaluate_trajectory(summary.trajectory, rt::read_trajectory(file),
                                               (options.out / "trajectory.txt").string(), file.string()));
  } catch (const rt::InputError& error) {
    return fmt::format("no ATE and RPE: {}\n", error.what());
  }
}

int run(const rt::RunOptions& options) {
  stop_on_signals();
  const rt::RunSummary summary = [&] {
    ProgressLine line;
    return rt::run_sequence(options, stop_requested, [&](const rt::Progress& p) { line.show(describe(p)); });
  }();
  report_problems(summary, options.out);
  std::cout << fmt::format("{} of {} frames tracked ({} lost, {} broken), {:.1f} frames/s; results in {}\n",
                           summary.tracked, summary.frames, summary.lost, summary.broken, summary.fps,
                           options.out.string())
            << accuracy(options, summary);
  return summary.interrupted ? interrupted() : 0;
}

int ablate(const rt::RunOptions& options) {
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
  }
  if (!ablation.rows.empty()) {
    std::cout << rt::to_text(ablation)
              << fmt::format("\ntables, plots, overlays and maps are in {}\n", options.out.string());
  }
  return ablation.interrupted ? interrupted() : 0;
}

template <class Report>
int print(const Report& report, bool json) {
  std::cout << (json ? rt::to_json(report).dump() + "\n" : rt::to_text(report));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("RGB-D semantic visual SLAM that keeps working when people and things move", "dynslam");
  app.set_version_flag("--version", "dynslam " DYNSLAM_VERSION);
  app.require_subcommand(1);

  rt::RunOptions run_options;
  std::string dynamics = "both";
  CLI::App* run_command = app.add_subcommand("run", "Track a sequence: trajectory, masks, map, timings");
  add_run_options(*run_command, run_options);
  run_command->add_option("--dynamics", dynamics, "Masks to use: none, semantic, geometric, both")
      ->capture_default_str()
      ->check(CLI::IsMember({"none", "semantic", "geometric", "both"}));
  run_command->add_flag("--save-masks", run_options.save_masks, "Write the dynamic masks (255 = dynamic)");

  rt::RunOptions ablate_options;
  CLI::App* ablate_command =
      app.add_subcommand("ablate", "Run a sequence in all modes: tables, plots, overlays");
  add_run_options(*ablate_command, ablate_options);

  std::filesystem::path estimate, groundtruth;
  bool json = false;
  CLI::App* eval_command =
      app.add_subcommand("eval", "ATE and RPE (1 s) of a trajectory, as TUM's tools compute them");
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
  synth_command->add_option("--seed", synth_options.seed, "Layout, colours, people, noise")
      ->capture_default_str()
      ->check(whole());
  synth_command->add_option("--frames", synth_options.frames, "Number of frames")->capture_default_str();
  synth_command->add_option("--path", synth_options.path, "Camera path: static, xyz, rpy, halfsphere, loop")
      ->capture_default_str();
  synth_command->add_option("--scenario", synth_options.scenario, "walking, sitting, box, board, empty")
      ->capture_default_str();
  synth_command->add_option("--walkers", synth_options.walkers, "People who walk")->capture_default_str();
  synth_command->add_option("--box", synth_options.box, "The first walker carries a box")
      ->capture_default_str();
  synth_command->add_option("--noise", synth_options.noise, "Noise of colour and depth")
      ->capture_default_str();
  synth_command
      ->add_option("--blackout-from", synth_options.blackout_from, "First frame with the lens covered")
      ->capture_default_str();
  synth_command
      ->add_option("--blackout-frames", synth_options.blackout_frames, "Frames with the lens covered")
      ->capture_default_str();
  synth_command->add_option("--fps", synth_options.fps, "Frames per second")
      ->capture_default_str()
      ->check(positive());
  synth_command->add_flag("--exposure-change", synth_options.exposure_change, "Exposure varies over time");
  synth_command->add_flag("--motion-blur", synth_options.motion_blur, "The shutter is open for half a frame");

  const dynslam::app::MapCommand map_command(app);

  const auto config = dynslam::app::add_config_option(app);
  try {
    app.parse(dynslam::app::arguments(argc, argv));
    if (*run_command) {
      run_options.dynamics = *rt::parse_dynamics(dynamics);
      return run(run_options);
    }
    if (*ablate_command) return ablate(ablate_options);
    if (*eval_command) return print(rt::evaluate_trajectory(estimate, groundtruth), json);
    if (*masks_command) return print(rt::evaluate_masks(predicted, truth), json);
    if (map_command.chosen()) return map_command.run();
    ProgressLine line;
    rt::synthesize(synth_options, synth_out,
                   [&](int done, int total) { line.show(fmt::format("{}/{} frames", done, total)); });
    return 0;
  } catch (const CLI::FileError&) {
    std::cerr << "dynslam: error: " << app.get_config_ptr()->as<std::string>() << ": cannot be opened\n";
    return kInputFailure;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    if (const std::string place = config->origin(error.what()); !place.empty()) {
      std::cerr << "dynslam: error: " << place << error.what() << '\n';
      return kInputFailure;
    }
    const bool no_command = app.get_subcommands().empty() && argc > 1 && argv[1][0] != '-';
    const std::string reason = no_command ? fmt::format("unknown command '{}'", argv[1]) : error.what();
    std::cerr << "dynslam: error: " << reason << " (see dynslam --help)\n";
    return kUsageFailure;
  } catch (const rt::UsageError& error) {
    std::cerr << "dynslam: error: " << error.what() << '\n';
    return kUsageFailure;
  } catch (const std::exception& error) {
    std::cerr << "dynslam: error: " << error.what() << '\n';
    return kInputFailure;
  }
}
