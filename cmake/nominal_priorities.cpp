// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Part of builds with sanitizers: threads have the SCHED_FIFO priorities that they are given in name only. The kernel
// answers that it has set them, and does not; pthread_getschedparam() says what was asked for, since the C library
// keeps it. A sanitizer's own locks spin and yield: a real-time thread that waits for one never yields to the thread
// below it that holds it, and both stand still for ever where they have one processor. What sanitizers look for does
// not depend on priorities; what does is tested in the builds without.
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

// Linked into every program by this name: nothing calls it.
extern "C" [[gnu::constructor]] void redag_nominal_priorities() {
  const sched_param parameters{};
  constexpr int kNoPolicy = -1;
  if (sched_setscheduler(0, kNoPolicy, &parameters) == 0) return;  // done already, by the parent or a shared library

  std::array filter{
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_sched_setscheduler, 0, 1),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO),  // of error 0: success
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog program{filter.size(), filter.data()};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0) return;
  std::perror("a program with sanitizers needs seccomp filters (cmake/nominal_priorities.cpp)");
  std::abort();
}
