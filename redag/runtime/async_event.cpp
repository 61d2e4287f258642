// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/async_event.hpp"

#include <utility>

#include "redag/base/check.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/engine/engine.hpp"
#include "redag/engine/event_state.hpp"

namespace redag {

AsyncEvent::AsyncEvent() : state_(std::make_unique<runtime::detail::EventState>()) {}

AsyncEvent::~AsyncEvent() {
  REDAG_CHECK(state_->set_or_take_all() == nullptr, "an AsyncEvent is destroyed for which a job waits");
}

void AsyncEvent::set() { runtime::Engine::wake_all(state_->set_or_take_all()); }

void AsyncEvent::set_all(std::span<AsyncEvent *const> events) {
  runtime::detail::Wait *all = nullptr;
  for (AsyncEvent *const event : events) {
    for (runtime::detail::Wait *wait = event->state_->set_or_take_all(); wait != nullptr;) {
      runtime::detail::Wait *const next = wait->next;
      wait->next = std::exchange(all, wait);
      wait = next;
    }
  }
  runtime::Engine::wake_all(all);
}

bool AsyncEvent::take() { return state_->reset(); }

AsyncEvent::Awaiter AsyncEvent::in_coroutine() noexcept {
  return {{.wait = {.kind = runtime::detail::Wait::Kind::Event, .event = state_.get()}}, this};
}

namespace runtime::detail {

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

}  // namespace runtime::detail
}  // namespace redag
