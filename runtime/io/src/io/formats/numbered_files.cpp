// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

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

/// A number in a name: digits, with another one behind a point or a hyphen.
struct NumberInName {
  std::string around;  ///< the name without it; a line break stands where it was
  std::uint64_t number = 0;
  std::optional<std::uint64_t> microseconds;
};

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// Of 10, 13, 16 or 19 digits, in seconds since 1970 or a thousandth of them each; nullopt for other numbers.
std::optional<std::uint64_t> microseconds_of(std::string_view digits) {
  std::uint64_t value = 0;
  if (std::from_chars(digits.data(), digits.data() + digits.size(), value).ec != std::errc())
    return std::nullopt;
  switch (digits.size()) {
    case 10:
      return value * 1000000;
    case 13:
      return value * 1000;
    case 16:
      return value;
    case 19:
      return value / 1000;
    default:
      return std::nullopt;
  }
}

/// Seconds with decimals. @param length  of the text that is a number there
std::optional<std::uint64_t> microseconds_of_decimal(std::string_view text, std::size_t& length) {
  std::size_t point = 0;
  while (point < text.size() && is_digit(text[point])) ++point;
  std::size_t end = std::min(point + 1, text.size());
  while (end < text.size() && is_digit(text[end])) ++end;
  constexpr std::size_t kMost = 11, kMicro = 6;
  if (point == 0 || point > kMost || point >= text.size() || text[point] != '.' || end == point + 1)
    return std::nullopt;
  std::string decimals(text.substr(point + 1, end - point - 1));
  decimals.resize(kMicro, '0');
  std::string_view whole = text.substr(0, point), rest = decimals;
  const auto seconds = take_number(whole, kMost), micro = take_number(rest, kMicro);
  if (!seconds || !micro) return std::nullopt;
  length = end;
  return *seconds * 1000000 + *micro;
}

/// Every way to see a number in a name.
std::vector<NumberInName> numbers_in(const std::string& stem) {
  std::vector<NumberInName> found;
  constexpr std::size_t kMost = 16;
  for (std::size_t at = 0; at < stem.size() && found.size() < kMost;) {
    std::size_t end = at;
    while (end < stem.size() && is_digit(stem[end])) ++end;
    if (end == at) {
      ++at;
      continue;
    }
    const std::string_view text = std::string_view(stem).substr(at);
    const auto add = [&](std::size_t length, std::uint64_t number, std::optional<std::uint64_t> micro) {
      found.push_back({stem.substr(0, at) + '\n' + stem.substr(at + length), number, micro});
    };
    std::size_t length = end - at;
    std::string_view digits = text.substr(0, length);
    constexpr std::size_t kFrameDigits = 9, kTimeDigits = 18;
    if (const auto time = microseconds_of(digits)) add(length, 0, time);
    const auto number = take_number(digits, kFrameDigits);
    if (number) add(length, *number, std::nullopt);
    if (const auto time = microseconds_of_decimal(text, length)) add(length, 0, time);
    std::string_view rest = text.substr(end - at);
    if (number && rest.starts_with('-')) {  // Open3D's: NUMBER-MICROSECONDS
      rest.remove_prefix(1);
      const std::size_t before = rest.size();
      if (const auto time = take_number(rest, kTimeDigits))
        add(end - at + 1 + before - rest.size(), *number, time);
    }
    at = end;
  }
  return found;
}

}  // namespace

NumberedImages numbered_images(const fs::path& folder, std::span<const std::string_view> suffixes) {
  NumberedImages result;
  std::error_code error;
  if (!fs::is_directory(folder, error)) return result;
  struct Named {
    fs::path path;
    std::string stem;
    std::vector<NumberInName> numbers;
  };
  std::vector<Named> all;
  std::map<std::string, std::size_t> patterns;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    const auto suffix = std::find_if(suffixes.begin(), suffixes.end(),
                                     [&](std::string_view s) { return ends_without_case(name, s); });
    if (suffix == suffixes.end()) continue;
    const std::string stem = name.substr(0, name.size() - suffix->size());
    all.push_back({entry.path(), stem, numbers_in(stem)});
    for (const NumberInName& one : all.back().numbers) ++patterns[one.around];
  }
  // Of equally common ones that with the least around it, then that whose number stands last.
  const auto better = [](const auto& a, const auto& b) {
    if (a.second != b.second) return a.second > b.second;
    if (a.first.size() != b.first.size()) return a.first.size() < b.first.size();
    return a.first.find('\n') > b.first.find('\n');
  };
  const auto best = std::min_element(patterns.begin(), patterns.end(), better);
  for (const Named& one : all) {
    const auto number = std::find_if(one.numbers.rbegin(), one.numbers.rend(),
                                     [&](const auto& n) { return n.around == best->first; });
    if (number != one.numbers.rend()) {
      result.files.push_back({number->number, number->microseconds, one.stem, one.path});
    } else if (result.others++ == 0 || one.stem < result.first_other) {
      result.first_other = one.path.filename().string();
    }
  }
  const auto key = [](const NumberedFile& f) { return std::pair(f.number, f.microseconds.value_or(0)); };
  std::sort(result.files.begin(), result.files.end(), [&](const NumberedFile& a, const NumberedFile& b) {
    return key(a) != key(b) ? key(a) < key(b) : a.path < b.path;
  });
  const auto twice =
      std::adjacent_find(result.files.begin(), result.files.end(), [&](const auto& a, const auto& b) {
        return a.number == b.number && (!a.microseconds || a.microseconds == b.microseconds);
      });
  if (twice != result.files.end())
    throw InputError(twice->path.string(), 0,
                     fmt::format("and {} have the same number", (twice + 1)->path.filename().string()));
  return result;
}

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
                    const std::vector<NumberedFile>& depth, const SequenceOptions& options) {
  sequence.has_stamps = false;
  const auto time = [&](const NumberedFile& file) { return static_cast<double>(file.number) / options.rate; };
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
  shift_depth_times(sequence, depth_time_offset(sequence, options));
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
