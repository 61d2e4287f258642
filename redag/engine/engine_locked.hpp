// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's lock, as all its members take it. For engine*.cpp only.
#pragma once

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "redag/engine/engine.hpp"

namespace redag::runtime {

/// Holds the engine's lock. Wakes threads and reports skips after releasing it. Most decisions have neither.
class REDAG_SCOPED_CAPABILITY Engine::Locked {
 public:
  /// `delayed`, if not null, is set at the end: true if the thread slept for the lock, or woke others. Both can take
  /// longer than a short job. A thread that has slept for the lock cannot know whether others do: its unlock() wakes.
  explicit Locked(Engine &engine, bool *delayed = nullptr) REDAG_ACQUIRE(engine.lock_)
      : engine_(engine), delayed_(delayed), wake_ups_(engine.realtime_), at_once_(engine.lock_.lock()) {}
  /// For `releases` releases. Each can skip a ready job and one that waits for its predecessors. Allocates room for
  /// these skips before it takes the lock.
  Locked(Engine &engine, std::size_t releases) REDAG_ACQUIRE(engine.lock_)
      : engine_(engine), wake_ups_(engine.realtime_) {
    if (2 * releases > kFewSkips && engine_.has_listeners_.load(std::memory_order_relaxed)) {
      begin_skips();
      skips_.more.reserve(2 * releases - kFewSkips);
    }
    at_once_ = engine_.lock_.lock();
  }
  ~Locked() REDAG_RELEASE() {
    const bool woke = engine_.lock_.unlock();
    if (delayed_ != nullptr) *delayed_ = woke || wake_ups_.any();
    if (wake_ups_.any() || has_skips_) wake_and_tell();
  }
  Locked(const Locked &) = delete;
  Locked &operator=(const Locked &) = delete;

  /// Allocates only if one decision skips more than kFewSkips jobs (HI mode begins or ends, a DAG goes).
  void tell(std::shared_ptr<SkipListener> listener, Reason reason) {
    if (!has_skips_) begin_skips();
    if (skips_.count < kFewSkips) {
      skips_.few[skips_.count++] = Skip{std::move(listener), reason};
    } else {
      skips_.more.push_back(Skip{std::move(listener), reason});
    }
  }
  /// Drops the skips: the caller itself reported them as missed.
  void tell_nobody() {
    if (has_skips_) end_skips();
  }

  [[nodiscard]] WakeUps &wake_ups() { return wake_ups_; }

  [[nodiscard]] bool waited() const { return !at_once_; }

 private:
  struct Skip {
    std::shared_ptr<SkipListener> listener;
    Reason reason = Reason::None;
  };
  static constexpr std::size_t kFewSkips = 8;
  struct Skips {
    std::array<Skip, kFewSkips> few;  // the first `count` are used
    std::size_t count = 0;
    std::vector<Skip> more;
  };

  [[gnu::noinline]] void wake_and_tell() {
    wake_ups_.wake_late();
    if (!has_skips_) return;
    for (std::size_t i = 0; i < skips_.count; ++i) skips_.few[i].listener->skipped(skips_.few[i].reason);
    for (const Skip &skip : skips_.more) skip.listener->skipped(skip.reason);
    end_skips();
  }
  void begin_skips() {
    std::construct_at(&skips_);
    has_skips_ = true;
  }
  void end_skips() {
    std::destroy_at(&skips_);
    has_skips_ = false;
  }

  Engine &engine_;
  bool *delayed_ = nullptr;
  WakeUps wake_ups_;
  bool at_once_ = true;  // the lock was free
  bool has_skips_ = false;
  union {
    // Constructed only with has_skips_: most decisions skip nothing.
    Skips skips_;  // NOLINT(readability-identifier-naming): a private member, of a union without a name
  };
};

}  // namespace redag::runtime
