// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/message_reader.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime::bag {
namespace {

constexpr std::size_t kCdrHeader = 4;  // what CDR's alignment does not count

}  // namespace

std::optional<Serialisation> serialisation_of(std::string_view encoding) {
  if (encoding == "ros1") return Serialisation::ros1;
  if (encoding == "cdr") return Serialisation::cdr;
  return std::nullopt;
}

MessageReader::MessageReader(Bytes bytes, const std::string& name, Serialisation how, const char* whole)
    : rest_(bytes), name_(name), size_(bytes.size()), whole_(whole), how_(how) {
  if (how_ == Serialisation::ros1) return;
  const Bytes head = this->bytes(kCdrHeader, "CDR's header");
  const unsigned kind = 256U * head[0] + head[1];
  if (kind > 1) fail(fmt::format("is CDR of kind {}, which is not read; 0 and 1 are", kind));
  big_endian_ = kind == 0;
}

void MessageReader::fail(const std::string& reason) const {
  throw InputError(name_, 0, reason);
}

Bytes MessageReader::bytes(std::uint64_t size, const char* what) {
  if (size > rest_.size())
    fail(fmt::format("{} ends at byte {}: {} needs {} bytes from byte {} on", whole_, size_, what, size,
                     size_ - rest_.size()));
  const Bytes found = rest_.first(static_cast<std::size_t>(size));
  rest_ = rest_.subspan(found.size());
  return found;
}

std::uint64_t MessageReader::number(std::size_t size, const char* what) {
  if (how_ == Serialisation::cdr) {
    const std::size_t past = (size_ - rest_.size() - kCdrHeader) % size;
    if (past > 0) (void)bytes(size - past, what);
  }
  std::uint64_t value = 0;
  const Bytes found = bytes(size, what);
  for (std::size_t k = 0; k < size; ++k)
    value |= static_cast<std::uint64_t>(found[big_endian_ ? size - 1 - k : k]) << (8 * k);
  return value;
}

double MessageReader::f64(const char* what) {
  return std::bit_cast<double>(number(8, what));
}

std::string MessageReader::text(const char* what) {
  Bytes found = bytes(u32(what), what);
  // CDR counts the zero at the end.
  if (how_ == Serialisation::cdr && !found.empty() && found.back() == 0)
    found = found.first(found.size() - 1);
  return {reinterpret_cast<const char*>(found.data()), found.size()};
}

std::string MessageReader::frame(const char* what) {
  std::string found = text(what);
  return found.starts_with('/') ? found.substr(1) : found;
}

Header MessageReader::header() {
  Header header;
  if (how_ == Serialisation::ros1) (void)u32("the header");  // a counter
  header.seconds = u32("the stamp");
  header.nanoseconds = u32("the stamp");
  constexpr std::uint32_t kNegative = 1U << 31U;  // in ROS 2, where seconds have a sign
  if (how_ == Serialisation::cdr && header.seconds >= kNegative) fail("the stamp is before 1970");
  if (header.nanoseconds >= 1000000000U)
    fail(fmt::format("the stamp has {} nanoseconds", header.nanoseconds));
  header.frame = frame("the frame");
  return header;
}

SE3<double> MessageReader::pose() {
  Eigen::Vector3d t;
  for (double& x : t) x = f64("a position");
  Eigen::Quaterniond q;
  for (double& x : q.coeffs()) x = f64("a rotation");    // x y z w, as Eigen keeps them
  constexpr double kFarthest = 1e12, kTolerance = 1e-2;  // metres; of a unit quaternion
  if (!t.allFinite() || t.cwiseAbs().maxCoeff() > kFarthest || !q.coeffs().allFinite() ||
      !(std::abs(q.coeffs().norm() - 1) <= kTolerance))
    fail("a pose that is none: its numbers are not finite or its quaternion is not of length 1");
  return {q.normalized(), t};
}

void MessageReader::end() const {
  // Middleware fills CDR up to a multiple of four or eight bytes.
  const std::size_t padding = how_ == Serialisation::cdr ? 7 : 0;
  if (rest_.size() > padding) fail(fmt::format("{} bytes are left behind {}", rest_.size(), whole_));
}

}  // namespace dynslam::runtime::bag
