// SPDX-License-Identifier: BSD-3-Clause
#include "io/jpeg_check.hpp"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
// Needs stdio's names before it.
#include <jerror.h>
#include <jpeglib.h>

namespace dynslam::runtime {
namespace {

constexpr int kSurplus = 4;  // bytes before a marker that are no fault

/// libjpeg's own error record, with a way out of it.
struct Errors {
  jpeg_error_mgr base;  // first: libjpeg knows this part alone
  std::jmp_buf out;
  std::array<char, JMSG_LENGTH_MAX> fault;  // empty: none
};

void note(j_common_ptr state) {
  auto* errors = reinterpret_cast<Errors*>(state->err);
  if (errors->fault[0] == '\0') state->err->format_message(state, errors->fault.data());
}

extern "C" void jpeg_fails(j_common_ptr state) {
  note(state);
  std::longjmp(reinterpret_cast<Errors*>(state->err)->out, 1);
}

extern "C" void jpeg_warns(j_common_ptr state, int level) {
  if (level >= 0) return;  // it tells how it gets on
  const auto& error = *state->err;
  if (error.msg_code == JWRN_EXTRANEOUS_DATA && error.msg_parm.i[0] <= kSurplus) return;
  note(state);
}

/// Nothing here has a destructor: a jump over one is undefined.
void examine(std::span<const std::uint8_t> bytes, int largest, Errors& errors, int& width, int& height) {
  jpeg_decompress_struct state{};
  state.err = jpeg_std_error(&errors.base);
  errors.base.error_exit = jpeg_fails;
  errors.base.emit_message = jpeg_warns;
  if (setjmp(errors.out) == 0) {
    jpeg_create_decompress(&state);
    jpeg_mem_src(&state, bytes.data(), static_cast<unsigned long>(bytes.size()));
    jpeg_read_header(&state, TRUE);
    width = static_cast<int>(state.image_width);
    height = static_cast<int>(state.image_height);
    if (std::max(width, height) <= largest) {
      jpeg_read_coefficients(&state);
      jpeg_finish_decompress(&state);
    }
  }
  jpeg_destroy_decompress(&state);
}

}  // namespace

JpegCheck check_jpeg(std::span<const std::uint8_t> bytes, int largest) {
  Errors errors{};
  int width = 0, height = 0;
  examine(bytes, largest, errors, width, height);
  return {cv::Size(width, height), errors.fault.data()};
}

}  // namespace dynslam::runtime
