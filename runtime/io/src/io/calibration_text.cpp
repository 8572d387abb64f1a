// SPDX-License-Identifier: BSD-3-Clause
#include "io/calibration_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::size_t kDeepestCalibration = 32;  // no calibration is nested deeper

/// A value without the tag before it, as in `!!opencv-matrix`.
std::string_view without_tag(std::string_view value) {
  if (value.empty() || value.front() != '!') return value;
  const auto blank = value.find(' ');
  return blank == std::string_view::npos ? std::string_view() : trim(value.substr(blank));
}

class YamlReader {
 public:
  explicit YamlReader(const std::string& file) : file_(file) {}

  std::vector<NamedWords> read(const std::string& text) {
    std::istringstream in(text);
    std::string whole;
    while (std::getline(in, whole)) {
      ++number_;
      const std::string_view line = without_comment(whole);
      if (trim(line).empty()) continue;
      if (open_ == 0 && line.front() == '%') continue;
      if (open_ == 0 && (line.starts_with("---") || line.starts_with("..."))) {
        if (nodes_.empty()) continue;
        break;
      }
      if (open_ > 0) {
        flow(line);
      } else {
        block(line);
      }
    }
    if (open_ > 0) throw InputError(file_, opened_at_, "the bracket that opens here is not closed");
    return std::move(nodes_);
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw InputError(file_, number_, reason); }

  /// A line outside of brackets.
  void block(std::string_view line) {
    const std::size_t indent = line.find_first_not_of(' ');
    const std::string_view content = trim(line);
    if (line[indent] == '\t') fail("tabs cannot indent YAML");
    if (content == "-" || content.starts_with("- ")) return item(indent, trim(content.substr(1)));
    const std::size_t colon = key_end(content);
    if (colon == std::string_view::npos) fail("expected 'key: value'");
    while (!around_.empty() && around_.back().first >= indent) around_.pop_back();
    if (around_.size() == kDeepestCalibration) fail("is nested too deep for a calibration");
    std::string name(unquoted(trim(content.substr(0, colon))));
    if (!around_.empty()) name = nodes_[around_.back().second].name + '.' + name;
    around_.emplace_back(indent, nodes_.size());
    nodes_.push_back({std::move(name), {}, number_});
    value(without_tag(trim(content.substr(colon + 1))));
  }

  /// An item belongs to the key above that is indented no more than its dash.
  void item(std::size_t indent, std::string_view content) {
    while (!around_.empty() && around_.back().first > indent) around_.pop_back();
    if (around_.empty()) fail("a list without a name");
    value(without_tag(content));
  }

  void value(std::string_view text) {
    if (text.empty()) return;
    if (text.front() == '[' || text.front() == '{') return flow(text);
    words().emplace_back(unquoted(text));
  }

  /// Of the key at hand.
  std::vector<std::string>& words() { return nodes_[around_.back().second].words; }

  /// Words within brackets, whose end may be on another line.
  void flow(std::string_view line) {
    std::size_t at = 0;
    while (at < line.size()) {
      const char c = line[at];
      if (c == '[' || c == '{') {
        if (open_++ == 0) opened_at_ = number_;
        ++at;
      } else if (c == ']' || c == '}') {
        if (open_ == 0) break;
        --open_;
        ++at;
      } else if (c == ' ' || c == '\t' || c == '\r' || c == ',') {
        ++at;
      } else {
        if (open_ == 0) break;
        const bool quoted = c == '"' || c == '\'';
        const std::size_t end = quoted ? line.find(c, at + 1) : line.find_first_of(" \t\r,[]{}", at);
        if (quoted && end == std::string_view::npos) fail("a quote is not closed");
        const std::size_t next = std::min(end, line.size()) + (quoted ? 1 : 0);
        words().emplace_back(unquoted(line.substr(at, next - at)));
        at = next;
      }
    }
    if (at < line.size()) fail("expected the end of the line behind the bracket");
  }

