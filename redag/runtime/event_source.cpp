// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/event_source.hpp"

#include <stdexcept>

#include "redag/base/check.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/engine/engine.hpp"

namespace redag::runtime {

void EventSource::connect(Engine &engine, TaskId task) {
  const LockGuard guard(lock_);
  REDAG_CHECK(engine_ == nullptr, "an event belongs to one engine at a time");
  engine_ = &engine;
  task_ = task;
  open_ = false;
  earliest_ = 0;
  early_count_ = 0;
}

bool EventSource::is_connected() const {
  const LockGuard guard(lock_);
  return engine_ != nullptr;
}

void EventSource::open() {
  const LockGuard guard(lock_);
  open_ = true;
}

void EventSource::disconnect() {
  const LockGuard guard(lock_);
  engine_ = nullptr;
}

// The lock is held during the release. When disconnect() gets it, no release is under way.
bool EventSource::release(const Engine &engine) {
  const LockGuard guard(lock_);
  if (engine_ == nullptr || engine_ != &engine) {
    throw std::logic_error("Executor::release(): " + place_ +
                           (engine_ == nullptr
                                ? " is in no executor (add() its DagBuilder first)"
                                : " is in another executor (use the executor that add() was called on)"));
  }
  const Time now = engine_->now();
  if (!open_ || now < 0 || engine_->halting()) return false;
  const bool is_early = now < earliest_;
  if (is_early) ++early_count_;
  if (is_early && early_ == EarlyRelease::Skip) {
    engine_->miss(task_, now, Reason::Overrun);
    return false;
  }
  earliest_ = now + min_interval_;
  engine_->release(Release{.task = task_, .nominal = now}, now);
  return true;
}

std::uint64_t EventSource::early() const {
  const LockGuard guard(lock_);
  return early_count_;
}

}  // namespace redag::runtime
