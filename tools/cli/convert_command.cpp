// SPDX-License-Identifier: BSD-3-Clause
#include "convert_command.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <string>
#include <tuple>

#include "dynslam/runtime/io/convert.hpp"
#include "format_options.hpp"
#include "progress_line.hpp"
#include "validators.hpp"
#include "warnings.hpp"

namespace dynslam::app {

struct ConvertCommand::Options {
  CLI::App* command = nullptr;
  std::filesystem::path sequence, out;
  runtime::SequenceOptions reading;
  std::string camera, size;
  std::size_t every = 1;
};

ConvertCommand::ConvertCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command = app.add_subcommand("convert", "Write a sequence of any format as a TUM folder");
  o.command->add_option("sequence", o.sequence, "Folder of a sequence, or a recording of ROS 1 or 2")
      ->required();
  o.command->add_option("out", o.out, "New folder")->required();
  add_format_options(*o.command, o.reading.format, o.reading.topics, o.reading.rate);
  add_camera_option(*o.command, o.camera);
  o.command->add_option("--max-frames", o.reading.max_frames, "Stop after that many frames (0: all)")
      ->capture_default_str()
      ->check(whole());
  o.command->add_option("--every", o.every, "Take one of so many frames")
      ->capture_default_str()
      ->check(whole_in(1, 1000000));
  o.command->add_option("--size", o.size, "Scale the images, and the camera with them (default: as they are)")
      ->type_name("WxH")
      ->check(image_size());
}

ConvertCommand::~ConvertCommand() = default;

bool ConvertCommand::chosen() const {
  return o_->command->parsed();
}

int ConvertCommand::run() const {
  runtime::SequenceOptions reading = o_->reading;
  reading.camera = o_->camera;
  const runtime::Sequence sequence = runtime::load_sequence(o_->sequence, reading);
  warn(sequence.notes);
  runtime::ConvertOptions options;
  options.every = o_->every;
  if (!o_->size.empty()) std::tie(options.size.width, options.size.height) = parse_image_size(o_->size);
  const runtime::CameraConfig camera = runtime::camera_of(sequence, o_->camera);
  runtime::ConvertReport report;
  {
    ProgressLine line;
    report = runtime::convert_sequence(
        sequence, camera, o_->out, options,
        [&](std::size_t done, std::size_t total) { line.show(fmt::format("{}/{} frames", done, total)); });
  }
  if (report.too_far > 0)
    std::cerr << fmt::format(
        "dynslam: warning: {:.3g} % of the depth does not fit into 16 bits of {} units per metre "
        "and is none in the new images\n",
        100.0 * static_cast<double>(report.too_far) / static_cast<double>(report.depth_pixels),
        camera.depth_units_per_metre);
  if (report.without_depth > 0)
    std::cerr << fmt::format("dynslam: warning: {} of {} depth images have no depth at all\n",
                             report.without_depth, report.written);
  for (const std::string& problem : report.broken) std::cerr << "dynslam: left out: " << problem << '\n';
  std::cout << fmt::format("{} frames in {}\n", report.written, o_->out.string());
  return 0;
}

}  // namespace dynslam::app
