// SPDX-License-Identifier: BSD-3-Clause
// Poses as 4x4 matrices, in the ways that formats write them.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/formats/format.hpp"

namespace dynslam::runtime::formats {
namespace {

constexpr const char* kNoMotion =
    "the matrix is no rigid motion (rotation and translation, last row 0 0 0 1)";

bool not_finite(std::string_view word) {
  if (!word.empty() && (word.front() == '-' || word.front() == '+')) word.remove_prefix(1);
  return word == "inf" || word == "nan" || word == "Inf" || word == "NaN" || word == "INF" || word == "NAN";
}

/// The numbers of a line, NaN for words that say so. @throws InputError
std::vector<double> numbers_of(const LineReader& reader, std::size_t expected, const std::string& name) {
  const auto words = split_words(reader.line());
  if (words.size() != expected)
    throw InputError(name, reader.number(),
                     fmt::format("expected {} numbers, found {} words", expected, words.size()));
  std::vector<double> numbers;
  for (const std::string_view word : words) {
    const auto number = parse_number(word);
    if (!number && !not_finite(word))
      throw InputError(name, reader.number(), fmt::format("'{}' is not a number", word));
    numbers.push_back(number.value_or(std::nan("")));
  }
  return numbers;
}

/// The next four lines. @throws InputError
Eigen::Matrix4d next_matrix(LineReader& reader, const std::string& name) {
  Eigen::Matrix4d matrix;
  for (Eigen::Index row = 0; row < 4; ++row) {
    if (!reader.next())
      throw InputError(name, reader.number(), fmt::format("the matrix ends after {} of 4 rows", row));
    const auto numbers = numbers_of(reader, 4, name);
    for (Eigen::Index k = 0; k < 4; ++k) matrix(row, k) = numbers[static_cast<std::size_t>(k)];
  }
  return matrix;
}

void check_stream(const std::istream& in, const std::string& name) {
  if (in.bad()) throw InputError(name, 0, "cannot be read");
}

}  // namespace

std::optional<SE3<double>> rigid_motion(const Eigen::Matrix4d& matrix) {
  constexpr double kFarthest = 1e12, kTolerance = 0.02;  // metres; of products of unit vectors
  if (!matrix.allFinite() || matrix.topRightCorner<3, 1>().cwiseAbs().maxCoeff() > kFarthest)
    return std::nullopt;
  const Eigen::RowVector4d last(0, 0, 0, 1);
  if ((matrix.row(3) - last).cwiseAbs().maxCoeff() > 1e-3) return std::nullopt;
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  if (R.cwiseAbs().maxCoeff() > 2 || R.determinant() < 0 ||
      (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > kTolerance)
    return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  return SE3<double>(Eigen::Quaterniond(nearest).normalized(), matrix.topRightCorner<3, 1>());
}

std::optional<Eigen::Matrix4d> parse_matrix(std::istream& in, const std::string& name) {
  LineReader reader(in);
  const Eigen::Matrix4d matrix = next_matrix(reader, name);
  if (reader.next()) throw InputError(name, reader.number(), "expected the end after 4 rows");
  check_stream(in, name);
  if (!matrix.allFinite()) return std::nullopt;
  return matrix;
}

UsablePoses parse_pose_rows(std::istream& in, const std::string& name, double rate) {
  UsablePoses result;
  LineReader reader(in);
  for (double row = 0; reader.next(); ++row) {
    try {
      const auto numbers = numbers_of(reader, 16, name);
      const auto pose =
          rigid_motion(Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data()));
      if (!pose) throw InputError(name, reader.number(), kNoMotion);
      result.poses.push_back({row / rate, *pose});
    } catch (const InputError& error) {
      result.leave_out(error.what());
    }
  }
  check_stream(in, name);
  return result;
}

UsablePoses parse_log(std::istream& in, const std::string& name, std::span<const double> times) {
  UsablePoses result;
  std::optional<std::size_t> before;
  LineReader reader(in);
  while (reader.next()) {
    const std::size_t line = reader.number();
    const auto head = numbers_of(reader, 3, name);
    constexpr double kMost = 1e9;
    if (!(head[0] >= 0 && head[0] <= kMost) || head[0] != std::floor(head[0]))
      throw InputError(name, line, "expected the index of a frame, from 0");
    const auto index = static_cast<std::size_t>(head[0]);
    if (before && index <= *before) throw InputError(name, line, "the frames' indices do not increase");
    if (index >= times.size())
      throw InputError(name, line,
                       fmt::format("names frame {}, but there are {} colour images", index, times.size()));
    before = index;
    if (const auto pose = rigid_motion(next_matrix(reader, name))) {
      result.poses.push_back({times[index], *pose});
    } else {
      result.leave_out(InputError(name, line + 1, kNoMotion).what());
    }
  }
  check_stream(in, name);
  return result;
}

UsablePoses read_pose_files(const std::filesystem::path& folder, std::string_view prefix,
                            std::string_view suffix, double rate) {
  UsablePoses result;
  for (const NumberedFile& file : numbered_files(folder, prefix, {&suffix, 1})) {
    try {
      std::istringstream in(read_text(file.path));
      const auto matrix = parse_matrix(in, file.path.string());
      if (!matrix) continue;
      const auto pose = rigid_motion(*matrix);
      if (!pose) throw InputError(file.path.string(), 0, kNoMotion);
      result.poses.push_back({static_cast<double>(file.number) / rate, *pose});
    } catch (const InputError& error) {
      result.leave_out(error.what());
    }
  }
  return result;
}

void read_optional_truth(Sequence& sequence, const std::filesystem::path& file,
                         const std::function<UsablePoses()>& read) {
  sequence.truth_file = file;
  try {
    UsablePoses found = read();
    const std::string note = found.note();
    sequence.groundtruth = std::move(found.poses);
    if (sequence.groundtruth.empty()) {
      if (found.left_out > 0) sequence.truth_missing = found.first_fault;
      if (found.left_out == 0 && std::filesystem::exists(file))
        sequence.truth_missing = file.string() + ": holds no poses";
    } else if (found.left_out > 0) {
      sequence.notes.push_back("ground truth: " + note);
    }
  } catch (const InputError& error) {
    sequence.truth_missing = error.what();
  }
  if (!sequence.truth_missing.empty())
    sequence.notes.push_back("the ground truth is not used: " + sequence.truth_missing);
}

}  // namespace dynslam::runtime::formats
