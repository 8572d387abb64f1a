// SPDX-License-Identifier: BSD-3-Clause
#include "info_command.hpp"

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "dynslam/runtime/inspect/inspect.hpp"
#include "format_options.hpp"

namespace dynslam::app {

struct InfoCommand::Options {
  CLI::App* command = nullptr;
  std::filesystem::path sequence;
  runtime::InspectOptions inspect;
  bool json = false;
};

InfoCommand::InfoCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command = app.add_subcommand("info", "Say what a sequence is, with warnings, and how to run it");
  o.command->add_option("sequence", o.sequence, "Folder of a sequence, or a recording of ROS 1 or 2")
      ->required();
  add_format_options(*o.command, o.inspect.reading.format, o.inspect.reading.topics, o.inspect.reading.rate);
  add_camera_option(*o.command, o.inspect.camera);
  o.command->add_flag("--json", o.json, "Print JSON");
}

InfoCommand::~InfoCommand() = default;

bool InfoCommand::chosen() const {
  return o_->command->parsed();
}

int InfoCommand::run() const {
  const runtime::SequenceReport report = runtime::inspect_sequence(o_->sequence, o_->inspect);
  if (o_->json) {
    // Names of files are bytes; JSON has text alone.
    std::cout << runtime::to_json(report).dump(2, ' ', false, nlohmann::json::error_handler_t::replace)
              << '\n';
  } else {
    std::cout << runtime::to_text(report);
  }
  return 0;
}

}  // namespace dynslam::app
