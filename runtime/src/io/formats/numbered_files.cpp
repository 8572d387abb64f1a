// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "io/formats/format.hpp"
#include "io/frame_images.hpp"

namespace dynslam::runtime::formats {
namespace {

namespace fs = std::filesystem;

bool ends_without_case(std::string_view text, std::string_view suffix) {
  return text.size() >= suffix.size() &&
         std::equal(suffix.begin(), suffix.end(), text.end() - static_cast<std::ptrdiff_t>(suffix.size()),
                    [](unsigned char a, unsigned char b) { return std::tolower(a) == std::tolower(b); });
}

/// Digits at the front of `text`, taken off; nullopt where there are none or more than `longest`.
std::optional<std::uint64_t> take_number(std::string_view& text, std::size_t longest) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const auto length = static_cast<std::size_t>(end - text.data());
  if (error != std::errc() || length > longest) return std::nullopt;
  text.remove_prefix(length);
  return value;
}

std::optional<NumberedFile> parse_name(const fs::path& path, std::string_view prefix,
                                       std::span<const std::string_view> suffixes) {
  const std::string name = path.filename().string();
  std::string_view rest = name;
  if (!rest.starts_with(prefix)) return std::nullopt;
  const auto suffix = std::find_if(suffixes.begin(), suffixes.end(),
                                   [&](std::string_view s) { return ends_without_case(rest, s); });
  if (suffix == suffixes.end()) return std::nullopt;
  rest.remove_suffix(std::min(suffix->size(), rest.size()));
  NumberedFile file;
  file.stem = std::string(rest);
  file.path = path;
  if (rest.size() < prefix.size()) return std::nullopt;
  rest.remove_prefix(prefix.size());
  constexpr std::size_t kFrameDigits = 9, kTimeDigits = 18;
  const auto number = take_number(rest, kFrameDigits);
  if (!number) return std::nullopt;
  file.number = *number;
  if (!rest.empty() && rest.front() == '-') {
    rest.remove_prefix(1);
    file.microseconds = take_number(rest, kTimeDigits);
    if (!file.microseconds) return std::nullopt;
  }
  if (!rest.empty()) return std::nullopt;
  return file;
}

}  // namespace

std::vector<NumberedFile> numbered_files(const fs::path& folder, std::string_view prefix,
                                         std::span<const std::string_view> suffixes) {
  std::vector<NumberedFile> files;
  std::error_code error;
  if (!fs::is_directory(folder, error)) return files;
  fs::directory_iterator entries(folder, error);
  if (error) throw InputError(folder.string(), 0, "cannot be read: " + error.message());
  for (const auto& entry : entries) {
    if (auto file = parse_name(entry.path(), prefix, suffixes)) files.push_back(std::move(*file));
  }
  std::sort(files.begin(), files.end(), [](const NumberedFile& a, const NumberedFile& b) {
    return a.number != b.number ? a.number < b.number : a.path < b.path;
  });
  const auto twice = std::adjacent_find(files.begin(), files.end(),
                                        [](const auto& a, const auto& b) { return a.number == b.number; });
  if (twice != files.end()) {
    throw InputError(twice->path.string(), 0,
                     fmt::format("and {} have the same number", (twice + 1)->path.filename().string()));
  }
  return files;
}

void pair_by_number(Sequence& sequence, const std::vector<NumberedFile>& colour,
                    const std::vector<NumberedFile>& depth, double rate) {
  sequence.has_stamps = false;
  const auto time = [&](const NumberedFile& file) { return static_cast<double>(file.number) / rate; };
  std::map<std::uint64_t, const NumberedFile*> partners;
  for (const NumberedFile& file : depth) {
    partners[file.number] = &file;
    sequence.depth_times.push_back(time(file));
  }
  for (const NumberedFile& file : colour) {
    sequence.colour_times.push_back(time(file));
    const auto partner = partners.find(file.number);
    if (partner == partners.end()) continue;
    sequence.frames.push_back({time(file), time(file), file.stem, file.path, partner->second->path, {}});
  }
  if (sequence.frames.empty()) {
    throw InputError(sequence.root.string(), 0,
                     fmt::format("none of its {} colour and {} depth images have a number in common",
                                 colour.size(), depth.size()));
  }
}

cv::Size first_size(const std::vector<FrameRecord>& frames, bool depth) {
  for (const FrameRecord& frame : frames) {
    try {
      return stored_size(frame, depth ? ImageSource::Kind::depth : ImageSource::Kind::colour);
    } catch (const InputError&) {  // a broken frame is the run's to report
      if (&frame == &frames.back()) throw;
    }
  }
  return {};
}

}  // namespace dynslam::runtime::formats
