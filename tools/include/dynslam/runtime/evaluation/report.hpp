// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dynslam::runtime {

/// A table of ready-made cells; the first column is aligned to the left, the others to the right.
struct Table {
  std::string title;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;  ///< rows shorter than the header are filled up
};

/// A number with so many decimals; "-" where it is not finite.
[[nodiscard]] std::string cell(double value, int decimals, const std::string& unit = {});

/// A text on one line of Markdown, whatever is in it.
[[nodiscard]] std::string markdown_text(std::string_view text);

/// Columns of equal width, for a terminal.
[[nodiscard]] std::string to_text(const Table& table);
/// A GitHub-flavoured Markdown table below a heading.
[[nodiscard]] std::string to_markdown(const Table& table);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
