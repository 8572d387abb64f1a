// SPDX-License-Identifier: BSD-3-Clause
// Runs something in a process of its own and kills it before its n-th system call.
#pragma once

#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdio>

namespace dynslam::test {

/// From now on renameat2() with flags fails in this process, as on NFS and FAT. @return whether that can be
/// had
inline bool forbid_exchange() {
  const std::array<sock_filter, 6> program{{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, __NR_renameat2, 0, 3),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, args[4])),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, 0, 1, 0),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EINVAL),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  }};
  const sock_fprog filter{program.size(), const_cast<sock_filter*>(program.data())};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

enum class Child {
  killed,      ///< before the call
  done,        ///< it made fewer calls, and ended well
  failed,      ///< it ended otherwise
  untraceable  ///< this system does not let it be watched
};

/// Forks; the child runs `work` and is killed where it enters its `call`-th system call (1: the first).
/// @param call  0: it is let through
template <class Work>
Child run_and_kill(int call, Work&& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    if (::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) ::_exit(77);
    ::raise(SIGSTOP);
    try {
      work();
    } catch (...) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 0;
  const auto ended = [&] {
    if (WIFSIGNALED(status)) return Child::killed;
    if (WEXITSTATUS(status) == 77) return Child::untraceable;
    return WEXITSTATUS(status) == 0 ? Child::done : Child::failed;
  };
  ::waitpid(child, &status, 0);
  if (!WIFSTOPPED(status)) return ended();
  ::ptrace(PTRACE_SETOPTIONS, child, nullptr, PTRACE_O_EXITKILL | PTRACE_O_TRACESYSGOOD);
  int entered = 0;
  for (bool entering = true;; entering = !entering) {
    ::ptrace(call == 0 ? PTRACE_CONT : PTRACE_SYSCALL, child, nullptr, 0);
    ::waitpid(child, &status, 0);
    if (!WIFSTOPPED(status)) return ended();
    if (WSTOPSIG(status) != (SIGTRAP | 0x80)) {
      entering = !entering;  // a signal, not a call
      continue;
    }
    if (entering && ++entered == call) {
      ::kill(child, SIGKILL);
      ::waitpid(child, &status, 0);
      return Child::killed;
    }
  }
}

}  // namespace dynslam::test
