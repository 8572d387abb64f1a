// SPDX-License-Identifier: BSD-3-Clause
// What the snippets of README and docs leave to the reader (scripts/check-snippets.py).
#pragma once

#include <opencv2/core.hpp>

inline cv::Mat bgr, depth;
inline double t = 0;

bool grab(cv::Mat&, cv::Mat&, double&);
template <class... T>
void publish(const T&...) {}
template <class... T>
void use(const T&...) {}
