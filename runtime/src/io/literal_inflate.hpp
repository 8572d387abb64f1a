// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace dynslam::runtime {

/// Decompresses zlib streams without matches (Z_HUFFMAN_ONLY), as the PNG files of recorders have them that
/// must keep up with a camera, the TUM benchmark's among them. Several literals are looked up at once: of
/// depth images half a dozen, whose codes together are shorter than the bits of one look.
///
/// Made for speed where it fits, not to judge files: whatever it does not know or finds faulty it leaves to a
/// full inflater. Other streams have their first match soon; only what has it late is read twice.
class LiteralInflater {
 public:
  /// @param packed  the stream with its header and check sum; what follows is not looked at
  /// @param out     out: exactly as many bytes as the stream holds
  /// @return whether `out` holds what was packed, by the check sum of the stream, too. If not, it may hold
  ///         anything, and the stream may nevertheless be a good one.
  [[nodiscard]] bool decompress(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out);

 private:
  // More bits tell of more literals, and of each block a larger table has to be made.
  static constexpr int kLookBits = 10, kLongestCode = 15, kLongBits = kLongestCode - kLookBits;
  static constexpr std::size_t kSymbols = 288, kLengths = 320, kLongestRepetition = 138;
  class Bits;
  enum class Step : std::uint8_t { literals, end, unknown };

  bool read_codes(Bits& bits);
  bool read_lengths(Bits& bits, int count);
  bool make_table(int symbols);
  void join_literals();
  [[nodiscard]] std::uint64_t look(const Bits& bits) const;
  Step read_literals(Bits& bits, std::uint8_t*& out, const std::uint8_t* end) const;
  bool read_block(Bits& stream, std::uint8_t*& to, const std::uint8_t* end) const;

  std::array<std::uint8_t, kLengths + kLongestRepetition> lengths_{};  // of codes; with room for faulty ones
  // By the next bits of the stream: how many of them are used, how many literals they are, and these.
  std::array<std::uint64_t, std::size_t{1} << kLookBits> table_{};
  // Of longer codes, by the number of their first bits and the rest: symbol and length of the rest.
  std::array<std::uint16_t, kSymbols << kLongBits> long_{};
};

}  // namespace dynslam::runtime
