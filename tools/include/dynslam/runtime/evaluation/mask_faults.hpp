// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string_view>

#include "dynslam/runtime/io/sequence.hpp"

namespace dynslam::runtime {

/// What a segmenter may get wrong. The first four call a big static object a person, beside what the true
/// masks hold.
enum class MaskFault : std::uint8_t {
  object_always,
  object_third,       ///< in every third frame
  object_first_half,  ///< of the run
  object_second_half,
  cover,     ///< 90 % of the view, a strip at one side left
  mirrored,  ///< left and right exchanged
  late,      ///< by 5 frames
  shifted,   ///< by 40 pixels, of 640
  empty,
  blobs  ///< others in every frame
};
/// Names of MaskFault, in its order.
inline constexpr std::array<std::string_view, 10> kMaskFaultNames{"object-always",
                                                                  "object-third",
                                                                  "object-first-half",
                                                                  "object-second-half",
                                                                  "cover",
                                                                  "mirrored",
                                                                  "late",
                                                                  "shifted",
                                                                  "empty",
                                                                  "blobs"};
/// A fault by its name; empty: there is none of that name.
[[nodiscard]] std::optional<MaskFault> parse_mask_fault(std::string_view name);

/// Which masks are made, of what.
struct MaskFaultOptions {
  std::filesystem::path sequence;  ///< with ground truth: where the camera is says where the object is seen
  SequenceOptions reading;         ///< of the sequence, its camera's name included
  std::filesystem::path out;       ///< folder of `<time stamp>.png`, for `run --masks`
  MaskFault fault = MaskFault::object_always;
  std::uint64_t seed = 1;  ///< of the blobs
};

/// What write_mask_faults() did.
struct MaskFaultReport {
  std::size_t masks = 0;   ///< written
  std::size_t marked = 0;  ///< of them, those that mark anything
  std::size_t without_truth =
      0;                     ///< of them, those of a frame without a true mask, as if nothing moved there
  bool no_truth = false;     ///< true masks are part of the fault, and the sequence has no dynamic_mask/
  std::size_t replaced = 0;  ///< PNG files that the folder held under the same names
  std::size_t left = 0;      ///< and those of other names, which it still holds
};

/// Writes wrong masks for a sequence. The true ones are those of its dynamic_mask/, where it has it; where
/// not, the object's stand for them (mirrored, late, shifted). The object is what lies within a ball around
/// the middle of the view halfway through the sequence and fills a quarter of that view.
/// @throws InputError  no ground truth, a dynamic_mask/ without a mask of any frame, unreadable images, a
///         folder that cannot be made
MaskFaultReport write_mask_faults(const MaskFaultOptions& options,
                                  const std::function<void(std::size_t done, std::size_t total)>& progress);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
