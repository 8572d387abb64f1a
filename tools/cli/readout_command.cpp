// SPDX-License-Identifier: BSD-3-Clause
#include "readout_command.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <iostream>

#include "dynslam/runtime/inspect/readout.hpp"
#include "exit_codes.hpp"
#include "format_options.hpp"
#include "warnings.hpp"

namespace dynslam::app {

struct ReadoutCommand::Options {
  CLI::App* command = nullptr;
  std::filesystem::path sequence;
  runtime::SequenceOptions reading;
};

ReadoutCommand::ReadoutCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command = app.add_subcommand("readout", "Measure the rolling shutter of a sequence's camera");
  o.command->add_option("sequence", o.sequence, "Folder of a sequence, or a recording of ROS 1 or 2")
      ->required();
  add_format_options(*o.command, o.reading.format, o.reading.topics, o.reading.rate);
  add_camera_option(*o.command, o.reading.camera);
  o.command->add_option("--max-frames", o.reading.max_frames, "Look at so many frames (0: all)")
      ->capture_default_str();
}

ReadoutCommand::~ReadoutCommand() = default;

bool ReadoutCommand::chosen() const {
  return o_->command->parsed();
}

int ReadoutCommand::run() const {
  const runtime::Sequence sequence = runtime::load_sequence(o_->sequence, o_->reading);
  warn(sequence.notes);
  const runtime::CameraConfig camera = runtime::camera_of(sequence, o_->reading.camera);
  const runtime::ReadoutReport report =
      runtime::measure_readout(sequence, camera, [&](const runtime::ReadoutTrial& trial) {
        std::cout << fmt::format("assumed {:7.4f} s: {} of {} frames tracked, rows ask for {:+.4f} s\n",
                                 trial.assumed, trial.tracked, sequence.frames.size(), trial.correction)
                  << std::flush;
      });
  if (!report.readout) {
    std::cerr << fmt::format("dynslam: error: {}: the readout time cannot be measured: {}\n",
                             o_->sequence.string(), report.why_not);
    return kInputFailure;
  }
  std::cout << fmt::format("readout_time = {:.4f}    # 95 %: {:.4f} to {:.4f}; the camera's file had {}\n",
                           *report.readout, *report.readout - report.half_width,
                           *report.readout + report.half_width, camera.readout_time);
  return 0;
}

}  // namespace dynslam::app
