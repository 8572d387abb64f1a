// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "report/payload.hpp"

namespace dynslam::runtime::reporting {
namespace {

namespace fs = std::filesystem;

fs::path place_of(const RunFolder& run) {
  std::error_code error;
  const fs::path place = fs::weakly_canonical(fs::absolute(run.options.sequence, error), error);
  return error ? run.options.sequence : place;
}

}  // namespace

Source open_source(std::vector<RunFolder> runs, const fs::path& sequence) {
  SequenceOptions reading = sequence_options(runs.front().options);
  for (const RunFolder& run : runs) {
    if (place_of(run) != place_of(runs.front()))
      throw InputError(run.folder.string(), 0,
                       "is a run of " + run.options.sequence.string() + ", " + runs.front().folder.string() +
                           " one of " + runs.front().options.sequence.string() +
                           ": a report is about one sequence");
    const std::size_t frames = run.options.max_frames;
    reading.max_frames = frames == 0 || reading.max_frames == 0 ? 0 : std::max(frames, reading.max_frames);
  }
  const fs::path root = sequence.empty() ? runs.front().options.sequence : sequence;
  if (!fs::exists(root))
    throw InputError(root.string(), 0, "is missing: say where the sequence of the run lies now (--sequence)");
  Source source;
  source.sequence = load_sequence(root, reading);
  source.camera = camera_of(source.sequence, runs.front().options.camera);
  source.runs = std::move(runs);
  if (source.sequence.frames.empty()) throw InputError(root.string(), 0, "holds no frames");
  source.t0 = source.sequence.frames.front().t_rgb;
  source.t1 = source.sequence.frames.back().t_rgb;
  const auto& truth = source.sequence.groundtruth;
  const auto& poses = truth.empty() ? source.runs.front().trajectory : truth;
  const auto first = std::min_element(poses.begin(), poses.end(), [&](const auto& a, const auto& b) {
    return std::abs(a.t - source.t0) < std::abs(b.t - source.t0);
  });
  source.R_first = first->T_w_c.so3();
  return source;
}

json number(double value, int decimals) {
  if (!std::isfinite(value)) return nullptr;
  const double scale = std::pow(10.0, decimals);
  const double rounded = std::round(value * scale) / scale;
  if (rounded == 0) return 0;
  return rounded;
}

std::size_t stride_for(std::size_t count, std::size_t most) {
  return std::max<std::size_t>(1, (count + most - 1) / most);
}

}  // namespace dynslam::runtime::reporting
