// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/atomic_file.hpp"

#include <doctest/doctest.h>
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using runtime::AtomicFile, runtime::InputError, runtime::write_file;
namespace fs = std::filesystem;

namespace {

std::string content(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::ptrdiff_t entries(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder), {});
}

}  // namespace

TEST_CASE("a file appears with commit(), whole, in the place of an earlier one") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path / "map.bin";
  std::string text(200000, 'a');  // several blocks
  text[70000] = '\0';
  write_file(path, "earlier");
  {
    AtomicFile file(path);
    file.stream() << text;
    CHECK(content(path) == "earlier");
    file.commit();
  }
  CHECK(content(path) == text);
  CHECK(entries(folder.path) == 1);
  write_file(path, "");
  CHECK(content(path).empty());
}

TEST_CASE("without commit() the earlier file stays and nothing is left behind") {
  const test::TemporaryFolder folder;
  write_file(folder.path / "a", "earlier");
  {
    AtomicFile file(folder.path / "a");
    file.stream() << "half of";
  }
  CHECK(content(folder.path / "a") == "earlier");
  CHECK(entries(folder.path) == 1);
}

TEST_CASE("a refusal names the file and the system's reason") {
  const test::TemporaryFolder folder;
  const fs::path absent = folder.path / "no" / "such" / "file";
  CHECK_THROWS_WITH_AS(write_file(absent, "x"),
                       (absent.string() + ": cannot be written: No such file or directory").c_str(),
                       InputError);
  fs::create_directories(folder.path / "taken" / "inside");
  CHECK_THROWS_WITH_AS(write_file(folder.path / "taken", "x"),
                       ((folder.path / "taken").string() + ": is not a regular file").c_str(), InputError);
  CHECK(entries(folder.path) == 1);  // and there is no temporary
}

TEST_CASE("a full disk is told, and the earlier file stays") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path / "a";
  write_file(path, "earlier");
  // A limit on the size of files stands for the disk; in a process of its own, as it holds for all of one.
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{100000, 100000};
    setrlimit(RLIMIT_FSIZE, &limit);
    try {
      write_file(path, std::string(300000, 'b'));
    } catch (const InputError& error) {
      _exit(std::string(error.what()).find(path.string() + ": cannot be written: File too large") == 0 ? 0
                                                                                                       : 2);
    }
    _exit(1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  CHECK(status == 0);
  CHECK(content(path) == "earlier");
  CHECK(entries(folder.path) == 1);
}

TEST_CASE("names that others use for temporaries, links among them, are neither followed nor reused") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path / "a", victim = folder.path / "victim";
  std::ofstream(victim) << "precious";
  fs::create_symlink(victim, folder.path / "a.tmp");
  fs::create_symlink(victim, path);  // the name itself is replaced, not what it points to
  write_file(path, "new");
  CHECK(content(victim) == "precious");
  CHECK(content(path) == "new");
  CHECK(fs::is_symlink(folder.path / "a.tmp"));
}

TEST_CASE("what is there and no regular file is refused before anything is written, and stays") {
  const test::TemporaryFolder folder;
  const fs::path pipe = folder.path / "pipe", link = folder.path / "link", out = folder.path / "stdout";
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  fs::create_symlink("pipe", link);
  // As /dev/stdout where it goes to a file: under the file's name another one would take its place.
  const fs::path log = folder.path / "log";
  const int file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  REQUIRE(file >= 0);
  REQUIRE(::write(file, "lines", 5) == 5);
  fs::create_symlink("/proc/self/fd/" + std::to_string(file), out);
  for (const fs::path& path : {pipe, link, out}) {
    CAPTURE(path.string());
    CHECK_THROWS_WITH_AS(AtomicFile{path}, (path.string() + ": is not a regular file").c_str(), InputError);
  }
  ::close(file);
  CHECK(fs::is_fifo(fs::symlink_status(pipe)));
  CHECK(fs::is_symlink(link));
  CHECK(content(log) == "lines");
  CHECK(entries(folder.path) == 4);
}

TEST_CASE("many writers of one file: each reader sees one of their texts, whole") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path / "shared.txt";
  const auto text = [](int k) { return std::string(100000, static_cast<char>('a' + k)); };
  write_file(path, text(0));
  {
    std::vector<std::jthread> writers;
    for (int k = 0; k < 4; ++k) {
      writers.emplace_back([&, k] {
        for (int i = 0; i < 25; ++i) write_file(path, text(k));
      });
    }
    for (int i = 0; i < 100; ++i) {
      const std::string seen = content(path);
      REQUIRE(!seen.empty());
      REQUIRE(seen == text(seen.front() - 'a'));
    }
  }
  CHECK(entries(folder.path) == 1);
}
