// SPDX-License-Identifier: BSD-3-Clause
#include "synth_command.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <string_view>

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

/// Two whole numbers from 1 to 99999 with an x between, as in 848x480.
static CLI::Validator size() {
  return {[](const std::string& text) {
            const auto number = [](std::string_view s) {
              return !s.empty() && s.size() < 6 &&
                     s.find_first_not_of("0123456789") == std::string_view::npos;
            };
            const std::size_t x = text.find('x');
            const bool good = x != std::string::npos && number(std::string_view(text).substr(0, x)) &&
                              number(std::string_view(text).substr(x + 1));
            return good ? std::string() : fmt::format("'{}' is not a size as 848x480", text);
          },
          ""};
}

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
  o.command->add_option("--scenario", o.synth.scenario, "walking, sitting, box, board, empty")
      ->capture_default_str();
  o.command->add_option("--walkers", o.synth.walkers, "People who walk")->capture_default_str();
  o.command->add_option("--box", o.synth.box, "The first walker carries a box")->capture_default_str();
  o.command->add_option("--noise", o.synth.noise, "Noise of colour and depth")->capture_default_str();
  o.command->add_option("--blackout-from", o.synth.blackout_from, "First frame with the lens covered")
      ->capture_default_str();
  o.command->add_option("--blackout-frames", o.synth.blackout_frames, "Frames with the lens covered")
      ->capture_default_str();
  o.command->add_option("--fps", o.synth.fps, "Frames per second")->capture_default_str()->check(positive());
  o.command->add_option("--size", o.size, "Size of the images; the field of view across stays")
      ->capture_default_str()
      ->type_name("WxH")
      ->check(size());
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
  synth.width = std::stoi(o_->size);
  synth.height = std::stoi(o_->size.substr(o_->size.find('x') + 1));
  runtime::synthesize(synth, o_->out,
                      [&](int done, int total) { line.show(fmt::format("{}/{} frames", done, total)); });
  return 0;
}

}  // namespace dynslam::app
