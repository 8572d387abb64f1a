// SPDX-License-Identifier: BSD-3-Clause
// Sources: numpy.lib.format (version 1 to 3); TIFF 6.0, section 2; OpenEXR file layout.
#include "io/depth_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <string_view>

#include "dynslam/runtime/error.hpp"
#include "io/byte_marker.hpp"

namespace dynslam::runtime {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::array<std::uint8_t, 6> kNpyStart{0x93, 'N', 'U', 'M', 'P', 'Y'};
constexpr std::array<std::uint8_t, 4> kLittleTiff{'I', 'I', 42, 0}, kBigTiff{'M', 'M', 0, 42};
constexpr std::array<std::uint8_t, 4> kExrStart{0x76, 0x2F, 0x31, 0x01};

/// An unsigned number of `length` bytes; 0 beyond the end.
std::uint32_t number_at(Bytes bytes, std::size_t at, std::size_t length, bool big = false) {
  if (at > bytes.size() || bytes.size() - at < length) return 0;
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < length; ++k)
    value |= std::uint32_t(bytes[at + k]) << (8 * (big ? length - 1 - k : k));
  return value;
}

/// The text after 'KEY': in the dictionary at the head of an array; empty: it is not there.
std::string_view entry(std::string_view head, std::string_view key) {
  const std::string quoted = fmt::format("'{}':", key);
  const std::size_t at = head.find(quoted);
  if (at == std::string_view::npos) return {};
  head.remove_prefix(at + quoted.size());
  const std::size_t start = head.find_first_not_of(' ');
  return start == std::string_view::npos ? std::string_view() : head.substr(start);
}

struct NpyType {
  std::string_view name;
  int type;
};
constexpr std::array<NpyType, 5> kNpyTypes{
    {{"|u1", CV_8UC1}, {"<u2", CV_16UC1}, {"<f2", CV_16FC1}, {"<f4", CV_32FC1}, {"<f8", CV_64FC1}}};

/// Height and width of "(480, 640)" or "(480, 640, 1)"; empty: another shape.
cv::Size npy_size(std::string_view shape) {
  std::array<int, 3> n{0, 0, 1};
  std::size_t count = 0;
  const std::size_t end = shape.find(')');
  if (shape.empty() || shape.front() != '(' || end == std::string_view::npos) return {};
  for (const char* at = shape.data() + 1; at < shape.data() + end;) {
    if (*at == ' ' || *at == ',') {
      ++at;
      continue;
    }
    int value = 0;
    const auto [behind, error] = std::from_chars(at, shape.data() + end, value);
    if (error != std::errc() || count == n.size()) return {};
    n[count++] = value;
    at = behind;
  }
  return count >= 2 && n[0] > 0 && n[1] > 0 && n[2] == 1 ? cv::Size(n[1], n[0]) : cv::Size();
}

void open_npy(Bytes bytes, DepthFile& file) {
  const std::size_t length_bytes = bytes.size() > 6 && bytes[6] >= 2 ? 4 : 2, at = 8 + length_bytes;
  const std::size_t length = number_at(bytes, 8, length_bytes);
  if (bytes.size() < at || bytes.size() - at < length) {
    file.fault = "is truncated";
    return;
  }
  const std::string_view head(reinterpret_cast<const char*>(bytes.data()) + at, length);
  const std::string_view descr = entry(head, "descr");
  const std::string_view type = descr.size() > 4 ? descr.substr(1, 3) : std::string_view();
  const auto known =
      std::find_if(kNpyTypes.begin(), kNpyTypes.end(), [&](const NpyType& t) { return t.name == type; });
  const std::string_view shape = entry(head, "shape");
  file.size = npy_size(shape);
  file.by_columns = entry(head, "fortran_order").starts_with("True");
  file.values_at = at + length;
  if (known == kNpyTypes.end()) {
    file.fault = fmt::format("holds numbers of type {}; depth is uint16, float16, float32 or float64",
                             descr.substr(0, descr.find(',')));
  } else if (file.size.empty()) {
    file.fault = fmt::format("has the shape {}, not that of one image (height, width)",
                             shape.substr(0, shape.find(')') + 1));
  } else {
    file.type = known->type;
    const std::size_t needed = std::size_t(file.size.width) * std::size_t(file.size.height);
    if ((bytes.size() - file.values_at) / CV_ELEM_SIZE(file.type) < needed) file.fault = "is truncated";
  }
}

/// The directory of a TIFF's first image.
class TiffDirectory {
 public:
  explicit TiffDirectory(Bytes bytes)
      : bytes_(bytes), big_(bytes[0] == 'M'), at_(number_at(bytes, 4, 4, big_)) {}

  /// How many numbers an entry has; 0: there is no such entry.
  [[nodiscard]] std::size_t count(std::uint32_t tag) const {
    const std::size_t entry = entry_of(tag);
    return entry == 0 ? 0 : number_at(bytes_, entry + 4, 4, big_);
  }
  /// Number k of an entry; `otherwise` where it has fewer.
  [[nodiscard]] std::uint32_t number(std::uint32_t tag, std::size_t k, std::uint32_t otherwise) const {
    if (k >= count(tag)) return otherwise;
    constexpr std::uint32_t kByte = 1, kShort = 3;
    const std::size_t entry = entry_of(tag);
    const std::uint32_t type = number_at(bytes_, entry + 2, 2, big_);
    const std::size_t size = type == kByte ? 1 : type == kShort ? 2 : 4;
    const std::size_t first = size * count(tag) <= 4 ? entry + 8 : number_at(bytes_, entry + 8, 4, big_);
    return number_at(bytes_, first + size * k, size, big_);
  }

