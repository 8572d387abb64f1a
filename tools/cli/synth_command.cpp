// SPDX-License-Identifier: BSD-3-Clause
#include "synth_command.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <tuple>

#include "dynslam/runtime/synth/synth.hpp"
#include "progress_line.hpp"
#include "validators.hpp"

namespace dynslam::app {

struct SynthCommand::Options {
  CLI::App* command = nullptr;
  runtime::SynthOptions synth;
  std::string size = "640x480";
  std::filesystem::path out;
};

SynthCommand::SynthCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command = app.add_subcommand("synth", "Make a synthetic sequence of an office with people");
  o.command->add_option("out", o.out, "Folder to make")->required();
  o.command->add_option("--seed", o.synth.seed, "Layout, colours, people, noise")
      ->capture_default_str()
      ->check(whole());
  o.command->add_option("--frames", o.synth.frames, "Number of frames")->capture_default_str();
  o.command->add_option("--path", o.synth.path, "Camera path: static, xyz, rpy, halfsphere, loop")
      ->capture_default_str();
  o.command->add_option("--scenario", o.synth.scenario, "walking, sitting, box, board, crowd, empty")
      ->capture_default_str();
  o.command->add_option("--walkers", o.synth.walkers, "People who walk (walking, crowd)")
      ->capture_default_str();
  o.command->add_option("--box", o.synth.box, "The first walker carries a box")->capture_default_str();
  o.command->add_option("--noise", o.synth.noise, "Noise of colour and depth")->capture_default_str();
  o.command->add_option("--blackout-from", o.synth.blackout_from, "First frame with the lens covered")
      ->capture_default_str();
  o.command->add_option("--blackout-frames", o.synth.blackout_frames, "Frames with the lens covered")
      ->capture_default_str();
  o.command->add_option("--fps", o.synth.fps, "Frames per second")->capture_default_str()->check(positive());
  o.command->add_option("--readout-time", o.synth.readout_time, "Rolling shutter: first row to last [s]")
      ->capture_default_str();
  o.command->add_option("--size", o.size, "Size of the images; the field of view across stays")
      ->capture_default_str()
      ->type_name("WxH")
      ->check(image_size());
  o.command->add_flag("--exposure-change", o.synth.exposure_change, "Exposure varies over time");
  o.command->add_flag("--motion-blur", o.synth.motion_blur, "The shutter is open for half a frame");
}

SynthCommand::~SynthCommand() = default;

bool SynthCommand::chosen() const {
  return o_->command->parsed();
}

int SynthCommand::run() const {
  ProgressLine line;
  runtime::SynthOptions synth = o_->synth;
  std::tie(synth.width, synth.height) = parse_image_size(o_->size);
  runtime::synthesize(synth, o_->out,
                      [&](int done, int total) { line.show(fmt::format("{}/{} frames", done, total)); });
  return 0;
}

}  // namespace dynslam::app
