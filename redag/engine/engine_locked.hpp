// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's lock, as all its members take it. For engine*.cpp only.
#pragma once

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
      : engine_(engine), wake_ups_(engine.realtime()), delayed_(delayed) {
    at_once_ = engine_.lock_.lock();
  }
  /// For `releases` releases. Each can skip a ready job and one that waits for its predecessors. Allocates room for
  /// these skips before it takes the lock.
  Locked(Engine &engine, std::size_t releases) REDAG_ACQUIRE(engine.lock_)
      : engine_(engine), wake_ups_(engine.realtime()) {
    if (2 * releases > kFewSkips && engine_.has_listeners_.load(std::memory_order_relaxed)) {
      more_skips_.reserve(2 * releases - kFewSkips);
    }
    at_once_ = engine_.lock_.lock();
  }
  ~Locked() REDAG_RELEASE() {
    const bool woke = engine_.lock_.unlock();
    if (delayed_ != nullptr) *delayed_ = woke || wake_ups_.any();
    if (wake_ups_.any() || skip_count_ > 0) wake_and_tell();
  }
  Locked(const Locked &) = delete;
  Locked &operator=(const Locked &) = delete;

  /// Allocates only if one decision skips more than kFewSkips jobs (HI mode begins).
  void tell(std::shared_ptr<SkipListener> listener, Reason reason) {
    if (skip_count_ < kFewSkips) {
      std::construct_at(&few_skips_[skip_count_++], Skip{std::move(listener), reason});
    } else {
      more_skips_.push_back(Skip{std::move(listener), reason});
    }
  }
  /// Drops the skips: the caller itself reported them as missed.
  void tell_nobody() {
    std::destroy_n(few_skips_, skip_count_);
    skip_count_ = 0;
    more_skips_.clear();
  }

  [[nodiscard]] WakeUps &wake_ups() { return wake_ups_; }

  [[nodiscard]] bool waited() const { return !at_once_; }

 private:
  struct Skip {
    std::shared_ptr<SkipListener> listener;
    Reason reason = Reason::None;
  };
  static constexpr std::size_t kFewSkips = 8;

  [[gnu::noinline]] void wake_and_tell() {
    wake_ups_.wake_late();
    for (std::size_t i = 0; i < skip_count_; ++i) {
      few_skips_[i].listener->skipped(few_skips_[i].reason);
      std::destroy_at(&few_skips_[i]);
    }
    for (const Skip &skip : more_skips_) skip.listener->skipped(skip.reason);
  }

  Engine &engine_;
  WakeUps wake_ups_;
  bool *delayed_ = nullptr;
  bool at_once_ = true;  // the lock was free
  union {
    // Only the first skip_count_ are constructed; the others cost nothing.
    Skip few_skips_[kFewSkips];  // NOLINT(readability-identifier-naming): a private member, of a union without a name
  };
  std::size_t skip_count_ = 0;
  std::vector<Skip> more_skips_;
};

}  // namespace redag::runtime