 private:
  [[nodiscard]] std::size_t entry_of(std::uint32_t tag) const {
    constexpr std::size_t kEntry = 12;
    const std::size_t entries = number_at(bytes_, at_, 2, big_);
    for (std::size_t k = 0; k < entries; ++k) {
      const std::size_t entry = at_ + 2 + kEntry * k;
      if (number_at(bytes_, entry, 2, big_) == tag) return entry;
    }
    return 0;
  }

  Bytes bytes_;
  bool big_;
  std::size_t at_;
};

/// OpenCV says in lines of its own, without the file's name, what it does not decode.
void open_tiff(Bytes bytes, DepthFile& file) {
  constexpr std::uint32_t kWidth = 256, kHeight = 257, kBits = 258, kStrips = 273, kStripBytes = 279,
                          kFormat = 339;
  constexpr std::uint32_t kUnsigned = 1, kFloat = 3, kMostSide = 1U << 30;
  const TiffDirectory directory(bytes);
  file.size = {int(std::min(directory.number(kWidth, 0, 0), kMostSide)),
               int(std::min(directory.number(kHeight, 0, 0), kMostSide))};
  if (file.size.empty()) {
    file.fault = "is damaged: a TIFF without a size";
    return;
  }
  const std::uint32_t bits = directory.number(kBits, 0, 1), format = directory.number(kFormat, 0, kUnsigned);
  if (!(format == kUnsigned && bits <= 16) && !(format == kFloat && (bits == 32 || bits == 64))) {
    const std::string_view kind = format == kUnsigned ? "unsigned numbers"
                                  : format == kFloat  ? "floats"
                                                      : "signed numbers";
    file.fault = fmt::format(
        "has {} of {} bits: TIFF is read with unsigned numbers of at most 16 bits and floats of 32 or 64",
        kind, bits);
    return;
  }
  for (std::size_t k = 0; k < std::min(directory.count(kStrips), bytes.size()); ++k) {
    const std::size_t begin = directory.number(kStrips, k, 0);  // 0 where the list of strips is cut off
    if (begin == 0 || begin + directory.number(kStripBytes, k, 0) > bytes.size()) {
      file.fault = "is truncated";
      return;
    }
  }
}

/// The size is that of the attribute dataWindow: least and greatest x and y.
void open_exr(Bytes bytes, DepthFile& file) {
  using namespace std::string_view_literals;
  constexpr std::string_view kWindow = "dataWindow\0box2i\0"sv;
  const auto found = std::search(bytes.begin(), bytes.end(), kWindow.begin(), kWindow.end(),
                                 [](std::uint8_t a, char b) { return a == std::uint8_t(b); });
  const std::size_t at = std::size_t(found - bytes.begin()) + kWindow.size() + 4;
  const auto coordinate = [&](std::size_t k) {
    return std::int64_t(static_cast<std::int32_t>(number_at(bytes, at + 4 * k, 4)));
  };
  const std::int64_t width = coordinate(2) - coordinate(0) + 1, height = coordinate(3) - coordinate(1) + 1;
  constexpr std::int64_t kMost = 1 << 30;
  if (found == bytes.end() || width <= 0 || height <= 0) {
    file.fault = "is damaged: an OpenEXR file without a size";
  } else {
    file.size = {int(std::min(width, kMost)), int(std::min(height, kMost))};
  }
}

}  // namespace

std::optional<DepthFileKind> depth_file_kind(Bytes bytes) {
  if (starts_with(bytes, kNpyStart)) return DepthFileKind::npy;
  if (starts_with(bytes, kLittleTiff) || starts_with(bytes, kBigTiff)) return DepthFileKind::tiff;
  if (starts_with(bytes, kExrStart)) return DepthFileKind::exr;
  return std::nullopt;
}

DepthFile open_depth_file(DepthFileKind kind, Bytes bytes) {
  DepthFile file;
  file.kind = kind;
  switch (kind) {
    case DepthFileKind::npy:
      open_npy(bytes, file);
      break;
    case DepthFileKind::tiff:
      open_tiff(bytes, file);
      break;
    case DepthFileKind::exr:
      open_exr(bytes, file);
      break;
  }
  return file;
}

cv::Mat decode_npy(Bytes bytes, const DepthFile& file) {
  const cv::Size stored = file.by_columns ? cv::Size(file.size.height, file.size.width) : file.size;
  cv::Mat image(stored, file.type);
  std::memcpy(image.data, bytes.data() + file.values_at, image.total() * image.elemSize());
  if (file.by_columns) image = image.t();
  if (image.depth() == CV_16F || image.depth() == CV_64F) image.convertTo(image, CV_32F);
  return image;
}

cv::Mat floats_of_channels(const cv::Mat& image, const std::string& name) {
  if (image.type() != CV_8UC4)
    throw InputError(
        name, 0,
        fmt::format("is not an image of four 8-bit channels, the bytes of a float, but has {} bits "
                    "and {} channel{}",
                    8 * image.elemSize1(), image.channels(), image.channels() == 1 ? "" : "s"));
  cv::Mat floats(image.size(), CV_32FC1);
  for (int v = 0; v < image.rows; ++v)
    std::memcpy(floats.ptr(v), image.ptr(v), static_cast<std::size_t>(image.cols) * image.elemSize());
  return floats;
}

}  // namespace dynslam::runtime
