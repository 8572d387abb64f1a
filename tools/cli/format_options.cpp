// SPDX-License-Identifier: BSD-3-Clause
#include "format_options.hpp"

#include <fmt/format.h>

#include <vector>

#include "dynslam/runtime/io/sequence.hpp"
#include "validators.hpp"

namespace dynslam::app {

void add_format_options(CLI::App& app, std::string& format, std::string& topics, double& rate) {
  std::vector<std::string> names;
  for (const auto& known : runtime::sequence_formats()) names.emplace_back(known.name);
  app.add_option(
         "--format", format,
         fmt::format("Format of the sequence: {} (default: by looking at it)", fmt::join(names, ", ")))
      ->check(CLI::IsMember(names));
  app.add_option("--topics", topics,
                 "Topics of a bag, COLOUR,DEPTH (default: by the types and encodings of its messages)");
  app.add_option("--rate", rate, "Frames per second of a sequence without time stamps")
      ->capture_default_str()
      ->check(number_in(0.001, 1000));
}

void add_camera_option(CLI::App& app, std::string& camera) {
  app.add_option(
      "--camera", camera,
      "fr1, fr2, fr3, bonn, a preset as realsense_d435, or a camera file (default: from the sequence)");
}

}  // namespace dynslam::app
