// SPDX-License-Identifier: BSD-3-Clause
// Entry point of every test executable.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>
