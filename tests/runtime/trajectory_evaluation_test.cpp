// SPDX-License-Identifier: BSD-3-Clause
// Estimates against ground truths: what can be given, alignments, clocks, bodies that carry the camera.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "error_text.hpp"
#include "random.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions;

TEST_CASE(
    "of an estimate what can be compared is given, and each cause of what cannot has a line of its own") {
  std::vector<StampedPose<double>> still, line, moving;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d p(std::sin(i), std::cos(i), 0.1 * i);
    still.push_back({i / 30.0, SE3d()});
    line.push_back({i / 30.0, SE3d(SO3d(), Eigen::Vector3d(0.01 * i, 0, 0))});
    moving.push_back({i / 30.0, SE3d(SO3d(), p)});
  }
  const auto of = [&](const std::vector<StampedPose<double>>& estimate,
                      Alignment alignment = Alignment::se3) {
    EvaluationOptions options;
    options.alignment = alignment;
    return evaluate_trajectory(estimate, moving, "e", "g", options);
  };
  const TrajectoryReport one_place = of(still), one_line = of(line);
  for (const TrajectoryReport* report : {&one_place, &one_line}) {
    CHECK(report->ate.pairs == 0);
    CHECK(std::isnan(report->ate.translation.rmse));
    CHECK(report->rpe.pairs > 0);
    REQUIRE(report->notes.size() == 1);
    CHECK(mentions(report->notes[0], "e is from 0.000 to 1.967 s, g from 0.000 to 1.967 s"));
  }
  CHECK(mentions(one_place.notes[0], "no ATE: the positions of e are all in one place"));
  CHECK(mentions(one_line.notes[0], "no ATE: the positions of e lie on one line"));
  const TrajectoryReport of_line = evaluate_trajectory(moving, line, "e", "g");
  CHECK(mentions(of_line.notes.at(0), "no ATE: the positions of g lie on one line"));
  CHECK(of(still, Alignment::none).ate.pairs == 60);
  // A spread whose square is 0: a scale of 0, inf or nan.
  std::vector<StampedPose<double>> tiny = moving;
  for (auto& pose : tiny) pose.T_w_c = SE3d(SO3d(), 1e-300 * pose.T_w_c.translation());
  EvaluationOptions scaled;
  scaled.alignment = Alignment::sim3;
  const TrajectoryReport tiny_estimate = of(tiny, Alignment::sim3),
                         tiny_truth = evaluate_trajectory(moving, tiny, "e", "g", scaled);
  for (const TrajectoryReport* report : {&tiny_estimate, &tiny_truth}) {
    CHECK(report->ate.pairs == 0);
    REQUIRE(report->notes.size() == 1);
    CHECK(mentions(report->notes[0], "are all in one place, which leaves the rotation or the scale"));
  }
  CHECK(mentions(tiny_truth.notes[0], "no ATE: the positions of g "));
  // In one place but for less than a micrometre, which a similarity would blow up to the whole way.
  for (auto& pose : tiny)
    pose.T_w_c = SE3d(SO3d(), Eigen::Vector3d(1, 2, 3) + 1e292 * pose.T_w_c.translation());
  const TrajectoryReport trembling = of(tiny, Alignment::sim3);
  CHECK(trembling.ate.pairs == 0);
  CHECK(mentions(trembling.notes.at(0), "no ATE: the positions of e are all in one place"));
  // Shorter than the interval of the RPE.
  const TrajectoryReport brief = evaluate_trajectory(std::span(moving).first(20), moving, "e", "g");
  CHECK(brief.ate.translation.rmse < 1e-9);
  CHECK(brief.rpe.pairs == 0);
  CHECK(mentions(brief.notes.at(0),
                 "no RPE: fewer than 2 intervals of 1 s have poses of both; e is from 0.000 to"));
  CHECK(nlohmann::json(to_json(brief))["rpe_trans_m"]["rmse"].dump() == "null");
  CHECK(mentions(to_text(brief), "no RPE"));
  CHECK_FALSE(mentions(to_text(brief), "RPE translation"));
  for (auto& p : still) p.t += 100;
  CHECK(
      mentions(error_of([&] { (void)evaluate_trajectory(still, moving, "e", "g"); }),
               "g: no ATE: 0 of 60 poses have one of the ground truth within 0.02 s, 3 are needed; e is from "
               "100.000 to 101.967 s, g from 0.000 to 1.967 s"));
}

