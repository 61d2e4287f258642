// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/shared_order.hpp"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/threads/clock.hpp"

namespace redag::runtime {
namespace {

// Two looks pass from a change to the agreement of all: the one that states it, and the one that reads it.
constexpr Duration kBetweenLooks = 200 * kMillisecond;
// Before ordinary threads, and never before a job.
constexpr int kPriority = 1;

}  // namespace

// Gives each level the priority of its shortest period. Two levels can get the same
// priority if other executors need the rest.
void SharedOrder::map_levels() {
  if (order_ == CommonOrder()) return;
  std::vector<Duration> shortest;
  for (std::size_t i = 0; i < parts_.tasks.size(); ++i) {
    const std::uint32_t level = parts_.scheduler.level(TaskId(i));
    if (level == sched::kNoLevel) continue;
    if (level >= shortest.size()) shortest.resize(level + 1, kNever);
    const TaskEntry &task = parts_.tasks[TaskId(i)];
    const std::optional<Duration> rate = rate_of(policy_, task.period, task.deadline);
    if (rate) shortest[level] = std::min(shortest[level], *rate);
  }
  std::vector<int> priorities;
  for (const Duration rate : shortest) {
    const bool is_used = rate != kNever || priorities.empty();
    priorities.push_back(is_used ? order_.priority_of(rate) : priorities.back());
  }
  parts_.placement.set_levels(std::move(priorities));
  if (parts_.placement.of_releases() > parts_.placement.of_leader()) move_releases(releases_);
}

// If the priority rises, that comes before the jobs' new priorities, and otherwise after them.
void SharedOrder::move_releases(ReleaseThread *thread) {
  releases_ = thread;
  if (thread == nullptr) return;
  const int priority = parts_.placement.of_releases();
  if (!thread->set_priority(priority)) parts_.placement.count_refused();
  parts_.placement.set_leader(priority);
}

void SharedOrder::tasks_changed() {
  rates_changed_ = true;
  map_levels();
}

// Replaces what the executor states of its rates, if tasks have changed since the last call.
void SharedOrder::update_statement() {
  std::vector<Duration> &rates = statement_.rates;
  {
    const LockGuard guard(parts_.lock);
    if (!std::exchange(rates_changed_, false)) return;
    rates.clear();
    for (std::size_t i = 0; i < parts_.tasks.size(); ++i) {
      const TaskEntry &task = parts_.tasks[TaskId(i)];
      if (task.removed) continue;
      if (const auto rate = rate_of(policy_, task.period, task.deadline)) rates.push_back(*rate);
    }
  }
  make_statable(rates);
}

Result<void> SharedOrder::start(const std::string &folder, int top_job, const std::string &thread_name) {
  Result<std::unique_ptr<live::OwnOrderPage>> page = live::OwnOrderPage::open(folder);
  if (!page) return tl::unexpected(page.error());
  page_ = *std::move(page);
  folder_ = folder;
  statement_.top_job = top_job;
  if (Result<void> stated = look(); !stated) return stated;
  return thread_.start({thread_name, kPriority, {}}, [this] { follow(); });
}

void SharedOrder::end() {
  thread_.end();
  page_.reset();
}

void SharedOrder::follow() noexcept {
  for (;;) {
    thread_.parker.park_until(monotonic_now() + kBetweenLooks);
    if (thread_.ending()) return;
    const Result<void> stated = look();
    std::string problem = stated ? "" : to_string(stated.error());
    const LockGuard guard(parts_.lock);
    problem_.swap(problem);
  }
}

Result<void> SharedOrder::look() {
  update_statement();
  OrderLook seen = look_at({page_->name(), statement_}, live::read_order_pages(folder_));
  {
    const LockGuard guard(parts_.lock);
    if (seen.order != order_) {
      order_ = std::move(seen.order);
      map_levels();
      parts_.placement.follow_levels();
    }
    // The executor's most urgent rate may have gone, and the order be the same.
    if (parts_.placement.of_releases() < parts_.placement.of_leader()) move_releases(releases_);
  }
  return seen.must_publish ? page_->publish(statement_) : Result<void>();
}

}  // namespace redag::runtime
