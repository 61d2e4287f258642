// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/async_event.hpp"

#include <utility>

#include "redag/base/check.hpp"
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

}  // namespace redag
