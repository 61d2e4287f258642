// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "entities/bridge.hpp"

#include <rcl/wait.h>

#include <algorithm>
#include <climits>
#include <utility>

namespace redag_rclcpp {

namespace {

// After a wait that ended for nothing. With rmw_fastrtps, a wait for a QoS event of a subscription ends at once while
// the subscription has messages. Only a job takes these, and a thread that waits again and again is more urgent than
// jobs: it could keep the job from its processor for ever.
constexpr auto kUntilNextWait = std::chrono::milliseconds(1);

}  // namespace

Bridge::Bridge(rclcpp::Context::SharedPtr context)
    : context_(std::move(context)), wake_(context_), set_(rcl_get_zero_initialized_wait_set()) {
  check_rcl(rcl_wait_set_init(&set_, 0, 1, 0, 0, 0, 0, context_->get_rcl_context().get(), rcl_get_default_allocator()),
            "cannot create a wait set");
  watch(wake_);
}

Bridge::~Bridge() {
  if (rcl_wait_set_fini(&set_) != RCL_RET_OK) rcl_reset_error();
}

void Bridge::add(std::shared_ptr<WaitSetMember> member) {
  {
    const redag::LockGuard guard(lock_);
    members_.push_back(std::move(member));
  }
  wake();
}

// Waits until no other thread waits for the member, because it may be attached again at once. With Cyclone DDS,
// setting a subscription's hook can deadlock with a beginning wait for one of its QoS events. The hook holds the
// middleware's lock and wants the reader's. The wait holds the reader's lock and waits for a listener, which wants the
// middleware's lock.
void Bridge::remove(const WaitSetMember &member) {
  std::uint64_t begun = 0;
  {
    const redag::LockGuard guard(lock_);
    const auto found = std::find_if(members_.begin(), members_.end(), [&](auto &m) { return m.get() == &member; });
    if (found == members_.end()) return;
    *found = std::move(members_.back());
    members_.pop_back();
    begun = waits_;
  }
  wake();
  for (;;) {
    const std::uint32_t left = left_.load();
    {
      const redag::LockGuard guard(lock_);
      if (waiter_ == std::thread::id() || waiter_ == std::this_thread::get_id() || waits_ != begun) return;
    }
    redag::futex_wait(left_, left);
  }
}

bool Bridge::empty() const {
  const redag::LockGuard guard(lock_);
  return members_.empty();
}

void Bridge::wake() {
  try {
    wake_.trigger();
  } catch (const rclcpp::exceptions::RCLError &) {
    // The context was shut down, which wakes the waiting thread anyway.
  }
}

void Bridge::wait(std::chrono::nanoseconds timeout) {
  // A thread in remove() still owns a member that `entries` releases. This thread, above all jobs, destroys none, but
  // for an entity whose last other owner goes between the look in keep_dropped() and the release a moment later.
  std::vector<Entry> entries;
  const struct Leave {
    ~Leave() {
      bridge.keep_dropped(entries);
      entries.clear();
      {
        const redag::LockGuard guard(bridge.lock_);
        bridge.waiter_ = {};
      }
      bridge.left_.fetch_add(1);
      redag::futex_wake(bridge.left_, INT_MAX);
    }
    Bridge &bridge;
    std::vector<Entry> &entries;
  } leave{*this, entries};
  {
    const redag::LockGuard guard(lock_);
    for (const auto &member : members_) entries.push_back(Entry{member, member->watched()});
    dropped_.reserve(dropped_.size() + entries.size());
    waiter_ = std::this_thread::get_id();
    ++waits_;
  }
  fill(set_, conditions_, entries);
  const rcl_ret_t result = rcl_wait(&set_, timeout.count() < 0 ? -1 : timeout.count());
  if (result == RCL_RET_TIMEOUT) return;
  check_rcl(result, "waiting failed");

  bool is_any_ready = std::any_of(set_.guard_conditions, set_.guard_conditions + conditions_.size(),
                                  [](const auto *condition) { return condition != nullptr; });
  for (const Entry &entry : entries) {
    if (!entry.held.entity || !entry.member->is_ready(entry.held, set_)) continue;
    is_any_ready = true;
    entry.member->seen_by_wait_set();
  }
  if (!is_any_ready) std::this_thread::sleep_for(kUntilNextWait);
}

// Entities that the program has dropped have no owner but the wait now.
void Bridge::keep_dropped(std::vector<Entry> &entries) {
  const redag::LockGuard guard(lock_);
  for (Entry &entry : entries) {
    if (entry.held.entity.use_count() != 1) continue;
    std::erase(members_, std::exchange(entry.member, nullptr));
    dropped_.push_back(std::move(entry.held));
  }
}

void Bridge::destroy_dropped() {
  std::vector<WaitSetMember::Held> dropped;
  const redag::LockGuard guard(lock_);
  dropped.swap(dropped_);
}

bool Bridge::has_dropped() const {
  const redag::LockGuard guard(lock_);
  return !dropped_.empty();
}

void Bridge::fill(rcl_wait_set_t &set, const std::vector<const rclcpp::GuardCondition *> &conditions,
                  std::vector<Entry> &entries) {
  WaitSetSizes sizes;
  sizes.guard_conditions = conditions.size();
  for (const Entry &entry : entries) {
    if (entry.held.entity) entry.member->count(entry.held, sizes);
  }
  check_rcl(rcl_wait_set_clear(&set), "cannot clear the wait set");
  check_rcl(rcl_wait_set_resize(&set, sizes.subscriptions, sizes.guard_conditions, sizes.timers, sizes.clients,
                                sizes.services, sizes.events),
            "cannot resize the wait set");
  for (const rclcpp::GuardCondition *condition : conditions) {
    check_rcl(rcl_wait_set_add_guard_condition(&set, &condition->get_rcl_guard_condition(), nullptr),
              "cannot wait for a guard condition");
  }
  for (Entry &entry : entries) {
    if (entry.held.entity) entry.member->add(entry.held, set);
  }
}

void find_leftovers(const rclcpp::Context::SharedPtr &context,
                    const std::vector<std::shared_ptr<WaitSetMember>> &members) {
  std::vector<Bridge::Entry> entries;
  for (const auto &member : members) {
    WaitSetMember::Held held = member->hooked();
    if (held.entity) entries.push_back({member, std::move(held)});
  }
  if (entries.empty()) return;
  rcl_wait_set_t set = rcl_get_zero_initialized_wait_set();
  check_rcl(rcl_wait_set_init(&set, 0, 0, 0, 0, 0, 0, context->get_rcl_context().get(), rcl_get_default_allocator()),
            "cannot create a wait set");
  const std::unique_ptr<rcl_wait_set_t, void (*)(rcl_wait_set_t *)> owner(&set, [](rcl_wait_set_t *finished) {
    if (rcl_wait_set_fini(finished) != RCL_RET_OK) rcl_reset_error();
  });
  Bridge::fill(set, {}, entries);
  const rcl_ret_t result = rcl_wait(&set, 0);
  if (result != RCL_RET_TIMEOUT) check_rcl(result, "cannot check for messages");
  for (const Bridge::Entry &entry : entries) {
    entry.member->take_leftovers(entry.held, set, result == RCL_RET_OK);
  }
}

}  // namespace redag_rclcpp
