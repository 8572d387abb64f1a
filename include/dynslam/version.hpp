// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

/// The version of these headers, for `#if`. What it promises: docs/architecture.md, "What is stable".
#define DYNSLAM_VERSION_MAJOR 0
#define DYNSLAM_VERSION_MINOR 2
#define DYNSLAM_VERSION_PATCH 0

#include "dynslam/pop_macros.hpp"
