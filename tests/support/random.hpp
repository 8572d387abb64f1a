// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string_view>

#include <doctest/doctest.h>

namespace dynslam::test {

/// Random numbers for a test: the seed is the 64-bit FNV-1a hash of the test's name, so a test draws
/// the same numbers in every run and in every order, and two tests draw different ones.
///
/// The numbers do not come from the distributions of the standard library, whose sequences differ
/// between implementations, but from fixed formulas on std::mt19937_64, whose output the standard fixes.
class Rng {
 public:
  explicit Rng(std::string_view name) : seed_(hash(name)), engine_(seed_) {}

  /// The seed, for `INFO("seed ", rng.seed())` in the test itself.
  [[nodiscard]] std::uint64_t seed() const { return seed_; }

  /// Uniform in [low, high).
  double uniform(double low = 0.0, double high = 1.0) {
    const double unit = static_cast<double>(engine_() >> 11) * 0x1.0p-53;
    return low + (high - low) * unit;
  }

  /// Normal with the given mean and standard deviation (Marsaglia's polar method).
  double normal(double mean = 0.0, double sigma = 1.0) {
    double x = 0.0;
    double s = 0.0;
    do {
      x = uniform(-1.0, 1.0);
      const double y = uniform(-1.0, 1.0);
      s = x * x + y * y;
    } while (s >= 1.0 || s == 0.0);
    return mean + sigma * x * std::sqrt(-2.0 * std::log(s) / s);
  }

  /// Uniform integer in [low, high], both ends included. Requires low <= high.
  int integer(int low, int high) {
    const auto span = static_cast<double>(high) - static_cast<double>(low) + 1.0;
    const auto step = static_cast<std::int64_t>(uniform(0.0, span));
    return static_cast<int>(static_cast<std::int64_t>(low) + step);
  }

  /// True with probability `p`.
  bool chance(double p) { return uniform() < p; }

  /// The engine, for std::shuffle and the like.
  std::mt19937_64& engine() { return engine_; }

  [[nodiscard]] static constexpr std::uint64_t hash(std::string_view text) {
    std::uint64_t h = 14695981039346656037ULL;
    for (const char c : text) {
      h ^= static_cast<std::uint64_t>(static_cast<unsigned char>(c));
      h *= 1099511628211ULL;
    }
    return h;
  }

 private:
  std::uint64_t seed_;
  std::mt19937_64 engine_;
};

}  // namespace dynslam::test
