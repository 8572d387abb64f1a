// SPDX-License-Identifier: BSD-3-Clause
// The file of a sweep, and its jobs.
#include "dynslam/runtime/evaluation/sweep.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <utility>

#include "config/toml_entries.hpp"
#include "dynslam/runtime/config/options_file.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "dynslam/runtime/slam/dynamics_mode.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;
using Options = std::vector<std::pair<std::string, std::string>>;  // name, value
using Variant = std::pair<std::string, Options>;

constexpr std::string_view kVariants = "variants.";
constexpr std::size_t kMostJobs = 100000;

bool is_name(std::string_view text) {
  return !text.empty() && text.front() != '-' &&
         text.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") ==
             std::string_view::npos;
}

/// A value as a word of the command line; empty: it is a list or empty itself.
std::string word_of(const toml::node& value) {
  return value.is_array() ? std::string() : toml_word(value);
}

/// A sweep's file being read.
class SweepReader {
 public:
  SweepReader(const fs::path& file, std::string text) : file_(file.string()) {
    sweep_.name = file.stem().string();
    sweep_.folder = fs::absolute(file).parent_path();
    sweep_.text = std::move(text);
  }

  Sweep read() {
    const TomlFile toml = read_toml(sweep_.text, file_);
    for (const TomlEntry& entry : toml.entries) {
      number_ = entry.line;
      if (entry.value == nullptr) {
        begin(entry.table);
      } else {
        set(entry);
      }
    }
    number_ = 0;
    for (const char* key : {"sequences", "modes"}) {
      if (!toml.root.contains(key)) fail(fmt::format("{} is missing", key));
    }
    for (const auto& [name, options] : variants_) sweep_.variants.push_back(name);
    if (variants_.empty()) variants_.emplace_back();
    make_jobs();
    return std::move(sweep_);
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw InputError(file_, number_, reason); }

  void begin(const std::string& table) {
    if (table.starts_with(kVariants)) {
      const std::string name = table.substr(kVariants.size());
      if (!is_name(name)) fail(fmt::format("'{}' is no name for a variant: letters, digits, _ and -", name));
      variants_.emplace_back(name, Options());
    } else if (table != "options") {
      fail(fmt::format("unknown table [{}], expected [options] or [variants.NAME]", table));
    }
  }

  void set(const TomlEntry& entry) {
    const auto& [table, key, value, line] = entry;
    if (!table.empty()) return set_option(options_of(table), key, *value);
    if (key == "sequences") return set_sequences(*value);
    if (key == "modes") return set_modes(*value);
    if (key == "seeds") return set_seeds(*value);
    if (key != "out") {
      const std::string near = nearest_name(key, {"sequences", "modes", "seeds", "out"});
      fail(fmt::format("unknown key '{}'{}", key, near.empty() ? near : ", did you mean " + near + "?"));
    }
    sweep_.out = plain(word_of(*value), key);
    if (sweep_.out.empty()) fail("out: expected a folder");
  }

  Options& options_of(std::string_view table) {
    if (table == "options") return common_;
    return std::ranges::find(variants_, table.substr(kVariants.size()), &Variant::first)->second;
  }

  void set_option(Options& options, const std::string& key, const toml::node& value) {
    if (!is_name(key)) fail(fmt::format("'{}' is no option of run", key));
    for (const char* own : {"out", "dynamics", "seed", "live", "live-speed", "help", "view"}) {
      if (key == own) fail(fmt::format("{} is no option of a sweep's runs", key));
    }
    std::string word = plain(word_of(value), key);
    if (word.empty()) fail(fmt::format("{}: expected text, a number, true or false", key));
    options.emplace_back(key, std::move(word));
  }

  /// Jobs are lines of a list, and results cells of tables.
  std::string plain(std::string word, const std::string& key) const {
    if (has_control(word)) fail(fmt::format("{}: '{}' has a control character", key, printable(word)));
    return word;
  }

  const toml::array& list(const toml::node& value, const char* of) const {
    const toml::array* array = value.as_array();
    if (array == nullptr || array->empty()) fail(fmt::format("expected a list of {}", of));
    return *array;
  }

