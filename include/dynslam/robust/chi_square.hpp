// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

namespace dynslam {

/// 95 % quantile of chi-square: of 20 true residuals of `Dimension` components, one lies beyond in squared
/// normalised error. (Multiple View Geometry, Hartley and Zisserman 2003, table 4.2.)
template <int Dimension>
  requires(Dimension == 1 || Dimension == 2 || Dimension == 3)
inline constexpr double kChiSquare95 = Dimension == 1 ? 3.841 : Dimension == 2 ? 5.991 : 7.815;

/// Median of chi-square with 2 degrees of freedom, 2 ln 2: half of true pixel residuals lie below.
inline constexpr double kChiSquareMedian2 = 1.3863;
/// And with 1.
inline constexpr double kChiSquareMedian1 = 0.4549;
/// And with 3.
inline constexpr double kChiSquareMedian3 = 2.366;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
