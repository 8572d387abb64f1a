// SPDX-License-Identifier: BSD-3-Clause
#include "io/map_sum.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <streambuf>
#include <string_view>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "io/check_sum.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::string_view kSumMagic = "\ncheck:\n";
constexpr std::size_t kSumBytes = kSumMagic.size() + 8;

/// Hands bytes on and adds them up.
class SummedBuffer : public std::streambuf {
 public:
  explicit SummedBuffer(std::ostream& out) : out_(out) {}
  [[nodiscard]] std::uint64_t value() const { return sum_.value(); }

 protected:
  std::streamsize xsputn(const char* bytes, std::streamsize count) override {
    sum_.add({bytes, static_cast<std::size_t>(count)});
    out_.write(bytes, count);
    return out_ ? count : 0;
  }
  int_type overflow(int_type c) override {
    if (traits_type::eq_int_type(c, traits_type::eof())) return traits_type::not_eof(c);
    const char byte = traits_type::to_char_type(c);
    return xsputn(&byte, 1) == 1 ? c : traits_type::eof();
  }

 private:
  std::ostream& out_;
  CheckSum sum_;
};

/// The least significant byte first, on every machine.
std::array<char, 8> bytes_of(std::uint64_t value) {
  std::array<char, 8> bytes{};
  for (char& byte : bytes) {
    byte = static_cast<char>(value & 0xFFU);
    value >>= 8U;
  }
  return bytes;
}

}  // namespace

void write_summed(std::ostream& out, const std::function<void(std::ostream&)>& write) {
  SummedBuffer buffer(out);
  std::ostream summed(&buffer);
  write(summed);
  const std::array<char, 8> sum = bytes_of(buffer.value());
  out.write(kSumMagic.data(), static_cast<std::streamsize>(kSumMagic.size()));
  out.write(sum.data(), sum.size());
}

std::size_t check_sum_of(std::istream& in, const std::filesystem::path& path) {
  in.seekg(0, std::ios::end);
  const std::streamoff size = in.tellg();
  std::array<char, kSumBytes> end{};
  const auto rewound = [&](std::size_t length) {
    in.clear();
    in.seekg(0);
    return length;
  };
  if (size < static_cast<std::streamoff>(kSumBytes)) return rewound(0);
  in.seekg(size - static_cast<std::streamoff>(kSumBytes));
  in.read(end.data(), kSumBytes);
  if (!in || std::string_view(end.data(), kSumMagic.size()) != kSumMagic) return rewound(0);
  in.seekg(0);
  CheckSum sum;
  std::vector<char> block(std::size_t(1) << 16U);
  for (std::streamoff left = size - static_cast<std::streamoff>(kSumBytes); left > 0 && in;) {
    in.read(block.data(), std::min<std::streamoff>(left, static_cast<std::streamoff>(block.size())));
    sum.add({block.data(), static_cast<std::size_t>(in.gcount())});
    left -= in.gcount();
  }
  if (!in) throw InputError(path.string(), 0, "cannot be read");
  const std::array<char, 8> expected = bytes_of(sum.value());
  if (std::memcmp(expected.data(), end.data() + kSumMagic.size(), expected.size()) != 0)
    throw InputError(path.string(), 0, "is corrupt: its check sum differs");
  return rewound(kSumBytes);
}

}  // namespace dynslam::runtime
