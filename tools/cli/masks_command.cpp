// SPDX-License-Identifier: BSD-3-Clause
#include "masks_command.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <iostream>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/frame_pipe.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/io/time_stamp.hpp"
#include "dynslam/runtime/nets/segmentation_stage.hpp"
#include "dynslam/runtime/slam.hpp"
#include "dynslam/runtime/slam/frame_preparation.hpp"
#include "dynslam/runtime/stopwatch.hpp"
#include "format_options.hpp"
#include "progress_line.hpp"
#include "segmentation_options.hpp"
#include "validators.hpp"
#include "warnings.hpp"

namespace dynslam::app {
namespace {

namespace rt = dynslam::runtime;

/// What is printed in the end.
struct Count {
  std::size_t frames = 0, tracked = 0, marked = 0;
  std::vector<std::string> broken;  // frames that could not be read, one line each
  rt::Stopwatch watch;
};

std::string masks_line(Count& count, const std::string& where) {
  const double seconds = count.watch.lap_ms() / 1000;
  return fmt::format("{} masks{}, {} of frames with a pose, {:.1f} frames/s\n{}", count.frames, where,
                     count.tracked, seconds > 0 ? static_cast<double>(count.frames) / seconds : 0.0,
                     count.marked == 0 ? "none of the masks marks anything dynamic\n" : "");
}

}  // namespace

struct MasksCommand::Options {
  CLI::App* command = nullptr;
  std::string sequence;
  rt::SequenceOptions reading;
  std::filesystem::path out;
  rt::SegmentationStageOptions network;
  rt::SlamOptions slam;

  [[nodiscard]] rt::SlamOptions slam_options() const;
  void make_out(const rt::Sequence& frames) const;
  void write(Count& count, const std::string& stamp, const rt::TrackResult& result) const;
  void of_sequence(Count& count) const;
  void of_pipe(Count& count) const;
};

MasksCommand::MasksCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command = app.add_subcommand("masks", "Masks of what moves, and nothing else, for other systems");
  o.command
      ->add_option("sequence", o.sequence,
                   "Sequence, as of run; or -: frames from the standard input (docs/mask-stream.md)")
      ->required();
  o.command->add_option("--out,-o", o.out,
                        "Folder for the masks, <time stamp>.png (with -: in place of the standard output)");
  add_camera_option(*o.command, o.reading.camera);
  add_format_options(*o.command, o.reading.format, o.reading.topics, o.reading.rate);
  add_segmentation_options(*o.command, o.network);
  o.command->add_option("--seed", o.slam.seed, "Seed of every random choice")
      ->capture_default_str()
      ->check(whole());
}

MasksCommand::~MasksCommand() = default;

bool MasksCommand::chosen() const {
  return o_->command->parsed();
}

rt::SlamOptions MasksCommand::Options::slam_options() const {
  rt::SlamOptions options = slam;
  options.map = false;
  if (!network.segmenter.model.empty()) {
    options.dynamics = rt::DynamicsMode::both;
    options.network = network;
  }
  return options;
}

/// The folder of the masks, once what they are of is known.
void MasksCommand::Options::make_out(const rt::Sequence& frames) const {
  if (out.empty()) return;
  rt::check_no_input(frames, out);
  std::error_code error;
  std::filesystem::create_directories(out, error);
  if (error) throw rt::InputError(out.string(), 0, "cannot be made: " + error.message());
}

void MasksCommand::Options::write(Count& count, const std::string& stamp,
                                  const rt::TrackResult& result) const {
  ++count.frames;
  count.tracked += result.ok() ? 1 : 0;
  count.marked += cv::countNonZero(result.dynamic_mask) > 0 ? 1 : 0;
  if (!out.empty()) rt::write_image(out / (stamp + ".png"), result.dynamic_mask);
}

void MasksCommand::Options::of_sequence(Count& count) const {
  if (out.empty()) throw rt::UsageError("masks of a sequence need --out, a folder");
  const rt::Sequence frames = rt::load_sequence(sequence, reading);
  warn(frames.notes);
  const rt::CameraConfig config = rt::camera_of(frames, reading.camera);
  const rt::SlamOptions options = slam_options();
  rt::Slam system(config, options);
  make_out(frames);
  rt::FramePreparation prepare(options.tracker);
  rt::FrameStream stream(frames, config, {.prepare = std::ref(prepare)});
  ProgressLine line;
  while (const auto next = stream.next()) {
    if (!next->frame) {
      count.broken.push_back(next->error);
      continue;
    }
    write(count, next->frame->stamp, system.track(*next->frame));
    line.show(fmt::format("{}/{} frames", count.frames, frames.frames.size()));
  }
  rt::check_readable(sequence, count.frames + count.broken.size(), count.broken);
}

void MasksCommand::Options::of_pipe(Count& count) const {
  std::ios::sync_with_stdio(false);
  if (!reading.camera.empty())
    throw rt::UsageError("the camera of frames from the standard input is its second line");
  rt::FramePipe pipe(std::cin, "standard input");
  rt::Slam system(pipe.camera(), slam_options());
  make_out({});
  std::optional<rt::MaskPipe> masks;
  if (out.empty()) masks.emplace(stdout);
  while (const auto frame = pipe.next()) {
    const std::size_t number = pipe.frames();
    const rt::TrackResult result = [&] {
      try {
        return system.track(frame->image, frame->depth, std::chrono::nanoseconds(frame->ns));
      } catch (const rt::InputError& error) {
        throw rt::InputError("standard input", 0, fmt::format("frame {}: {}", number, error.what()));
      }
    }();
    write(count, rt::nanosecond_text(frame->ns), result);
    if (masks) masks->put(frame->ns, result.ok(), result.dynamic_mask);
  }
}

int MasksCommand::run() const {
  const Options& o = *o_;
  Count count;
  if (o.sequence == "-") {
    o.of_pipe(count);
  } else {
    o.of_sequence(count);
  }
  if (count.frames == 0)
    throw rt::InputError(o.sequence == "-" ? "standard input" : o.sequence, 0,
                         "has no frame that can be read");
  warn(count.broken);
  if (const std::size_t masks = rt::count_pngs(o.out); masks > count.frames)
    warn({fmt::format("{} still holds {} masks of an earlier run", o.out.string(), masks - count.frames)});
  // The standard output is the masks' own where they have no folder.
  (o.out.empty() ? std::cerr : std::cout) << masks_line(count, o.out.empty() ? "" : " in " + o.out.string());
  return 0;
}

}  // namespace dynslam::app
