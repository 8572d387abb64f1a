// SPDX-License-Identifier: BSD-3-Clause
// Files of fields, written and read.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <istream>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "config/toml_entries.hpp"
#include "dynslam/runtime/config/options_file.hpp"
#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {
namespace {

/// Fields of earlier versions, and why they are no more: files of earlier runs name every field.
struct RemovedField {
  std::string_view name, reason;
};
constexpr std::string_view kBelief = "one belief of motion took its place, see [tracker.geometry.belief]";
constexpr std::string_view kMargin = "masks have a margin instead, see [tracker.geometry] margin";
constexpr std::string_view kPlanes = "regions enter no floor, wall or table, see [tracker.geometry.belief.supports]";
constexpr std::string_view kUnmissed = "no sequence was worse without it";
constexpr std::array kRemoved{
    RemovedField{"tracker.behind_mover", kUnmissed},
    RemovedField{"tracker.search.fallen_inliers", kUnmissed},
    RemovedField{"tracker.search.usual_decay", kUnmissed},
    RemovedField{"tracker.search.aside", kUnmissed},
    RemovedField{"tracker.geometry.growing.reach", kPlanes},
    RemovedField{"tracker.geometry.regions.rim", kPlanes},
    RemovedField{"tracker.geometry.growing.whole", kBelief},
    RemovedField{"tracker.geometry.growing.was", kBelief},
    RemovedField{"tracker.geometry.growing.still", kBelief},
    RemovedField{"tracker.vanished_piece", "a mask that is gone for a frame does no harm since movers are beliefs"},
    RemovedField{"tracker.search.behind", "what lies behind is followed where most of it contradicts the pose"},
};
/// The same of whole tables.
constexpr std::array kRemovedTables{
    RemovedField{"tracker.geometry.free_space", kBelief},
    RemovedField{"tracker.geometry.free_space.margins", kBelief},
    RemovedField{"tracker.geometry.keypoint_seeds", kBelief},
    RemovedField{"tracker.geometry.outlines", kBelief},
    RemovedField{"tracker.resting", "what is static is found for each surface, see [tracker.geometry.belief]"},
    RemovedField{"tracker.geometry.delay", kMargin},
    RemovedField{"tracker.geometry.delay.edge", kMargin},
};

auto removed_table(std::string_view name) {
  return std::ranges::find(kRemovedTables, name, &RemovedField::name);
}

/// ", did you mean NAME?", or nothing.
std::string hint(const std::string& name) {
  return name.empty() ? name : ", did you mean " + name + "?";
}

std::vector<std::string> tables_of(const ConfigFields& fields) {
  std::vector<std::string> tables;
  for (const ConfigField& field : fields) {
    if (std::find(tables.begin(), tables.end(), field.table) == tables.end()) tables.push_back(field.table);
  }
  return tables;
}

/// What is meant by a key that its table does not have: one of the table's, or the same name elsewhere.
std::string nearest_key(const ConfigFields& fields, const std::string& table, const std::string& key) {
  std::vector<std::string> here;
  for (const ConfigField& field : fields) {
    if (field.table == table) here.push_back(field.key);
  }
  if (std::string name = nearest_name(key, here); !name.empty()) return name;
  for (const ConfigField& field : fields) {
    if (field.key == key) return field.key + " of [" + field.table + "]";
  }
  return {};
}

/// A file being read.
class ConfigReader {
 public:
  ConfigReader(const std::string& file, ConfigFields& fields, const ConfigSections& others)
      : file_(file), fields_(fields), others_(others), tables_(tables_of(fields)) {}

  void read(const TomlEntry& entry) {
    number_ = entry.line;
    if (entry.value == nullptr) return begin(entry.table);
    if (removed_table(entry.table) != kRemovedTables.end()) return;
    if (is_of_fields(entry.table)) return set(entry);
    if (!others_.take) fail(fmt::format("'{}' stands in no table", entry.key));
    if (const std::string reason = others_.take(entry.table, entry.key, toml_word(*entry.value), entry.line);
        !reason.empty())
      fail(reason);
  }
  [[nodiscard]] std::vector<std::string> take_notes() { return std::move(notes_); }

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw InputError(file_, number_, reason); }

  void note_removed(const std::string& what, std::string_view reason) {
    notes_.push_back(fmt::format("{}:{}: {} has no effect any more: {}", file_, number_, what, reason));
  }

  /// Or of tables that have fields.
  bool is_of_fields(const std::string& name) const {
    return std::ranges::any_of(tables_,
                               [&](const std::string& t) { return t == name || t.starts_with(name + '.'); });
  }

