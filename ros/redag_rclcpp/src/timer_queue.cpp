// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "timer_queue.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace redag_rclcpp {
namespace {

bool is_same(Time a, Time b) { return std::max(a, b) < redag::saturated_add(std::min(a, b), TimerQueue::kSame); }

}  // namespace

bool TimerQueue::schedule(Timer &timer, Time due) {
  const redag::LockGuard guard(lock_);
  if (timer.position_ != kNowhere && due != redag::kNever && is_same(timer.due_, due)) return false;
  const Time before = heap_.empty() ? redag::kNever : heap_.front()->due_;
  place(timer, due);
  return !heap_.empty() && heap_.front()->due_ < before;
}

Time TimerQueue::next() const {
  const redag::LockGuard guard(lock_);
  return heap_.empty() ? redag::kNever : heap_.front()->due_;
}

Time TimerQueue::expire_due(Time now, std::vector<redag::runtime::Release> &releases,
                            std::vector<redag::runtime::Release> &missed) {
  const redag::LockGuard guard(lock_);
  while (!heap_.empty() && heap_.front()->due_ <= now) {
    Timer &timer = *heap_.front();
    place(timer, std::max(timer.expire(now, releases, missed), now + 1));
  }
  return heap_.empty() ? redag::kNever : heap_.front()->due_;
}

void TimerQueue::place(Timer &timer, Time due) {
  timer.due_ = due;
  if (due != redag::kNever) {
    if (timer.position_ == kNowhere) {
      heap_.push_back(nullptr);
      set(heap_.size() - 1, &timer);
    }
    sift(timer.position_);
    return;
  }
  if (timer.position_ == kNowhere) return;
  const std::size_t hole = std::exchange(timer.position_, kNowhere);
  Timer *last = heap_.back();
  heap_.pop_back();
  if (last == &timer) return;
  set(hole, last);
  sift(hole);
}

// Moves the entry up or down to its place in the heap.
void TimerQueue::sift(std::size_t position) {
  Timer *timer = heap_[position];
  while (position > 0) {
    const std::size_t parent = (position - 1) / 2;
    if (heap_[parent]->due_ <= timer->due_) break;
    set(position, heap_[parent]);
    position = parent;
  }
  for (;;) {
    std::size_t child = 2 * position + 1;
    if (child >= heap_.size()) break;
    if (child + 1 < heap_.size() && heap_[child + 1]->due_ < heap_[child]->due_) ++child;
    if (timer->due_ <= heap_[child]->due_) break;
    set(position, heap_[child]);
    position = child;
  }
  set(position, timer);
}

void TimerQueue::set(std::size_t position, Timer *timer) {
  heap_[position] = timer;
  timer->position_ = position;
}

}  // namespace redag_rclcpp
