// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <utility>

namespace dynslam::app {

/// A finite number; unlike CLI11's own, these refuse NaN.
[[nodiscard]] CLI::Validator finite();
/// A finite number within [low, high].
[[nodiscard]] CLI::Validator number_in(double low, double high);
/// A finite number above 0.
[[nodiscard]] CLI::Validator positive();
/// A whole number from 0; CLI11 would turn -1 into 2^64 - 1.
[[nodiscard]] CLI::Validator whole();
/// A whole number within [low, high].
[[nodiscard]] CLI::Validator whole_in(int low, int high);
/// `auto`, or what another one accepts.
[[nodiscard]] CLI::Validator auto_or(CLI::Validator other);
/// Two whole numbers from 1 to 99999 with an x between, as in 848x480.
[[nodiscard]] CLI::Validator image_size();
/// What image_size() has accepted. @return width and height
[[nodiscard]] std::pair<int, int> parse_image_size(const std::string& text);

}  // namespace dynslam::app
