// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/miss_reporter.hpp"

#include <utility>

namespace redag::runtime {
namespace {

thread_local const MissReporter *reporter_of_this_thread = nullptr;

}  // namespace

bool MissReporter::is_this_thread() const { return reporter_of_this_thread == this; }

Result<void> MissReporter::start(const ThreadSetup &setup) {
  if (thread_.joinable()) return {};
  return start_thread(setup, [this] { main(); }).map([this](ThreadHandle &&thread) { thread_ = std::move(thread); });
}

void MissReporter::stop() {
  if (!thread_.joinable()) return;
  stopping_.store(true, std::memory_order_release);
  log_.parker().unpark();
  thread_.join();
}

void MissReporter::main() noexcept {
  reporter_of_this_thread = this;
  for (;;) {
    // Read before the log: what was noted before stop() is reported.
    const bool stopping = stopping_.load(std::memory_order_acquire);
    while (const std::optional<Miss> miss = log_.take()) report_(*miss, log_.dropped());
    if (stopping) return;
    log_.parker().park();
  }
}

}  // namespace redag::runtime
