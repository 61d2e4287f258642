// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Counts the system calls of one thread, exactly and without rights: a seccomp filter of the thread reports each call
// to a second thread, which counts it and lets it pass (SECCOMP_USER_NOTIF_FLAG_CONTINUE, Linux 5.5). The filter cannot
// be removed: the counted thread has to end before the counter does.
#pragma once

#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <thread>

namespace redag::testing {

class SystemCalls {
 public:
  SystemCalls() : watcher_([this] { watch(); }) {}
  SystemCalls(const SystemCalls &) = delete;
  SystemCalls &operator=(const SystemCalls &) = delete;
  ~SystemCalls() {
    ending_ = true;
    watcher_.join();
    if (listener_ >= 0) close(listener_);
  }

  /// Counts the calling thread's calls from now on, and those of threads that it starts. Returns false if the system
  /// does not let it: see why().
  bool count_this_thread() {
    // An unprivileged thread may only set a filter if it can never gain rights.
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return fail("PR_SET_NO_NEW_PRIVS");
    sock_filter report{BPF_RET | BPF_K, 0, 0, SECCOMP_RET_USER_NOTIF};
    sock_fprog filter{1, &report};
    const long listener = syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &filter);
    if (listener < 0) return fail("a seccomp filter with a listener");
    listener_ = static_cast<int>(listener);
    return true;
  }
  [[nodiscard]] const std::string &why() const { return why_; }

  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// "futex 3, read 1": numbers of the calls and how often each was made.
  [[nodiscard]] std::string list() {
    const std::lock_guard guard(lock_);
    std::string list;
    for (const auto &[number, times] : calls_) {
      list += (list.empty() ? "call " : ", call ") + std::to_string(number) + ": " + std::to_string(times) + " times";
    }
    return list;
  }

 private:
  bool fail(const std::string &what) {
    why_ = what + ": " + std::strerror(errno);
    return false;
  }

  void watch() {
    while (!ending_) {
      if (listener_ < 0) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        continue;
      }
      pollfd ready{listener_, POLLIN, 0};
      if (poll(&ready, 1, 10) <= 0) continue;
      if ((ready.revents & POLLIN) == 0) return;  // the counted thread has ended
      seccomp_notif call{};
      if (ioctl(listener_, SECCOMP_IOCTL_NOTIF_RECV, &call) != 0) continue;
      ++count_;
      {
        const std::lock_guard guard(lock_);
        ++calls_[call.data.nr];
      }
      seccomp_notif_resp pass{};
      pass.id = call.id;
      pass.flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE;
      // Fails if a signal ended the call meanwhile.
      static_cast<void>(ioctl(listener_, SECCOMP_IOCTL_NOTIF_SEND, &pass));
    }
  }

  std::atomic<int> listener_{-1};
  std::atomic<bool> ending_{false};
  std::atomic<std::uint64_t> count_{0};
  std::mutex lock_;
  std::map<int, std::uint64_t> calls_;
  std::string why_;
  std::thread watcher_;  // last: it uses the others
};

}  // namespace redag::testing