TEST_CASE("an estimate is laid on the ground truth as it is asked for") {
  test::Rng rng("alignments");
  std::vector<StampedPose<double>> truth, estimate;
  const SE3d T(SO3d::exp(Eigen::Vector3d(0.3, -1, 0.4)), Eigen::Vector3d(5, 6, 7));
  for (int i = 0; i < 90; ++i) {
    const Eigen::Vector3d p(std::sin(0.1 * i), std::cos(0.13 * i), 0.01 * i);
    truth.push_back({i / 30.0, SE3d(SO3d::exp(Eigen::Vector3d(0.01 * i, 0, 0)), p)});
    const SE3d& at = truth.back().T_w_c;
    estimate.push_back({i / 30.0, T * SE3d(at.so3(), 0.5 * at.translation())});
  }
  const auto with = [&](Alignment alignment) {
    EvaluationOptions options;
    options.alignment = alignment;
    return evaluate_trajectory(estimate, truth, "e", "g", options).ate;
  };
  CHECK(with(Alignment::sim3).translation.max < 1e-9);
  CHECK(with(Alignment::sim3).scale == doctest::Approx(2));
  CHECK(with(Alignment::se3).translation.rmse > 0.1);
  CHECK(with(Alignment::se3).translation.rmse < with(Alignment::first).translation.rmse);
  CHECK(with(Alignment::first).errors.front() < 1e-9);
  // As they are: the distance itself.
  double sum = 0;
  for (std::size_t i = 0; i < truth.size(); ++i)
    sum += (truth[i].T_w_c.translation() - estimate[i].T_w_c.translation()).squaredNorm();
  CHECK(with(Alignment::none).translation.rmse == doctest::Approx(std::sqrt(sum / 90)));
}

TEST_CASE("the offset of two clocks is found by the motion, however the two are aligned") {
  std::vector<StampedPose<double>> truth, estimate;
  const auto pose = [](double t) {
    return SE3d(SO3d::exp(Eigen::Vector3d(std::sin(t), 0.5 * std::sin(1.7 * t), 0.3 * std::cos(0.6 * t))),
                Eigen::Vector3d(std::sin(1.3 * t), std::cos(0.7 * t), 0.2 * std::sin(2.9 * t)));
  };
  const SE3d T(SO3d::exp(Eigen::Vector3d(1, 2, -1)), Eigen::Vector3d(3, 2, 1));
  for (int i = 0; i < 3000; ++i) truth.push_back({1e9 + i / 100.0, pose(i / 100.0)});
  for (int i = 0; i < 600; ++i) estimate.push_back({i / 30.0, T * pose(4.321 + i / 30.0)});
  EvaluationOptions options;
  options.find_offset = true;
  const TrajectoryReport report = evaluate_trajectory(estimate, truth, "e", "g", options);
  CHECK(report.ate.pairs == 600);
  CHECK(report.ate.translation.rmse < 0.02);
  CHECK(mentions(report.notes.at(0), "offset of the clocks: 1000000004.32"));
  options.find_offset = false;
  options.offset = 1e9 + 4.321;
  CHECK(evaluate_trajectory(estimate, truth, "e", "g", options).ate.pairs == 600);
  std::vector<StampedPose<double>> still;
  for (int i = 0; i < 60; ++i) still.push_back({i / 30.0, SE3d()});
  options.find_offset = true;
  CHECK(mentions(error_of([&] { (void)evaluate_trajectory(still, truth, "e", "g", options); }),
                 "e: does not tell the offset of its clock"));
}

