// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/machine_load.hpp"

#include <sched.h>
#include <unistd.h>

#include <cstdint>

#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"

namespace redag::lab {

MachineLoad::~MachineLoad() {
  stop_.store(true);
  for (runtime::ThreadHandle &thread : threads_) thread.join();
}

Result<void> MachineLoad::start(std::size_t threads) {
  for (std::size_t i = 0; i < threads; ++i) {
    Result<runtime::ThreadHandle> started = runtime::start_thread({"redag-load", 0, {}}, [this] { main(); });
    if (!started) return tl::unexpected(started.error());
    threads_.push_back(*std::move(started));
  }
  return {};
}

void MachineLoad::main() noexcept {
  // The memory exceeds a processor's caches, which evicts the jobs' data.
  std::vector<std::uint64_t> memory(std::size_t{1} << 20U);
  runtime::Event never;
  for (std::uint64_t round = 0; !stop_.load(); ++round) {
    for (std::uint64_t &word : memory) word = word * 3 + round;
    for (int i = 0; i < 100; ++i) (void)getppid();
    sched_yield();
    if (round % 16 == 0) never.wait_until(runtime::monotonic_now() + 100 * kMicrosecond);
  }
}

}  // namespace redag::lab
