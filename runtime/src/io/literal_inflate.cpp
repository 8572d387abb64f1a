// SPDX-License-Identifier: BSD-3-Clause
#include "io/literal_inflate.hpp"

#include <libdeflate.h>

#include <algorithm>
#include <bit>
#include <cstring>

namespace dynslam::runtime {
namespace {

constexpr int kEndOfBlock = 256;

// An entry of the table: bits that are used, from bit 6 on the number of literals, from bit 16 on up to six
// of them. Without a literal, what is meant instead.
constexpr int kCountAt = 6, kLiteralsAt = 16, kSlotAt = 32, kMostLiterals = 6;
constexpr std::uint64_t kUsed = 63, kCount = 7;
enum Special : std::uint64_t { kEnd, kLongCode, kUnknown };

constexpr std::uint64_t literal_entry(std::uint64_t literal, int bits) {
  return static_cast<std::uint64_t>(bits) | std::uint64_t{1} << kCountAt | literal << kLiteralsAt;
}
/// @param slot  of a long code: number of its first bits
constexpr std::uint64_t special_entry(Special what, int bits, std::uint64_t slot = 0) {
  return static_cast<std::uint64_t>(bits) | static_cast<std::uint64_t>(what) << kLiteralsAt | slot << kSlotAt;
}
constexpr int used(std::uint64_t entry) {
  return static_cast<int>(entry & kUsed);
}
constexpr std::size_t literals(std::uint64_t entry) {
  return entry >> kCountAt & kCount;
}

}  // namespace

/// The stream's bits, the first one lowest.
class LiteralInflater::Bits {
 public:
  explicit Bits(std::span<const std::uint8_t> bytes) : next_(bytes.data()), end_(next_ + bytes.size()) {}

  /// Whether fill() takes its fast way.
  [[nodiscard]] bool has_words() const { return end_ - next_ >= 8; }
  /// Makes at least 56 bits ready.
  void fill_word() {
    std::uint64_t word;
    std::memcpy(&word, next_, sizeof(word));
    ready_ |= word << count_;
    next_ += (63 - count_) >> 3;
    count_ |= 56;
  }
  /// The same; behind the stream they are 0.
  void fill() {
    if (has_words()) return fill_word();
    for (; count_ <= 56 && next_ < end_; count_ += 8) ready_ |= std::uint64_t{*next_++} << count_;
  }
  [[nodiscard]] std::uint64_t ready() const { return ready_; }
  void use(int n) {
    ready_ >>= n;
    count_ -= n;
  }
  /// Takes n bits that are ready.
  int take(int n) {
    const int value = static_cast<int>(ready_ & ((std::uint64_t{1} << n) - 1));
    use(n);
    return value;
  }
  /// Whether more was used than there was.
  [[nodiscard]] bool overdrawn() const { return count_ < 0; }
  /// The next whole byte of the stream that was not begun.
  [[nodiscard]] const std::uint8_t* rest() const { return next_ - count_ / 8; }
  [[nodiscard]] const std::uint8_t* end() const { return end_; }

