// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Part of builds with sanitizers: threads have their SCHED_FIFO priorities in name only. The kernel answers that it has
// set a priority, but does not set it. pthread_getschedparam() returns the requested priority, because the C library
// stores it. The reason is that a sanitizer's own locks spin and yield. A real-time thread that waits for such a lock
// never yields to the less urgent thread that holds it. With one processor, both then stand still for ever. The faults
// that sanitizers find do not depend on priorities. Builds without sanitizers test what does.
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

// The linker pulls this function in by its name; no code calls it.
extern "C" [[gnu::constructor]] void redag_nominal_priorities() {
  const sched_param parameters{};
  constexpr int kNoPolicy = -1;
  if (sched_setscheduler(0, kNoPolicy, &parameters) == 0) return;  // done by the parent process or a shared library

  std::array filter{
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_sched_setscheduler, 0, 1),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO),  // error 0, which means success
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog program{filter.size(), filter.data()};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0) return;
  std::perror("a program with sanitizers needs seccomp filters (redag/cmake/nominal_priorities.cpp)");
  std::abort();
}
