// SPDX-License-Identifier: BSD-3-Clause
// A short rendered sequence in TUM's layout, of which each test gets a copy to change.
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>
#include <string>
#include <string_view>

#include "dynslam/runtime/synth/synth.hpp"
#include "tum_fixture.hpp"

namespace dynslam::test {

/// 8 frames of 320x240, nobody in them, the camera moves along three axes.
inline const std::filesystem::path& small_original() {
  static const TemporaryFolder folder;
  static const bool made = [] {
    runtime::SynthOptions options;
    options.frames = 8;
    options.path = "xyz";
    options.scenario = "empty";
    options.width = 320;
    options.height = 240;
    runtime::synthesize(options, folder.path);
    return true;
  }();
  (void)made;
  return folder.path;
}

inline void copy_sequence(const std::filesystem::path& to) {
  std::filesystem::copy(small_original(), to, std::filesystem::copy_options::recursive);
}

inline std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
inline void write_text(const std::filesystem::path& file, std::string_view text) {
  std::ofstream(file, std::ios::binary) << text;
}

/// Each line but comments as `change` makes it; the lists' first words are stamps.
inline void change_lines(const std::filesystem::path& file,
                         const std::function<std::string(std::size_t, const std::string&)>& change) {
  std::istringstream in(text_of(file));
  std::string text;
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);)
    text += line.starts_with('#') || line.empty() ? line + "\n" : change(number++, line) + "\n";
  write_text(file, text);
}

/// The stamps of the lists of images as `stamp` makes them of number and time.
inline void change_stamps(const std::filesystem::path& root,
                          const std::function<std::string(std::size_t, double)>& stamp) {
  std::filesystem::remove(root / "associations.txt");
  for (const char* list : {"rgb.txt", "depth.txt"}) {
    change_lines(root / list, [&](std::size_t i, const std::string& line) {
      return stamp(i, std::stod(line)) + line.substr(line.find(' '));
    });
  }
}

}  // namespace dynslam::test
