// SPDX-License-Identifier: BSD-3-Clause
#include "io/run_lengths.hpp"

#include <algorithm>
#include <cstddef>

namespace dynslam::runtime {

std::vector<std::uint8_t> encode_runs(const cv::Mat& values) {
  std::vector<std::uint8_t> runs;
  std::uint64_t length = 0;
  std::uint8_t value = 0;
  const auto end_run = [&] {
    std::uint64_t number = length << 3U | (value & 7U);
    for (; length > 0 && number >= 128; number >>= 7U)
      runs.push_back(static_cast<std::uint8_t>(number | 128U));
    if (length > 0) runs.push_back(static_cast<std::uint8_t>(number));
    length = 0;
  };
  for (int v = 0; v < values.rows; ++v) {
    const auto* row = values.ptr<std::uint8_t>(v);
    for (int u = 0; u < values.cols; ++u) {
      if (row[u] != value) {
        end_run();
        value = row[u];
      }
      ++length;
    }
  }
  end_run();
  return runs;
}

std::optional<cv::Mat> decode_runs(std::span<const std::uint8_t> runs, cv::Size size) {
  cv::Mat values(size, CV_8UC1);
  const std::size_t total = values.total();
  std::size_t filled = 0;
  for (std::size_t i = 0; i < runs.size();) {
    std::uint64_t number = 0;
    for (unsigned shift = 0;; shift += 7) {
      if (i == runs.size() || shift > 56) return std::nullopt;
      number |= std::uint64_t(runs[i] & 127U) << shift;
      if (runs[i++] < 128) break;
    }
    const std::uint64_t length = number >> 3U;
    if (length == 0 || length > total - filled) return std::nullopt;
    std::fill_n(values.data + filled, length, static_cast<std::uint8_t>(number & 7U));
    filled += length;
  }
  if (filled != total) return std::nullopt;
  return values;
}

}  // namespace dynslam::runtime
