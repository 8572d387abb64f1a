// SPDX-License-Identifier: BSD-3-Clause
// No #pragma once: every header of dynslam includes this first and pop_macros.hpp last. Between the two the names below
// are no macros, also in the headers of the standard library, Eigen, OpenCV and OctoMap that are read there; afterwards
// they are what they were. Names come from X11 (Status, Success, Complex), windows.h (min, max, near, far, small) and
// complex.h (I). A name that a user of dynslam has to write does not belong here: it is renamed.
#pragma push_macro("Complex")
#undef Complex
#pragma push_macro("I")
#undef I
#pragma push_macro("Status")
#undef Status
#pragma push_macro("Success")
#undef Success
#pragma push_macro("far")
#undef far
#pragma push_macro("max")
#undef max
#pragma push_macro("min")
#undef min
#pragma push_macro("near")
#undef near
#pragma push_macro("small")
#undef small
