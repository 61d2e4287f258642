// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What an AsyncEvent knows: whether it is set, and who waits for it. Any thread; the lock, which inherits priority, is
// taken below the engine's. Nothing here allocates.
#pragma once

#include "redag/base/pi_mutex.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/engine/coroutine.hpp"

namespace redag::runtime::detail {

struct EventState {
  /// Returns false, and resets the event, if it is set. Otherwise the wait goes on until set_or_take_all().
  [[nodiscard]] bool add(Wait &wait) REDAG_EXCLUDES(lock);
  /// Returns false if that wait has been taken. Its job is about to be woken.
  [[nodiscard]] bool remove(Wait &wait) REDAG_EXCLUDES(lock);
  /// Returns all waits, linked by Wait::next, whose jobs the caller has to wake. If there is none, sets the event and
  /// returns null.
  [[nodiscard]] Wait *set_or_take_all() REDAG_EXCLUDES(lock);
  /// Resets the event; returns true if it was set.
  [[nodiscard]] bool reset() REDAG_EXCLUDES(lock);

  PiMutex lock{LockClass::Bounded};
  bool is_set REDAG_GUARDED_BY(lock) = false;
  Wait *first REDAG_GUARDED_BY(lock) = nullptr;
};

}  // namespace redag::runtime::detail
