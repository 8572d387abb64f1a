// SPDX-License-Identifier: BSD-3-Clause
#include "job_runner.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>
#include <thread>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"

extern char** environ;  // NOLINT: POSIX

namespace dynslam::app {
namespace {

namespace fs = std::filesystem;
namespace rt = dynslam::runtime;

constexpr int kNotStarted = 1;  // exit code of a job without a process or a record

std::atomic<int> stop_signal{0};

extern "C" void note_stop(int signal) {
  stop_signal.store(signal);
}

/// Signals that are ignored stay so (nohup).
void listen_for_stop() {
  struct sigaction action {};
  action.sa_handler = note_stop;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    if (sigaction(signal, nullptr, &before) == 0 && before.sa_handler != SIG_IGN)
      sigaction(signal, &action, nullptr);
  }
}

[[noreturn]] void cannot(const fs::path& path, const std::string& what, int error) {
  throw rt::InputError(path.string(), 0, what + ": " + std::generic_category().message(error));
}

fs::path folder_of(const rt::SweepJob& job, const JobPlace& place) {
  return place.out / job.name;
}

/// The last line that a job printed; empty: none.
std::string last_line(const fs::path& log) {
  std::ifstream in(log);
  std::string last;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

pid_t start(const rt::SweepJob& job, const JobPlace& place) {
  const fs::path folder = folder_of(job, place), log = folder / "log";
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) cannot(folder, "cannot be made a folder", error.value());
  fs::remove(folder / "job.json", error);  // it is of an earlier attempt
  std::vector<std::string> words{place.executable};
  words.insert(words.end(), job.arguments.begin(), job.arguments.end());
  words.insert(words.end(), {"--out", folder.string()});
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  posix_spawn_file_actions_adddup2(&files, 1, 2);
  pid_t process = 0;
  const int failed = posix_spawn(&process, place.executable.c_str(), &files, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (failed != 0) cannot(log, "the job could not be started", failed);
  return process;
}

}  // namespace

bool run_jobs(const std::vector<const rt::SweepJob*>& jobs, const JobPlace& place, int at_once,
              const std::function<void(const rt::SweepJob&, int, const std::string&)>& ended) {
  listen_for_stop();
  std::map<pid_t, const rt::SweepJob*> running;
  std::size_t next = 0;
  bool told = false;
  while (next < jobs.size() || !running.empty()) {
    if (stop_signal.load() != 0) {
      next = jobs.size();
      if (!told) {
        for (const auto& [process, job] : running) ::kill(process, SIGTERM);  // they save what they have
      }
      told = true;
      if (running.empty()) break;
    }
    while (next < jobs.size() && running.size() < static_cast<std::size_t>(at_once)) {
      const rt::SweepJob* job = jobs[next++];
      try {
        running[start(*job, place)] = job;
      } catch (const rt::InputError& error) {  // the others go on
        ended(*job, kNotStarted, error.what());
      }
    }
    int status = 0;
    const pid_t process = ::waitpid(-1, &status, WNOHANG);
    if (process <= 0) {  // a signal between a look at stop_signal and a wait for good would be missed
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      continue;
    }
    const auto found = running.find(process);
    if (found == running.end()) continue;
    const rt::SweepJob& job = *found->second;
    running.erase(found);
    int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    std::string why;
    try {
      rt::write_file(folder_of(job, place) / "job.json",
                     rt::sweep_record(job, place.program, code).dump(2) + "\n");
    } catch (const rt::InputError& error) {  // as on a full disk: it is run again
      code = kNotStarted;
      why = error.what();
    }
    if (stop_signal.load() == 0 || code == 0)
      ended(job, code, why.empty() && code != 0 ? last_line(folder_of(job, place) / "log") : why);
  }
  return stop_signal.load() == 0;
}

}  // namespace dynslam::app