  /// Where the colon behind a key is; npos: there is none.
  [[nodiscard]] static std::size_t key_end(std::string_view content) {
    std::size_t from = 0;
    if (content.front() == '"' || content.front() == '\'') {
      from = content.find(content.front(), 1);
      if (from == std::string_view::npos) return from;
    }
    for (std::size_t at = content.find(':', from); at != std::string_view::npos;
         at = content.find(':', at + 1)) {
      if (at + 1 == content.size() || content[at + 1] == ' ' || content[at + 1] == '\t') return at;
    }
    return std::string_view::npos;
  }

  const std::string& file_;
  std::size_t number_ = 0;                                   // of the line
  std::size_t open_ = 0, opened_at_ = 0;                     // brackets, line of the first
  std::vector<std::pair<std::size_t, std::size_t>> around_;  // indentation and node of the keys around
  std::vector<NamedWords> nodes_;
};

class XmlReader {
 public:
  XmlReader(const std::string& text, const std::string& file) : text_(text), file_(file) {}

  std::vector<NamedWords> read() {
    while (at_ < text_.size()) {
      if (text_[at_] != '<') {
        words(until("<", false));
      } else if (text_.compare(at_, 4, "<!--") == 0) {
        (void)until("-->", true);
      } else if (text_.compare(at_, 2, "<?") == 0) {
        (void)until("?>", true);
      } else {
        tag(until(">", true));
      }
    }
    if (!around_.empty()) fail(fmt::format("<{}> is not closed", around_.back().first));
    return std::move(nodes_);
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw InputError(file_, line_, reason); }

  /// The text up to a mark, which is read over where it has to be there.
  std::string_view until(std::string_view mark, bool needed) {
    const std::size_t end = text_.find(mark, at_);
    if (needed && end == std::string::npos) fail(fmt::format("'{}' is missing behind this", mark));
    const std::size_t next = needed ? end + mark.size() : std::min(end, text_.size());
    const std::string_view part(text_.data() + at_, next - at_);
    line_ += static_cast<std::size_t>(std::count(part.begin(), part.end(), '\n'));
    at_ = next;
    return part;
  }

  void tag(std::string_view whole) {
    std::string_view inner = trim(whole.substr(1, whole.size() - 2));
    if (inner.starts_with('/')) {
      if (around_.empty() || around_.back().first != trim(inner.substr(1)))
        fail(fmt::format("<{}> closes what is not open", inner));
      around_.pop_back();
      return;
    }
    const bool closed = inner.ends_with('/');
    if (closed) inner.remove_suffix(1);
    const std::string name(inner.substr(0, inner.find_first_of(" \t\r\n")));
    if (name.empty()) fail("a tag without a name");
    if (closed) return;
    if (around_.size() == kDeepestCalibration) fail("is nested too deep for a calibration");
    // Items of a sequence, <_>, are words of what is around them.
    const bool top = around_.size() < 2, is_item = name == "_" && around_.size() > 1;
    const std::size_t node = is_item ? around_.back().second : nodes_.size();
    if (!is_item && !around_.empty())
      nodes_.push_back({top ? name : nodes_[around_.back().second].name + '.' + name, {}, line_});
    around_.emplace_back(name, node);
  }

  void words(std::string_view text) {
    if (around_.size() < 2) return;  // blanks around everything
    std::istringstream in{std::string(text)};
    for (std::string word; in >> word;) nodes_[around_.back().second].words.emplace_back(unquoted(word));
  }

  const std::string &text_, &file_;
  std::size_t at_ = 0, line_ = 1;
  std::vector<std::pair<std::string, std::size_t>> around_;  // open tags and their nodes
  std::vector<NamedWords> nodes_;
};

}  // namespace

std::vector<NamedWords> parse_yaml(const std::string& text, const std::string& file) {
  return YamlReader(file).read(text);
}

std::vector<NamedWords> parse_xml(const std::string& text, const std::string& file) {
  return XmlReader(text, file).read();
}

}  // namespace dynslam::runtime