  void begin(const std::string& name) {
    if (const auto removed = removed_table(name); removed != kRemovedTables.end())
      return note_removed('[' + name + ']', removed->reason);
    if (is_of_fields(name) || std::ranges::find(others_.names, name) != others_.names.end()) return;
    std::vector<std::string> known = tables_;
    known.insert(known.end(), others_.names.begin(), others_.names.end());
    std::string near = nearest_name(name, known);
    for (const std::string& table : tables_) {  // or its last name alone
      if (near.empty() && table.ends_with('.' + name)) near = table;
    }
    fail(fmt::format("unknown table [{}]{}", name, hint(near.empty() ? near : '[' + near + ']')));
  }

  void set(const TomlEntry& entry) {
    const std::string name = entry.table + '.' + entry.key;
    const auto field = std::ranges::find(fields_, name, &ConfigField::name);
    if (field == fields_.end()) {
      const auto removed = std::ranges::find(kRemoved, std::string_view(name), &RemovedField::name);
      if (removed != kRemoved.end()) return note_removed(name, removed->reason);
      fail(fmt::format("unknown key '{}' in [{}]{}", entry.key, entry.table,
                       hint(nearest_key(fields_, entry.table, entry.key))));
    }
    if (const std::string reason = set_config(*field, *entry.value); !reason.empty())
      fail(fmt::format("{}: {}", name, reason));
  }

  const std::string& file_;
  ConfigFields& fields_;
  const ConfigSections& others_;
  std::vector<std::string> tables_;
  std::vector<std::string> notes_;
  std::size_t number_ = 0;
};

/// "# meaning [unit], 0 to 1", in lines of readable length.
std::string comment(const ConfigField& field) {
  std::string text = field.meaning;
  if (!field.unit.empty()) text += " [" + field.unit + "]";
  if (const auto* choice = std::get_if<ConfigChoice>(&field.value))
    text += fmt::format(" ({})", fmt::join(choice->names, ", "));
  if (const std::string range = field.range.text(); !range.empty()) text += " (" + range + ")";
  constexpr std::size_t kLongestLine = 100;
  std::string result;
  while (text.size() > kLongestLine) {
    const auto cut = text.rfind(' ', kLongestLine);
    if (cut == std::string::npos) break;
    result += "# " + text.substr(0, cut) + '\n';
    text.erase(0, cut + 1);
  }
  return result + "# " + text + '\n';
}

/// "tracker.search.min_inliers = 25"
std::string line_of(const ConfigField& field) {
  return field.name() + " = " + config_text(field);
}

/// The tables that have fields of either kind: those of the first, then those of the second as tuning fields.
template <class First, class Second>
std::string tables_text(const ConfigFields& fields, First first, Second second) {
  std::string text;
  for (const std::string& table : tables_of(fields)) {
    std::string own, tuned;
    for (const ConfigField& field : fields) {
      if (field.table != table) continue;
      const auto lines = [&] {
        return fmt::format("{}{} = {}\n", comment(field), field.key, config_text(field));
      };
      if (first(field)) own += lines();
      if (second(field)) tuned += lines();
    }
    if (own.empty() && tuned.empty()) continue;
    text += fmt::format("\n[{}]\n{}", table, own);
    if (!tuned.empty()) text += "# -- tuning fields that differ from their defaults: no promise\n" + tuned;
  }
  return text;
}

}  // namespace

std::string config_file(const ConfigFields& fields) {
  RunOptions options;
  std::optional<DynamicsMode> dynamics;
  std::set<std::string> defaults;
  for (const ConfigField& field : config_fields(options, dynamics)) defaults.insert(line_of(field));
  return "# dynslam " DYNSLAM_VERSION
         ": dynslam run SEQUENCE --config FILE reads this file; what it does not name has its default\n" +
         tables_text(
             fields, [](const ConfigField& field) { return !field.tuning; },
             [&](const ConfigField& field) { return field.tuning && !defaults.contains(line_of(field)); });
}

std::string tuning_file(const ConfigFields& fields) {
  return "# dynslam " DYNSLAM_VERSION
         ", tuning fields: thresholds of its parts, for experiments.\n"
         "# They are no promise: any version may change, rename or remove them.\n" +
         tables_text(
             fields, [](const ConfigField& field) { return field.tuning; },
             [](const ConfigField&) { return false; });
}

std::string config_file(const RunOptions& options) {
  RunOptions copy = options;
  std::optional<DynamicsMode> dynamics = options.dynamics;
  return config_file(config_fields(copy, dynamics));
}

std::vector<std::string> read_config(std::istream& in, const std::string& file, ConfigFields& fields,
                                     const ConfigSections& others) {
  ConfigReader reader(file, fields, others);
  std::string text;
  for (std::string line; std::getline(in, line);) text += line + '\n';
  if (in.bad()) throw InputError(file, 0, "cannot be read");
  for (const TomlFile toml = read_toml(std::move(text), file); const TomlEntry& entry : toml.entries)
    reader.read(entry);
  return reader.take_notes();
}

}  // namespace dynslam::runtime
