// SPDX-License-Identifier: BSD-3-Clause
// A public header that no conformance test includes: the check must say so.
#pragma once
