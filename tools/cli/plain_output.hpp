// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>

#include <ostream>
#include <streambuf>
#include <string>

namespace dynslam::app {

/// What a stream prints while this lives has no control characters but line breaks and tabs: names of files
/// and topics are other people's, and a terminal obeys what it is sent.
class PlainOutput : public std::streambuf {
 public:
  explicit PlainOutput(std::ostream& stream) : stream_(stream), to_(stream.rdbuf(this)) {}
  ~PlainOutput() override { stream_.rdbuf(to_); }
  PlainOutput(const PlainOutput&) = delete;
  PlainOutput& operator=(const PlainOutput&) = delete;

 protected:
  int_type overflow(int_type c) override {
    if (traits_type::eq_int_type(c, traits_type::eof())) return traits_type::not_eof(c);
    const char plain = traits_type::to_char_type(c);
    const bool control = (plain >= 0 && plain < ' ' && plain != '\n' && plain != '\t') || plain == 0x7F;
    if (!control) return to_->sputc(plain);
    const std::string escaped = fmt::format("\\x{:02x}", static_cast<unsigned char>(plain));
    const auto length = static_cast<std::streamsize>(escaped.size());
    return to_->sputn(escaped.data(), length) == length ? c : traits_type::eof();
  }
  int sync() override { return to_->pubsync(); }

 private:
  std::ostream& stream_;
  std::streambuf* to_;
};

}  // namespace dynslam::app
