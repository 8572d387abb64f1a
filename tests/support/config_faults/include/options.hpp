// SPDX-License-Identifier: BSD-3-Clause
// Planted faults for package.config_fields_finds_faults.
#pragma once

template <class S>
struct Inner {
  S kept = S(1) / S(2), second = S(3);   ///< the second one is in no table
  std::array<double, 2> pair{1.0, 2.0};  ///< listed
  [[nodiscard]] S sum() const { return kept + second; }
};

struct Base {
  int bits = 1 << 4;  ///< listed, but the derived struct does not have it
};

struct Outer : Base {
  Inner<float> inner{.kept = 1};
  double near = 1,
         far = 2;  ///< named `distance` in the table
  std::vector<std::string>
      names;  ///< in no table
  bool derived = false;
};
