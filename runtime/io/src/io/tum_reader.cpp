// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/tum_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "dynslam/runtime/io/time_stamp.hpp"

namespace dynslam::runtime {
namespace {

TimeStamp parse_stamp(std::string_view word, const std::string& name, std::size_t line) {
  const auto time = parse_time(word);
  if (!time || time->t < 0) throw InputError(name, line, fmt::format("'{}' is not a time stamp", word));
  return *time;
}

std::string parse_path(std::string_view word, const std::string& name, std::size_t line) {
  if (has_control(word))
    throw InputError(
        name, line,
        fmt::format("'{}' has a control character, which no file's name should", printable(word)));
  return std::string(word);
}

void check_increasing(double previous, double t, const std::string& name, std::size_t line) {
  if (t == previous) throw InputError(name, line, "the time stamp occurs twice");
  if (t < previous) throw InputError(name, line, "the time stamps are not sorted");
}

/// Sorts lines by time and drops those of a time that was there before, with a note of each.
template <class Line, class TimeOf>
void mend_order(std::vector<Line>& lines, const TimeOf& time_of, const std::string& name,
                std::vector<std::string>& notes) {
  const auto before = [&](const Line& a, const Line& b) { return time_of(a) < time_of(b); };
  const auto same = [&](const Line& a, const Line& b) { return time_of(a) == time_of(b); };
  if (!std::is_sorted(lines.begin(), lines.end(), before)) {
    std::stable_sort(lines.begin(), lines.end(), before);
    notes.push_back(name + ": the lines are not sorted by time; they are read as if they were");
  }
  const std::size_t count = lines.size();
  lines.erase(std::unique(lines.begin(), lines.end(), same), lines.end());
  if (lines.size() < count)
    notes.push_back(fmt::format("{}: {} of {} lines have the time of another one and are left out", name,
                                count - lines.size(), count));
}

/// Whether a path says that it is a depth image: associations have either order.
bool names_depth(std::string_view path) {
  std::string lower(path);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower.find("depth") != std::string::npos;
}

/// @param notes  of parse_unsorted_list(); null: times that do not increase are errors
std::vector<ListEntry> list_of(std::istream& in, const std::string& name, std::vector<std::string>* notes) {
  std::vector<ListEntry> list;
  LineReader reader(in);
  while (reader.next()) {
    const auto words = split_words(reader.line());
    if (words.size() != 2) {
      throw InputError(name, reader.number(),
                       fmt::format("expected 2 columns (timestamp file), found {}", words.size()));
    }
    const auto [t, ns] = parse_stamp(words[0], name, reader.number());
    if (notes == nullptr && !list.empty()) check_increasing(list.back().t, t, name, reader.number());
    list.push_back({t, std::string(words[0]), parse_path(words[1], name, reader.number()), ns});
  }
  if (in.bad()) throw InputError(name, 0, "cannot be read");
  if (notes != nullptr)
    mend_order(
        list, [](const ListEntry& e) { return e.t; }, name, *notes);
  return list;
}

std::vector<FrameRecord> associations_of(std::istream& in, const std::string& name,
                                         std::vector<std::string>* notes) {
  std::vector<FrameRecord> frames;
  LineReader reader(in);
  while (reader.next()) {
    const auto words = split_words(reader.line());
    if (words.size() != 4) {
      throw InputError(
          name, reader.number(),
          fmt::format("expected 4 columns (rgb time, rgb file, depth time, depth file), found {}",
                      words.size()));
    }
    FrameRecord record;
    const std::size_t rgb = names_depth(words[1]) && !names_depth(words[3]) ? 2 : 0, depth = 2 - rgb;
    const TimeStamp time = parse_stamp(words[rgb], name, reader.number());
    record.t_rgb = time.t;
    record.ns = time.ns;
    record.t_depth = parse_stamp(words[depth], name, reader.number()).t;
    if (notes == nullptr && !frames.empty())
      check_increasing(frames.back().t_rgb, record.t_rgb, name, reader.number());
    record.stamp = words[rgb];
    record.rgb = parse_path(words[rgb + 1], name, reader.number());
    record.depth = parse_path(words[depth + 1], name, reader.number());
    frames.push_back(std::move(record));
  }
  if (in.bad()) throw InputError(name, 0, "cannot be read");
  if (notes != nullptr)
    mend_order(
        frames, [](const FrameRecord& f) { return f.t_rgb; }, name, *notes);
  return frames;
}

}  // namespace

std::vector<ListEntry> parse_list(std::istream& in, const std::string& name) {
  return list_of(in, name, nullptr);
}

std::vector<FrameRecord> parse_associations(std::istream& in, const std::string& name) {
  return associations_of(in, name, nullptr);
}

std::vector<ListEntry> parse_unsorted_list(std::istream& in, const std::string& name,
                                           std::vector<std::string>& notes) {
  return list_of(in, name, &notes);
}

std::vector<FrameRecord> parse_unsorted_associations(std::istream& in, const std::string& name,
                                                     std::vector<std::string>& notes) {
  return associations_of(in, name, &notes);
}

}  // namespace dynslam::runtime
