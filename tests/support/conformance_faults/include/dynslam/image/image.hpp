// SPDX-License-Identifier: BSD-3-Clause
// One of the same name as a header that the tests include.
#pragma once
