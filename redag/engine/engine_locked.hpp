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

/// Holds the engine's lock. Wakes threads, reports skips and destroys a body after releasing it. Most decisions have
/// none of these.
class REDAG_SCOPED_CAPABILITY Engine::Locked {
 public:
  explicit Locked(Engine &engine) REDAG_ACQUIRE(engine.lock_)
      : engine_(engine), wake_ups_(engine.realtime_), at_once_(engine.lock_.lock()) {}
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
    if (!released_) static_cast<void>(release());
  }
  Locked(const Locked &) = delete;
  Locked &operator=(const Locked &) = delete;

  /// Releases the lock before the end. Returns true if the thread slept for the lock, or woke others. Both can take
  /// longer than a short job. A thread that has slept for the lock cannot know whether others do: its unlock() wakes.
  bool release() REDAG_RELEASE() {
    released_ = true;
    const bool woke = engine_.lock_.unlock();
    const bool delayed = woke || wake_ups_.any();
    if (wake_ups_.any() || has_skips_) wake_and_tell();
    return delayed;
  }

  /// Allocates only if one decision skips more than kFewSkips jobs (HI mode begins or ends, a DAG goes).
  void tell(std::shared_ptr<SkipListener> listener, Reason reason) {
    if (!has_skips_) begin_skips();
    if (skips_.count < kFewSkips) {
      skips_.few[skips_.count++] = Skip{std::move(listener), reason};
    } else {
      skips_.more.push_back(Skip{std::move(listener), reason});
    }
  }
  /// Has the body, which is the user's code, destroyed without the lock.
  void destroy(Body &body) {
    if (!has_skips_) begin_skips();
    skips_.doomed.swap(body);
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
    Body doomed;
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
  WakeUps wake_ups_;
  bool at_once_ = true;  // the lock was free
  bool has_skips_ = false;
  bool released_ = false;
  union {
    // Constructed only with has_skips_: most decisions skip nothing.
    Skips skips_;  // NOLINT(readability-identifier-naming): a private member, of a union without a name
  };
};

}  // namespace redag::runtime
