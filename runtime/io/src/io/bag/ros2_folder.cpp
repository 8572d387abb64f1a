// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/ros2_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"

namespace dynslam::runtime::bag {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMetadata = "metadata.yaml";

/// Without blanks around it.
std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const auto begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) + 1 - begin);
}

std::string_view unquoted(std::string_view text) {
  const bool quoted =
      text.size() >= 2 && (text.front() == '"' || text.front() == '\'') && text.back() == text.front();
  return quoted ? text.substr(1, text.size() - 2) : text;
}

/// The list `relative_file_paths:` of metadata.yaml, an item a line.
std::vector<std::string> listed_files(const std::string& metadata) {
  std::istringstream in(metadata);
  std::vector<std::string> files;
  bool in_list = false;
  for (std::string line; std::getline(in, line);) {
    const std::string_view text = trimmed(line);
    if (in_list && text.starts_with("- ")) {
      files.emplace_back(unquoted(trimmed(text.substr(2))));
    } else if (!text.empty()) {
      in_list = text == "relative_file_paths:";
    }
  }
  return files;
}

/// N of NAME_N.mcap, NAME_N.db3 and the same compressed.
std::optional<unsigned> number_of_part(const fs::path& file) {
  std::string name = file.filename().string();
  for (const std::string_view compressed : {".zst", ".zstd"}) {
    if (name.ends_with(compressed)) {
      name.resize(name.size() - compressed.size());
      break;
    }
  }
  const fs::path plain(name);
  if (plain.extension() != ".mcap" && plain.extension() != ".db3") return std::nullopt;
  const std::string stem = plain.stem().string();
  const auto bar = stem.rfind('_');
  constexpr std::size_t kMostDigits = 9;
  if (bar == std::string::npos || bar + 1 == stem.size() || stem.size() - bar - 1 > kMostDigits)
    return std::nullopt;
  unsigned number = 0;
  for (const char c : stem.substr(bar + 1)) {
    if (std::isdigit(static_cast<unsigned char>(c)) == 0) return std::nullopt;
    number = 10 * number + static_cast<unsigned>(c - '0');
  }
  return number;
}

/// By number; of a file and the same compressed, which a recorder that was killed leaves, the first.
std::map<unsigned, fs::path> numbered_parts(const fs::path& folder) {
  std::map<unsigned, fs::path> parts;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const auto number = number_of_part(entry.path());
    if (!number) continue;
    const auto [found, is_new] = parts.emplace(*number, entry.path());
    if (is_new) continue;
    fs::path &kept = found->second, other = entry.path();
    if (kept.string().size() > other.string().size()) std::swap(kept, other);
    if (!other.string().starts_with(kept.string()))
      throw InputError(folder.string(), 0,
                       fmt::format("holds several recordings ({}, {}): name the file that is meant",
                                   kept.filename().string(), other.filename().string()));
  }
  return parts;
}

/// The file that metadata.yaml names, or the same decompressed.
fs::path part_in(const fs::path& folder, const std::string& name) {
  const fs::path file = folder / fs::path(name).filename();
  const std::string extension = file.extension().string();
  const bool compressed = extension == ".zst" || extension == ".zstd";
  for (const fs::path& path : {file, compressed ? folder / file.stem() : file}) {
    if (fs::is_regular_file(path)) return path;
  }
  throw InputError((folder / kMetadata).string(), 0,
                   fmt::format("names the file {}, which is not there", file.filename().string()));
}

bool is_metadata(const fs::path& folder) {
  std::error_code error;
  const fs::path file = folder / kMetadata;
  return fs::is_regular_file(file, error) && fs::file_size(file, error) > 0 &&
         read_file(file).find("rosbag2_bagfile_information") != std::string::npos;
}

std::vector<fs::path> files_by_metadata(const fs::path& folder, std::vector<std::string>& missing) {
  std::vector<fs::path> files;
  std::optional<unsigned> last;
  for (const std::string& name : listed_files(read_file(folder / kMetadata))) {
    files.push_back(part_in(folder, name));
    last = std::max(last, number_of_part(files.back()));
  }
  if (files.empty())
    throw InputError((folder / kMetadata).string(), 0, "names no files (relative_file_paths)");
  // It is written when the recorder is closed, and by some versions before that.
  for (const auto& [number, path] : numbered_parts(folder)) {
    if (!last || number <= *last) continue;
    files.push_back(path);
    missing.push_back(fmt::format("{}: is not in {} and is read, too", path.string(), kMetadata));
  }
  return files;
}

std::vector<fs::path> files_by_number(const fs::path& folder, std::vector<std::string>& missing) {
  std::vector<fs::path> files;
  for (const auto& [number, path] : numbered_parts(folder)) {
    std::error_code error;
    if (fs::file_size(path, error) == 0 && !error)
      missing.push_back(path.string() + ": is empty");
    else
      files.push_back(path);
  }
  if (files.empty()) throw InputError(folder.string(), 0, "holds no recording of ROS 2");
  missing.push_back(fmt::format("{}: has no {}: its recorder was not closed; {} files are read",
                                folder.string(), kMetadata, files.size()));
  return files;
}

}  // namespace

bool is_ros2_folder(const fs::path& folder) {
  if (is_metadata(folder)) return true;
  std::error_code error;
  const fs::directory_iterator files(folder, error);
  return std::any_of(begin(files), end(files),
                     [](const auto& entry) { return number_of_part(entry.path()).has_value(); });
}

std::vector<fs::path> files_of_ros2(const fs::path& folder, std::vector<std::string>& missing) {
  return is_metadata(folder) ? files_by_metadata(folder, missing) : files_by_number(folder, missing);
}

}  // namespace dynslam::runtime::bag
