// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "dynslam/runtime/evaluation/sweep.hpp"

namespace dynslam::app {

/// Where the jobs of a sweep are run.
struct JobPlace {
  std::filesystem::path out;  ///< absolute; a job's folder is below it
  std::string program;        ///< version and commit, for job.json
  std::string executable;     ///< this program's file
};

/// Runs jobs, so many at a time, each as a process of its own that writes into its folder: what it prints to
/// `log`, and job.json when it has ended. SIGINT, SIGTERM and SIGHUP end them; no further ones are begun.
/// One that cannot be started fails, and the others go on.
/// @param ended  called with each job that has ended, its exit code and, where that is not 0, the reason
/// @return false where a signal ended them
[[nodiscard]] bool run_jobs(
    const std::vector<const runtime::SweepJob*>& jobs, const JobPlace& place, int at_once,
    const std::function<void(const runtime::SweepJob&, int, const std::string&)>& ended);

}  // namespace dynslam::app
