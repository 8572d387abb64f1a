// SPDX-License-Identifier: BSD-3-Clause
#include "io/folder_draft.hpp"

#include <doctest/doctest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <map>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes;

namespace {

constexpr std::array<std::string_view, 2> kNames{"main.bin", "side.bin"};

void publish(const fs::path& target, const std::string& content) {
  FolderDraft draft(target, kNames);
  write_file(draft.path() / "main.bin", content);
  draft.publish();
}

/// Everything below a folder: names and contents.
std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> found;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    found[fs::relative(entry.path(), folder).string()] =
        entry.is_regular_file() ? bytes(entry.path()) : std::string("folder");
  return found;
}

}  // namespace

TEST_CASE("a folder is replaced as a whole: files that the new one has not are gone") {
  const test::TemporaryFolder folder;
  const fs::path target = folder.path / "m";
  {
    FolderDraft draft(target, kNames);
    write_file(draft.path() / "main.bin", "1");
    write_file(draft.path() / "side.bin", "1");
    CHECK_FALSE(fs::exists(target));
    draft.publish();
  }
  publish(target, "2");
  CHECK(contents(folder.path) == std::map<std::string, std::string>{{"m", "folder"}, {"m/main.bin", "2"}});
  publish(folder.path / "deep" / "er", "3");
  CHECK(bytes(folder.path / "deep" / "er" / "main.bin") == "3");
  { const FolderDraft abandoned(target, kNames); }
  CHECK(bytes(target / "main.bin") == "2");
  CHECK(std::distance(fs::directory_iterator(folder.path), {}) == 2);
}

TEST_CASE(
    "what this program did not make stays: in the folder and beside it, with its mode and its folders") {
  const test::TemporaryFolder folder;
  const fs::path target = folder.path / "m";
  publish(target, "1");
  write_file(target / "side.bin", "1");
  write_file(target / "letter.txt", "dear");
  write_file(target / "main.bin.old", "a copy");
  fs::create_directories(target / "photos" / "2026");
  write_file(target / "photos" / "2026" / "a.jpg", "b");
  fs::create_symlink("letter.txt", target / "link");
  ::chmod(target.c_str(), 0750);
  struct stat before {
  }, after{};
  REQUIRE(::stat((target / "letter.txt").c_str(), &before) == 0);
  for (const char* name :
       {"m.old", "m.partial", "m.1-2-3.old", "m.12-0123abcd-0.old.txt", "mm.12-0123abcd-0.old"}) {
    fs::create_directories(folder.path / name);
    write_file(folder.path / name / "main.bin", "mine");
  }
  for (int k = 2; k < 5; ++k) {
    publish(target, std::to_string(k));
    clear_leftovers(target, kNames);
  }
  auto found = contents(folder.path);
  CHECK(found["m/main.bin"] == "4");
  CHECK_FALSE(found.contains("m/side.bin"));
  CHECK(found["m/letter.txt"] == "dear");
  CHECK(found["m/main.bin.old"] == "a copy");
  CHECK(found["m/photos/2026/a.jpg"] == "b");
  CHECK(fs::read_symlink(target / "link") == "letter.txt");
  REQUIRE(::stat((target / "letter.txt").c_str(), &after) == 0);
  CHECK(before.st_ino == after.st_ino);  // the file itself, for whoever has it open
  CHECK((fs::status(target).permissions() & fs::perms::all) == static_cast<fs::perms>(0750));
  for (const char* name :
       {"m.old", "m.partial", "m.1-2-3.old", "m.12-0123abcd-0.old.txt", "mm.12-0123abcd-0.old"})
    CHECK(found[std::string(name) + "/main.bin"] == "mine");
  CHECK(std::distance(fs::directory_iterator(folder.path), {}) == 6);
}

TEST_CASE("a link is followed, and one to nothing is refused") {
  const test::TemporaryFolder folder;
  fs::create_directories(folder.path / "disk" / "m");
  fs::create_directory_symlink(folder.path / "disk" / "m", folder.path / "link");
  publish(folder.path / "link", "1");
  publish(folder.path / "link", "2");
  CHECK(fs::is_symlink(folder.path / "link"));
  CHECK(bytes(folder.path / "disk" / "m" / "main.bin") == "2");
  CHECK(std::distance(fs::directory_iterator(folder.path / "disk"), {}) == 1);
  fs::create_directory_symlink(folder.path / "nowhere", folder.path / "dangling");
  CHECK_THROWS_WITH_AS(FolderDraft(folder.path / "dangling", kNames), doctest::Contains("does not exist"),
                       InputError);
}

TEST_CASE("what a kill left is put right: the old folder comes back, the user's files too, drafts go") {
  const test::TemporaryFolder folder;
  const fs::path target = folder.path / "m";
  // No process has this number: it is above the largest that Linux gives.
  const auto left = [&](const char* suffix) {
    return folder.path / (std::string("m.4194999-00c0ffee-3.") + suffix);
  };
  // Between the two steps of a file system without exchange.
  fs::create_directories(left("old"));
  write_file(left("old") / "main.bin", "old");
  fs::create_directories(left("partial"));
  write_file(left("partial") / "main.bin", "new");
  write_file(left("partial") / "side.bin.4194999-00c0ffee-4.tmp", "half");
  clear_leftovers(target, kNames);  // nothing is removed while there is no folder
  CHECK(std::distance(fs::directory_iterator(folder.path), {}) == 2);
  CHECK(restore_folder(target, kNames));
  CHECK(bytes(target / "main.bin") == "old");
  // After an exchange, before the user's things were moved.
  write_file(left("partial") / "letter.txt", "dear");
  clear_leftovers(target, kNames);
  CHECK(contents(folder.path) ==
        std::map<std::string, std::string>{{"m", "folder"}, {"m/letter.txt", "dear"}, {"m/main.bin", "old"}});
  CHECK(restore_folder(target, kNames));
  CHECK_FALSE(restore_folder(folder.path / "n", kNames));
}

TEST_CASE("drafts of a process that lives are left to it, and so is what another one has locked") {
  const test::TemporaryFolder folder;
  const fs::path target = folder.path / "m";
  publish(target, "1");
  const FolderDraft draft(target, kNames);  // of this process
  write_file(draft.path() / "main.bin", "2");
  clear_leftovers(target, kNames);
  CHECK(bytes(draft.path() / "main.bin") == "2");
}

TEST_CASE("what is replaced while it is read is read again; what stays as it is is not") {
  const test::TemporaryFolder folder;
  const fs::path target = folder.path / "m";
  publish(target, "1");
  int calls = 0;
  read_unchanged(target, [&] {
    if (++calls > 2) return;
    publish(target, "2");
    throw InputError("m", 0, "is of two states");
  });
  CHECK(calls == 3);
  calls = 0;
  const auto fail = [&] {
    ++calls;
    throw InputError("m", 0, "is damaged");
  };
  CHECK_THROWS_AS(read_unchanged(target, fail), InputError);
  CHECK(calls == 1);
  calls = 0;
  const auto never_still = [&] {
    ++calls;
    publish(target, "3");
    throw InputError("m", 0, "is of two states");
  };
  CHECK_THROWS_AS(read_unchanged(target, never_still), InputError);
  CHECK(calls < 100);
}

TEST_CASE("a mount point is refused before the work, not after it") {
  struct stat inside {
  }, outside{};
  if (::stat("/proc", &inside) != 0 || ::stat("/", &outside) != 0 || inside.st_dev == outside.st_dev) return;
  CHECK_THROWS_WITH_AS(FolderDraft("/proc", kNames), doctest::Contains("mount point"), InputError);
}
