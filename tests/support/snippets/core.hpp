// SPDX-License-Identifier: BSD-3-Clause
// What the snippets of README and docs leave to the reader (scripts/check-snippets.py).
#pragma once

#include <cstdint>
#include <vector>

#include <dynslam/geometry/pinhole.hpp>
#include <dynslam/geometry/se3.hpp>
#include <dynslam/image/image.hpp>
#include <dynslam/optim/pose.hpp>
#include <dynslam/robust/t_distribution.hpp>

using MyCamera = dynslam::Pinhole<float>;
inline const float fx = 500, fy = 500, cx = 320, cy = 240;
inline const MyCamera camera(fx, fy, cx, cy);
inline dynslam::Image<std::uint8_t> gray(640, 480), prior_mask(640, 480);
inline dynslam::Image<float> depth(640, 480);
inline double t = 0;
inline dynslam::SE3f T_c_w, T_c_w_final;
inline std::vector<dynslam::PoseObservation<float>> observations;

bool grab(dynslam::Image<std::uint8_t>&, dynslam::Image<float>&, double&);
dynslam::SE3f track(const dynslam::Image<std::uint8_t>&, const dynslam::Image<float>&);
dynslam::SE3f track_again();
template <class... T>
void drop_features(const T&...) {}
template <class... T>
void use(const T&...) {}