  void set_sequences(const toml::node& value) {
    for (const toml::node& one : list(value, "sequences")) {
      std::string path = plain(word_of(one), "sequences");
      const fs::path full = (sweep_.folder / path).lexically_normal();
      const std::string name = (full.has_filename() ? full : full.parent_path()).stem().string();
      if (path.empty() || name.empty()) fail("sequences: expected a list of folders or bags");
      if (path.front() == '-') fail(fmt::format("sequences: '{0}' reads as an option: write ./{0}", path));
      if (std::find(sweep_.sequences.begin(), sweep_.sequences.end(), name) != sweep_.sequences.end())
        fail(fmt::format("two sequences are called {}", name));
      sweep_.sequences.push_back(name);
      paths_.push_back(std::move(path));
    }
  }

  void set_modes(const toml::node& value) {
    for (const toml::node& one : list(value, "modes")) {
      const std::string mode = word_of(one);
      if (!parse_dynamics(mode))
        fail(fmt::format("modes: '{}' is none of none, semantic, geometric, both", mode));
      if (std::find(sweep_.modes.begin(), sweep_.modes.end(), mode) != sweep_.modes.end())
        fail(fmt::format("modes: {} is given twice", mode));
      sweep_.modes.push_back(mode);
    }
  }

  void set_seeds(const toml::node& value) {
    for (const toml::node& one : list(value, "seeds")) {
      const std::string digits = word_of(one);
      std::size_t seed = 0;
      const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), seed);
      if (digits.empty() || error != std::errc() || end != digits.data() + digits.size())
        fail(fmt::format("seeds: '{}' is no whole number", digits));
      if (std::find(seeds_.begin(), seeds_.end(), seed) != seeds_.end())
        fail(fmt::format("seeds: {} is given twice", digits));
      seeds_.emplace_back(seed);
    }
  }

  void make_jobs() {
    if (seeds_.empty()) seeds_.emplace_back();
    if (paths_.size() * variants_.size() * sweep_.modes.size() * seeds_.size() > kMostJobs)
      fail(fmt::format("makes more than {} jobs", kMostJobs));
    for (std::size_t s = 0; s < paths_.size(); ++s) {
      for (const auto& [variant, options] : variants_) {
        for (const std::string& mode : sweep_.modes) {
          for (const auto& seed : seeds_) add_job(s, variant, options, mode, seed);
        }
      }
    }
  }

  void add_job(std::size_t s, const std::string& variant, const Options& options, const std::string& mode,
               const std::optional<std::size_t>& seed) {
    SweepJob job;
    job.sequence = sweep_.sequences[s];
    job.path = paths_[s];
    job.variant = variant;
    job.mode = mode;
    job.seed = seed;
    job.name = job.sequence + (variant.empty() ? variant : '/' + variant) + '/' + mode;
    if (seed) job.name += fmt::format("/seed-{}", *seed);
    job.arguments = {"run", job.path, "--dynamics", mode};
    if (seed) job.arguments.insert(job.arguments.end(), {"--seed", std::to_string(*seed)});
    Options all = options;  // a variant's own before what all have
    for (const auto& common : common_) {
      if (std::none_of(all.begin(), all.end(), [&](const auto& o) { return o.first == common.first; }))
        all.push_back(common);
    }
    for (const auto& [name, value] : all) {
      job.arguments.push_back("--" + name);
      job.arguments.push_back(value);
    }
    sweep_.jobs.push_back(std::move(job));
  }

  std::string file_;
  Sweep sweep_;
  std::size_t number_ = 0;
  Options common_;
  std::vector<Variant> variants_;
  std::vector<std::string> paths_;
  std::vector<std::optional<std::size_t>> seeds_;
};

/// The files that the job's result depends on beside its options: what --config names.
nlohmann::json configuration(const SweepJob& job) {
  for (std::size_t i = 0; i + 1 < job.arguments.size(); ++i) {
    if (job.arguments[i] == "--config") return read_text(job.arguments[i + 1]);
  }
  return nullptr;
}

}  // namespace

Sweep read_sweep(const fs::path& file) {
  return SweepReader(file, read_text(file)).read();
}

nlohmann::json sweep_record(const SweepJob& job, const std::string& program, int exit_code) {
  return {{"job", job.name},
          {"arguments", job.arguments},
          {"configuration", configuration(job)},
          {"program", program},
          {"exit_code", exit_code}};
}

bool is_done(const SweepJob& job, const fs::path& out, const std::string& program) {
  const fs::path file = out / job.name / "job.json";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return false;
  const nlohmann::json record = nlohmann::json::parse(read_text(file), nullptr, false);
  return record == sweep_record(job, program, 0);
}

}  // namespace dynslam::runtime
