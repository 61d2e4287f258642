// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/event_state.hpp"

#include <utility>

#include "redag/base/lock_guard.hpp"

namespace redag::runtime::detail {

bool EventState::add(Wait &wait) {
  const LockGuard guard(lock);
  if (std::exchange(is_set, false)) return false;
  wait.next = first;
  first = &wait;
  return true;
}

bool EventState::remove(Wait &wait) {
  const LockGuard guard(lock);
  for (Wait **link = &first; *link != nullptr; link = &(*link)->next) {
    if (*link != &wait) continue;
    *link = wait.next;
    return true;
  }
  return false;
}

Wait *EventState::set_or_take_all() {
  const LockGuard guard(lock);
  if (first == nullptr) is_set = true;
  return std::exchange(first, nullptr);
}

bool EventState::reset() {
  const LockGuard guard(lock);
  return std::exchange(is_set, false);
}

}  // namespace redag::runtime::detail