TEST_CASE("where the camera goes round evenly no offset of the clocks is made up") {
  // A circle in four seconds, at a speed that changes by so much, with an error of a centimetre that comes
  // and goes.
  const auto estimate_of = [](double offset, double unevenness) {
    const auto pose = [&](double t) {
      const double angle = 1.57 * t + unevenness * (std::sin(2 * t) + std::sin(1.3 * t));
      return SE3d(SO3d::exp(Eigen::Vector3d(0, 0, angle)),
                  Eigen::Vector3d(std::cos(angle), std::sin(angle), 0));
    };
    std::pair<std::vector<StampedPose<double>>, std::vector<StampedPose<double>>> result;
    for (int i = 0; i < 1500; ++i) result.first.push_back({i / 100.0, pose(i / 100.0)});
    for (int i = 0; i < 400; ++i) {
      const double t = i / 30.0;
      const SE3d at = pose(offset + t);
      const Eigen::Vector3d error(std::sin(0.8 * t), std::cos(1.1 * t), std::sin(0.5 * t));
      result.second.push_back({t, SE3d(at.so3(), at.translation() + 0.01 * error)});
    }
    return result;
  };
  EvaluationOptions options;
  options.find_offset = true;
  for (const double unevenness : {0.0, 0.02}) {
    const auto made = estimate_of(0.4, unevenness);
    CHECK(mentions(error_of([&] { (void)evaluate_trajectory(made.second, made.first, "e", "g", options); }),
                   "e: does not tell the offset of its clock to 0.02 s"));
  }
  const auto [truth, estimate] = estimate_of(0.4, 0.3);
  const TrajectoryReport report = evaluate_trajectory(estimate, truth, "e", "g", options);
  double found = 0, deviation = 0;
  REQUIRE(std::sscanf(report.notes.at(0).c_str(), "offset of the clocks: %lf s (± %lf s)", &found,
                      &deviation) == 2);
  CHECK(deviation < 0.01);
  CHECK(std::abs(found - 0.4) < 3 * deviation);
}

TEST_CASE("a ground truth of a turned body is found out, and turned by its pose") {
  test::Rng rng("turned body");
  std::vector<StampedPose<double>> truth, estimate;
  const SE3d T_camera_body(SO3d::exp(Eigen::Vector3d(0.5, -0.2, 1.1)), Eigen::Vector3d::Zero());
  for (int i = 0; i < 150; ++i) {
    const double t = i / 30.0;
    const SE3d T(SO3d::exp(Eigen::Vector3d(std::sin(t), 0.4 * t, 0)),
                 Eigen::Vector3d(std::sin(2 * t), std::cos(1.4 * t), 0.2 * t));
    truth.push_back({t, T * T_camera_body});
    const Eigen::Vector3d noise(0.002 * rng.normal(), 0.002 * rng.normal(), 0.002 * rng.normal());
    estimate.push_back({t, SE3d(T.so3(), T.translation() + noise)});
  }
  const test::TemporaryFolder folder;
  write_trajectory(folder.path / "e.txt", estimate);
  write_trajectory(folder.path / "g.txt", truth);
  const TrajectoryReport turned = evaluate_trajectory(folder.path / "e.txt", folder.path / "g.txt");
  CHECK(turned.rpe.translation.rmse > 0.1);
  REQUIRE(turned.notes.size() == 1);
  CHECK(mentions(turned.notes[0], "of a body that is turned by 70.2 degrees against the camera"));
  // What it advises to write is the file that mends it.
  const std::string& note = turned.notes[0];
  const auto from = note.find("with ") + 5;
  test::write_file(folder.path / "body.txt", note.substr(from, note.find(" turns") - from));
  EvaluationOptions options;
  options.body_pose = folder.path / "body.txt";
  const TrajectoryReport mended = evaluate_trajectory(folder.path / "e.txt", folder.path / "g.txt", options);
  CHECK(mended.notes.empty());
  CHECK(mended.rpe.translation.rmse < 0.01);
  const Eigen::Matrix4d M = T_camera_body.inverse().matrix();
  std::string rows;
  for (int r = 0; r < 4; ++r) rows += fmt::format("{} {} {} {}\n", M(r, 0), M(r, 1), M(r, 2), M(r, 3));
  test::write_file(folder.path / "body.txt", rows);
  CHECK(evaluate_trajectory(folder.path / "e.txt", folder.path / "g.txt", options).rpe.translation.rmse <
        0.01);
  test::write_file(folder.path / "body.txt", "1 2 3\n");
  CHECK(mentions(
      error_of([&] { (void)evaluate_trajectory(folder.path / "e.txt", folder.path / "g.txt", options); }),
      "body.txt:1: expected 4 numbers"));
  for (const auto& [line, reason] : {std::pair("1e300 0 0 0 0 0 1", "'1e300' is too far to be a position"),
                                     std::pair("0 0 0 0 0 0 0", "the quaternion is zero")}) {
    test::write_file(folder.path / "body.txt", fmt::format("# of the robot\n{}\n", line));
    CHECK(mentions(
        error_of([&] { (void)evaluate_trajectory(folder.path / "e.txt", folder.path / "g.txt", options); }),
        fmt::format("body.txt:2: {}", reason)));
  }
}
