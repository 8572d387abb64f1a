// SPDX-License-Identifier: BSD-3-Clause
#include "all_headers.hpp"

int second();

int second() {
  return 0;
}
