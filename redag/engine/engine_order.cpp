// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's part in an order that several executors share: it states its rates, reads those of the others several
// times a second, and moves its threads to the priorities that follow.
#include <algorithm>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/engine/engine.hpp"
#include "redag/threads/clock.hpp"

namespace redag::runtime {
namespace {

// Two looks pass from a change to the agreement of all: the one that states it, and the one that reads it.
constexpr Duration kBetweenLooks = 200 * kMillisecond;
// Before ordinary threads, and never before a job.
constexpr int kPriority = 1;

}  // namespace

// Tasks or the order have changed: gives each level the priority of its shortest period. Two levels can get the same
// priority if other executors need the rest.
void Engine::map_levels() {
  if (order_ == CommonOrder()) return;
  std::vector<Duration> shortest;
  for (std::size_t i = 0; i < tasks_.size(); ++i) {
    const std::uint32_t level = scheduler_->level(TaskId(i));
    if (level == sched::kNoLevel) continue;
    if (level >= shortest.size()) shortest.resize(level + 1, kNever);
    const TaskEntry &task = tasks_[TaskId(i)];
    const std::optional<Duration> rate = rate_of(options_.config.policy, task.period, task.deadline);
    if (rate) shortest[level] = std::min(shortest[level], *rate);
  }
  std::vector<int> priorities;
  for (const Duration rate : shortest) {
    const bool is_used = rate != kNever || priorities.empty();
    priorities.push_back(is_used ? order_.priority_of(rate) : priorities.back());
  }
  placement_.set_levels(std::move(priorities));
  if (placement_.of_releases() > placement_.of_leader()) move_releases();
}

// Gives the release thread, and the leader in its place, the priority that follows from the levels. If it rises, that
// comes before the jobs' new priorities, and otherwise after them.
void Engine::move_releases() {
  if (!os() || releases_ == nullptr) return;
  const int priority = placement_.of_releases();
  if (!releases_->set_priority(priority)) placement_.count_refused();
  placement_.set_leader(priority);
}

// Replaces what the engine states of its rates, if tasks have changed since the last call.
void Engine::update_statement() {
  std::vector<Duration> &rates = statement_.rates;
  {
    const LockGuard guard(lock_);
    if (!std::exchange(rates_changed_, false)) return;
    rates.clear();
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      const TaskEntry &task = tasks_[TaskId(i)];
      if (task.removed) continue;
      if (const auto rate = rate_of(options_.config.policy, task.period, task.deadline)) rates.push_back(*rate);
    }
  }
  make_statable(rates);
}

Result<void> Engine::start_order() {
  Result<std::unique_ptr<live::OwnOrderPage>> page = live::OwnOrderPage::open(options_.order_folder);
  if (!page) return tl::unexpected(page.error());
  order_page_ = *std::move(page);
  statement_.top_job = options_.band.top_job;
  // The first job already has its place in the common order.
  if (Result<void> stated = look_at_order(); !stated) return stated;
  return start_helper(*order_thread_, "order", kPriority, [this] { follow_order(); });
}

void Engine::follow_order() noexcept {
  for (;;) {
    order_thread_->parker.park_until(monotonic_now() + kBetweenLooks);
    if (pool_.ending()) return;
    const Result<void> stated = look_at_order();
    std::string problem = stated ? "" : to_string(stated.error());
    const LockGuard guard(lock_);
    order_problem_.swap(problem);
  }
}

Result<void> Engine::look_at_order() {
  update_statement();
  OrderLook look = look_at({order_page_->name(), statement_}, live::read_order_pages(options_.order_folder));
  {
    const LockGuard guard(lock_);
    if (look.order != order_) {
      order_ = std::move(look.order);
      map_levels();
      placement_.follow_levels();
    }
    // The engine's most urgent rate may have gone, and the order be the same.
    if (placement_.of_releases() < placement_.of_leader()) move_releases();
  }
  return look.must_publish ? order_page_->publish(statement_) : Result<void>();
}

}  // namespace redag::runtime
