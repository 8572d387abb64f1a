// SPDX-License-Identifier: BSD-3-Clause
#include "slam/prior_mask.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr int kSide = 100;

/// A frame with a feature every 10 pixels.
struct MaskedFrame {
  RgbdFrame input;
  std::optional<Masks> prior{Masks()};
  std::optional<FrameState> now;

  explicit MaskedFrame(const cv::Rect& person) {
    input.gray = cv::Mat::zeros(kSide, kSide, CV_8UC1);
    input.depth = cv::Mat(kSide, kSide, CV_32FC1, cv::Scalar(2));
    prior->dynamic = cv::Mat::zeros(kSide, kSide, CV_8UC1);
    prior->dynamic(person).setTo(255);
    now.emplace(input);
    for (int v = 5; v < kSide; v += 10) {
      for (int u = 5; u < kSide; u += 10) {
        Feature f;
        f.u = static_cast<float>(u);
        f.v = static_cast<float>(v);
        now->frame().features.push_back(f);
      }
    }
    now->frame().dynamic.assign(now->frame().features.size(), 0);
  }
  [[nodiscard]] std::ptrdiff_t flagged() const {
    const auto& flags = now->frame().dynamic;
    return std::count_if(flags.begin(), flags.end(), [](std::uint8_t f) { return f != 0; });
  }
};

}  // namespace

TEST_CASE("a mask takes out its features with a margin, and is output without it") {
  MaskedFrame person(cv::Rect(20, 20, 20, 20));  // 4 features, 16 with the margin
  PriorMask({true, 9, 0.2}).apply(person.prior, *person.now);
  CHECK(person.flagged() == 16);
  CHECK(cv::countNonZero(person.now->result.dynamic_mask == kMovesNow) == 400);
  CHECK(person.now->prior == &*person.prior);
  CHECK_FALSE(person.now->mask_covers_view);
}

TEST_CASE(
    "without a mask, or where the mode takes none, nothing is flagged and the mask that is output is empty") {
  MaskedFrame unused(cv::Rect(20, 20, 20, 20)), none(cv::Rect(20, 20, 20, 20));
  PriorMask({false, 9, 0.2}).apply(unused.prior, *unused.now);
  PriorMask({true, 9, 0.2}).apply(std::nullopt, *none.now);
  for (const MaskedFrame* frame : {&unused, &none}) {
    CHECK(frame->flagged() == 0);
    REQUIRE(frame->now->result.dynamic_mask.size() == cv::Size(kSide, kSide));
    CHECK(cv::countNonZero(frame->now->result.dynamic_mask) == 0);
    CHECK(frame->now->prior == nullptr);
  }
}

TEST_CASE("a mask that leaves next to nothing covers the view; rejected, it flags nothing, and says why") {
  MaskedFrame crowd(cv::Rect(0, 0, 90, 100));
  PriorMask({true, 0, 0.2}).apply(crowd.prior, *crowd.now);
  CHECK(crowd.now->mask_covers_view);
  CHECK(crowd.now->covering_mask().data == crowd.now->semantic.data);
  CHECK(PriorMask::reject(MaskVerdict::covers_view, *crowd.now));
  CHECK(crowd.flagged() == 0);
  CHECK(crowd.now->covering_mask().empty());
  CHECK(crowd.now->result.mask_rejected == MaskVerdict::covers_view);
  CHECK_FALSE(PriorMask::reject(MaskVerdict::starved, *crowd.now));  // once
  CHECK(crowd.now->result.mask_rejected == MaskVerdict::covers_view);
}

TEST_CASE("surfaces that are static stay in the mask as what may move, and are used in the next frame") {
  PriorMask mask({true, 0, 0.2});
  const cv::Rect person(20, 20, 40, 40);
  MaskedFrame first(person), next(person), later(person);
  mask.apply(first.prior, *first.now);
  CHECK(first.flagged() == 16);
  first.now->moving_widened = cv::Mat::zeros(kSide, kSide, CV_8UC1);
  first.now->moving_widened(cv::Rect(20, 20, 40, 20)).setTo(255);  // the upper half does move
  mask.mark_static([](int u, int) { return u >= 40; }, *first.now);
  CHECK(first.now->result.dynamic_mask.at<std::uint8_t>(50, 50) == kMayMove);
  CHECK(first.now->result.dynamic_mask.at<std::uint8_t>(50, 30) == kMovesNow);  // not verified
  CHECK(first.now->result.dynamic_mask.at<std::uint8_t>(30, 50) == kMovesNow);
  CHECK(first.now->result.dynamic_mask.at<std::uint8_t>(50, 80) == 0);
  mask.apply(next.prior, *next.now);
  CHECK(next.flagged() == 12);
  mask.forget_static();
  mask.apply(later.prior, *later.now);
  CHECK(later.flagged() == 16);
}

TEST_CASE("of a static object all may move, and what was verified is used and no longer covers the view") {
  PriorMask mask({true, 0, 0.2});
  const cv::Rect wall(0, 0, 90, 100);
  MaskedFrame first(wall), next(wall);
  for (MaskedFrame* frame : {&first, &next})
    frame->prior->dynamic.convertTo(frame->prior->instances, CV_16U, 1 / 255.0);
  mask.apply(first.prior, *first.now);
  CHECK(first.now->mask_covers_view);
  first.now->moving = cv::Mat::zeros(kSide, kSide, CV_8UC1);
  first.now->moving(cv::Rect(70, 80, 10, 20)).setTo(255);
  first.now->moving_widened = first.now->moving;
  mask.mark_static([](int u, int) { return u < 60; }, *first.now);  // the rest has just come into view
  CHECK(first.now->result.dynamic_mask.at<std::uint8_t>(50, 80) == kMayMove);
  CHECK(first.now->result.dynamic_mask.at<std::uint8_t>(90, 75) == kMovesNow);
  mask.apply(next.prior, *next.now);
  CHECK(next.flagged() == 30);
  CHECK_FALSE(next.now->mask_covers_view);
}