 private:
  const std::uint8_t *next_, *end_;
  std::uint64_t ready_ = 0;
  int count_ = 0;
};

namespace {

/// Whether codes of these lengths use up all there are.
bool complete(std::span<const std::uint8_t> lengths) {
  int sum = 0;
  for (const std::uint8_t n : lengths) sum += n > 0 ? 1 << (15 - n) : 0;
  return sum == 1 << 15;
}

/// Calls f(symbol, length, code) for each code, by length and then by symbol; a code's first bit is lowest.
template <class F>
void for_codes(std::span<const std::uint8_t> lengths, const F& f) {
  std::array<int, 17> at{};
  for (const std::uint8_t n : lengths) ++at[n + std::size_t{1}];
  at[1] = 0;  // what has no code
  for (std::size_t n = 1; n < at.size(); ++n) at[n] += at[n - 1];
  std::array<std::uint16_t, 320> sorted;
  for (std::size_t s = 0; s < lengths.size(); ++s) {
    if (lengths[s] > 0) sorted[static_cast<std::size_t>(at[lengths[s]]++)] = static_cast<std::uint16_t>(s);
  }
  const auto codes = static_cast<std::size_t>(at[15]);
  unsigned code = 0;
  for (std::size_t i = 0; i < codes; ++i) {
    const int n = lengths[sorted[i]];
    f(static_cast<int>(sorted[i]), n, code);
    unsigned bit = 1U << (n - 1);
    while ((code & bit) != 0) bit >>= 1;
    code = (code & (bit - 1)) | bit;  // the next one: 1 is added from its last bit on
  }
}

}  // namespace

/// The lengths of `count` codes, themselves packed.
bool LiteralInflater::read_lengths(Bits& bits, int count) {
  constexpr std::array<std::uint8_t, 19> kOrder{16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                11, 4,  12, 3, 13, 2, 14, 1, 15};
  std::array<std::uint8_t, 19> of_lengths{};
  const int n = bits.take(4) + 4;
  for (int i = 0; i < n; ++i) {
    if (i % 16 == 0) bits.fill();
    of_lengths[kOrder[static_cast<std::size_t>(i)]] = static_cast<std::uint8_t>(bits.take(3));
  }
  if (!complete(of_lengths)) return false;
  std::array<std::uint8_t, 128> table;  // symbol and length
  for_codes(of_lengths, [&](int symbol, int length, unsigned code) {
    for (unsigned i = code; i < 128; i += 1U << length)
      table[i] = static_cast<std::uint8_t>(symbol << 3 | length);
  });
  for (int i = 0; i < count;) {
    bits.fill();
    const std::uint8_t entry = table[bits.ready() & 127];
    bits.use(entry & 7);
    const int symbol = entry >> 3;
    auto* to = lengths_.data() + i;
    if (symbol < 16) {
      *to = static_cast<std::uint8_t>(symbol);
      ++i;
      continue;
    }
    if (symbol == 16 && i == 0) return false;
    const std::uint8_t value = symbol == 16 ? to[-1] : 0;
    const int repeat = symbol == 16 ? 3 + bits.take(2) : symbol == 17 ? 3 + bits.take(3) : 11 + bits.take(7);
    std::fill_n(to, repeat, value);
    i += repeat;
    if (i > count) return false;
  }
  return !bits.overdrawn();
}

/// The codes of a block, behind its kind.
bool LiteralInflater::read_codes(Bits& bits) {
  const int symbols = bits.take(5) + 257, distances = bits.take(5) + 1;
  if (symbols > 286 || !read_lengths(bits, symbols + distances)) return false;
  const std::span<const std::uint8_t> lengths(lengths_);
  if (!complete(lengths.subspan(static_cast<std::size_t>(symbols), static_cast<std::size_t>(distances))))
    return false;
  return make_table(symbols);
}

bool LiteralInflater::make_table(int symbols) {
  const std::span<const std::uint8_t> lengths(lengths_.data(), static_cast<std::size_t>(symbols));
  if (!complete(lengths)) return false;
  std::uint64_t slots = 0;
  unsigned last_prefix = 0;
  for_codes(lengths, [&](int symbol, int length, unsigned code) {
    if (length <= kLookBits) {
      const std::uint64_t entry = symbol < kEndOfBlock
                                      ? literal_entry(static_cast<std::uint64_t>(symbol), length)
                                  : symbol == kEndOfBlock ? special_entry(kEnd, length)
                                                          : special_entry(kUnknown, length);
      for (std::size_t i = code; i < table_.size(); i += std::size_t{1} << length) table_[i] = entry;
      return;
    }
    // Codes with the same first bits follow each other.
    const unsigned prefix = code & ((1U << kLookBits) - 1);
    if (slots == 0 || prefix != last_prefix) table_[prefix] = special_entry(kLongCode, kLookBits, slots++);
    last_prefix = prefix;
    auto* rest = long_.data() + ((slots - 1) << kLongBits);
    const int more = length - kLookBits;
    for (unsigned i = code >> kLookBits; i < 1U << kLongBits; i += 1U << more)
      rest[i] = static_cast<std::uint16_t>(symbol << 4 | more);
  });
  join_literals();
  if (std::ranges::find(lengths, 1) != lengths.end()) join_literals();  // many fit into a look
  return true;
}

/// Has entries that are literals tell of those behind them, as far as their bits are known.
void LiteralInflater::join_literals() {
  for (std::size_t i = table_.size(); i-- > 0;) {  // what is asked for stands before, and was not joined yet
    const std::uint64_t entry = table_[i], next = table_[i >> used(entry)];
    const std::size_t n = literals(entry), more = literals(next);
    const int bits = used(entry) + used(next);
    const bool joins = (n != 0) & (more != 0) & (bits <= kLookBits) & (n + more <= kMostLiterals);
    const std::uint64_t both = entry >> kLiteralsAt | next >> kLiteralsAt << (8 * n);
    const std::uint64_t joined =
        static_cast<std::uint64_t>(bits) | (n + more) << kCountAt | both << kLiteralsAt;
    table_[i] = entry ^ ((entry ^ joined) & (std::uint64_t{0} - joins));  // no branch, which nobody foresees
  }
}

std::uint64_t LiteralInflater::look(const Bits& bits) const {
  return table_[bits.ready() & (table_.size() - 1)];
}

/// What one look tells of, near the end of the stream or of `out`, too.
LiteralInflater::Step LiteralInflater::read_literals(Bits& bits, std::uint8_t*& out,
                                                     const std::uint8_t* end) const {
  bits.fill();
  const std::uint64_t entry = look(bits);
  bits.use(used(entry));
  std::uint64_t bytes = entry >> kLiteralsAt;
  std::size_t n = literals(entry);
  if (n == 0) {
    if (bytes % 4 == kEnd) return bits.overdrawn() ? Step::unknown : Step::end;
    if (bytes % 4 == kUnknown) return Step::unknown;
    const auto rest = long_[(entry >> kSlotAt << kLongBits) + (bits.ready() & ((1U << kLongBits) - 1))];
    bits.use(rest & 15);
    const int symbol = rest >> 4;
    if (symbol == kEndOfBlock) return bits.overdrawn() ? Step::unknown : Step::end;
    if (symbol > kEndOfBlock) return Step::unknown;
    bytes = static_cast<std::uint64_t>(symbol);
    n = 1;
  }
  if (bits.overdrawn() || n > static_cast<std::size_t>(end - out)) return Step::unknown;
  for (; n > 0; --n, bytes >>= 8) *out++ = static_cast<std::uint8_t>(bytes);
  return Step::literals;
}

/// A block of literals.
/// @param to   out: where they go; then behind them
/// @param end  of what may be written
/// @return whether it came to its end
bool LiteralInflater::read_block(Bits& stream, std::uint8_t*& to, const std::uint8_t* end) const {
  constexpr int kLooks = 5;  // into the 56 bits that are ready
  static_assert(kLooks * kLookBits <= 56);
  Bits bits = stream;  // what bytes are written cannot change, and registers hold
  std::uint8_t* out = to;
  for (;;) {
    if (bits.has_words() && end - out >= kLooks * kMostLiterals + 8) {
      bits.fill_word();
      int looks = 0;
      do {
        const std::uint64_t entry = look(bits), bytes = entry >> kLiteralsAt;
        if (literals(entry) == 0) break;
        std::memcpy(out, &bytes, sizeof(bytes));
        out += literals(entry);
        bits.use(used(entry));
      } while (++looks < kLooks);
      if (looks == kLooks) continue;
    }
    const Step step = read_literals(bits, out, end);
    if (step == Step::literals) continue;
    stream = bits;
    to = out;
    return step == Step::end;
  }
}

bool LiteralInflater::decompress(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) {
  constexpr std::size_t kHeader = 2, kCheckSum = 4;
  constexpr int kDynamicCodes = 2;
  if constexpr (std::endian::native != std::endian::little) return false;
  if (packed.size() < kHeader + kCheckSum) return false;
  const bool plain = (packed[0] & 15) == 8 && packed[0] >> 4 <= 7 && (packed[1] & 32) == 0 &&
                     (packed[0] << 8 | packed[1]) % 31 == 0;
  if (!plain) return false;
  Bits bits(packed.subspan(kHeader, packed.size() - kHeader - kCheckSum));
  std::uint8_t* to = out.data();
  const std::uint8_t* end = to + out.size();
  for (bool last = false; !last;) {
    bits.fill();
    last = bits.take(1) != 0;
    if (bits.take(2) != kDynamicCodes || !read_codes(bits) || !read_block(bits, to, end)) return false;
  }
  if (to != end) return false;
  const std::uint8_t* sum = bits.rest();
  const std::uint32_t expected = std::uint32_t{sum[0]} << 24 | std::uint32_t{sum[1]} << 16 |
                                 std::uint32_t{sum[2]} << 8 | std::uint32_t{sum[3]};
  return libdeflate_adler32(1, out.data(), out.size()) == expected;
}

}  // namespace dynslam::runtime
