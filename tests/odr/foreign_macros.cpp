// SPDX-License-Identifier: BSD-3-Clause
// Every header compiles after those that leave words behind as macros, and the macros are there as before afterwards.
// In the build folder all_headers.hpp names the headers, new ones, too.
#include <cstddef>  // of which libstdc++'s first header undefines min and max

#include "foreign_macros.hpp"
// After those.
#include "all_headers.hpp"

static_assert(Success == 0 && None == 0L && Complex == 0 && Convex == 2, "macros of Xlib.h are restored");
static_assert(min(1, 2) == 1 && max(1, 2) == 2, "macros of windows.h are restored");
static_assert(sizeof(Status) == sizeof(int) && sizeof(small) == 1);
#if !defined near || !defined far || !defined I || !defined True || !defined ERROR
#error "a macro was not restored"
#endif

int main() {
  // What a program of X11 does, in the words that its macros leave.
  Status far near_result = dynslam::SE3<double>().translation().norm() == 0 ? Success : 1;
  return near_result;
}
