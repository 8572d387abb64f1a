// SPDX-License-Identifier: BSD-3-Clause
// The end of what push_macros.hpp begins; no #pragma once.
#pragma pop_macro("small")
#pragma pop_macro("near")
#pragma pop_macro("min")
#pragma pop_macro("max")
#pragma pop_macro("far")
#pragma pop_macro("Success")
#pragma pop_macro("Status")
#pragma pop_macro("I")
#pragma pop_macro("Complex")
