// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/throttling_guard.hpp"

#include <algorithm>

namespace redag::runtime {
namespace {

constexpr std::size_t kNowhere = static_cast<std::size_t>(-1);

}  // namespace

void ThrottlingGuard::start(const std::vector<int> &cpus) {
  share_ = RealtimeShare(throttling_, cpus.size());
  busy_.resize(cpus.size());
  for (std::size_t i = 0; i < cpus.size(); ++i) {
    const auto cpu = static_cast<std::size_t>(cpus[i]);
    if (cpu >= places_.size()) places_.resize(cpu + 1, kNowhere);
    places_[cpu] = i;
  }
}

void ThrottlingGuard::note(Time now) {
  note_where_they_ran();
  set_busy(now);
}

Duration ThrottlingGuard::look(Time now, bool can_give_way) {
  note_where_they_ran();
  const bool give_way = share_.used_up(now) && can_give_way;
  if (give_way != placement_.gives_way()) {
    total_ = gave_way(now);
    since_ = now;
    placement_.give_way(give_way);
  }
  set_busy(now);
  is_awake_ = give_way || (placement_.unfinished() > 0 && can_give_way);
  return is_awake_ ? share_.until_change() : kNever;
}

Duration ThrottlingGuard::gave_way(Time now) const {
  return total_ + (placement_.gives_way() ? std::max<Duration>(0, now - since_) : 0);
}

// Returns the index in `share_` of the processor where the thread runs or ran last; kNowhere: unknown.
std::size_t ThrottlingGuard::place_of(const WorkerThread &thread) const {
  const int cpu = processor_of(thread.processor);
  return cpu < 0 || static_cast<std::size_t>(cpu) >= places_.size() ? kNowhere : places_[static_cast<std::size_t>(cpu)];
}

// The kernel chooses where threads run, and moves them only when a thread begins or stops to run. A thread is charged
// where two consecutive looks find it; each decision is a look.
void ThrottlingGuard::note_where_they_ran() {
  for (const auto &thread : pool_.threads()) {
    if (!thread->is_realtime) continue;
    const std::size_t place = place_of(*thread);
    if (place == kNowhere) {
      share_.ran_everywhere();
      return;
    }
    share_.ran_on(place);
  }
}

void ThrottlingGuard::set_busy(Time now) {
  bool anywhere = false;
  std::fill(busy_.begin(), busy_.end(), false);
  for (const auto &thread : pool_.threads()) {
    thread->is_realtime = placement_.is_realtime(*thread);
    if (!thread->is_realtime || thread->has_mail.load(std::memory_order_relaxed)) continue;  // not awake yet
    const std::size_t place = place_of(*thread);
    anywhere = anywhere || place == kNowhere;
    if (place != kNowhere) busy_[place] = true;
  }
  if (anywhere || busy_.empty()) {
    share_.set_busy(anywhere, now);
  } else {
    share_.set_busy(busy_, now);
  }
}

}  // namespace redag::runtime
