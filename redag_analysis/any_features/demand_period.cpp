// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>

#include "redag_analysis/any_features/demand.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"

namespace redag::analysis::any_features {
namespace {

constexpr int kMostQueued = 10'000;  // jobs of a task in one busy period

// The busy period of a task's level on one worker.
class Period {
 public:
  Period(const Demand &demand, std::uint32_t t, bool all)
      : demand_(demand),
        task_set_(demand.task_set),
        t_(t),
        level_(rivals_of(task_set_, demand.few_threads, t, all, true)),
        counts_(task_set_.tasks.size()),
        costs_(task_set_.tasks.size(), 0) {
    std::vector<bool> known(counts_.size(), false);
    for (std::uint32_t o = 0; o < counts_.size(); ++o) {
      const CompiledTask &other = task_set_.tasks[o];
      count_begun(o, known);
      costs_[o] = add(add(executes(other), away(other)), multiply(level_.blocking, other.wake_ups));
      if (level_.first[o]) load_ += static_cast<double>(costs_[o]) / static_cast<double>(counts_[o].period);
    }
  }

  [[nodiscard]] std::optional<Duration> response() const {
    if (load_ >= 1.0) return std::nullopt;
    Duration length = 1;
    if (!global::least_fixed_point(demand_.stop, length, [&](Duration window) { return demand(window, 0); })) {
      return std::nullopt;
    }
    if (demand_.task(t_).at_once > 1) return length;
    const Duration jobs = counts_[t_].in(length - 1);
    if (jobs > kMostQueued) return length;
    Duration longest = 0;
    Duration window = 1;
    for (Duration q = 0; q < jobs; ++q) {
      if (!global::least_fixed_point(demand_.stop, window, [&](Duration w) { return demand(w, q + 1); })) return length;
      longest = std::max(longest, window - std::min(window, counts_[t_].earliest(q + 1)));
    }
    return longest;
  }

 private:
  // What becomes ready in a busy period of the level, in a closed window that begins with it.
  void count_begun(std::uint32_t o, std::vector<bool> &known) {
    if (known[o]) return;
    known[o] = true;
    const CompiledTask &task = task_set_.tasks[o];
    counts_[o] = demand_.released[o];
    const bool stays = level_.first[o] && (level_.all || !task.can_sink);
    if (!stays) {
      // Its jobs can have been unfinished before the period began.
      counts_[o].more = add(counts_[o].more, unfinished(task));
    } else if (waits_for_data(task)) {
      // One can have been released before the period.
      counts_[o].more = add(counts_[o].more, 1);
    } else if (task.data) {
      std::optional<JobCount> least;
      for (const std::uint32_t p : task.predecessors) {
        count_begun(p, known);
        JobCount ends = counts_[p];
        if (task.predecessors.size() > 1) ends.more = add(ends.more, 1);
        least = least ? rarer(ends, *least) : ends;
      }
      if (least) counts_[o] = *least;
    }
  }

  [[nodiscard]] Duration demand(Duration window, Duration own_jobs) const {
    const std::size_t count = counts_.size();
    Effort::spend(count);
    Duration sum = level_.blocking;
    for (std::uint32_t o = 0; o < count; ++o) {
      if (!level_.first[o]) continue;
      const Duration jobs = o == t_ && own_jobs > 0 ? own_jobs : counts_[o].in(window - 1);
      sum = add(sum, multiply(jobs, costs_[o]));
    }
    for (const std::vector<std::uint32_t> &group : task_set_.groups) {
      // While no job waits, none that is less urgent starts in the period: it contains one holder.
      const Duration most = demand_.has_waits ? kUnbounded : longest_lifted(group);
      const Duration work = lifted_work(
          task_set_, group, level_, [&](std::uint32_t o) { return counts_[o].in(window - 1); },
          [&](std::uint32_t o) { return costs_[o]; });
      sum = add(sum, std::min(most, work));
    }
    for (std::size_t d = 0; d < task_set_.devices.size(); ++d) sum = add(sum, served_before(d, window));
    return sum;
  }

  [[nodiscard]] Duration longest_lifted(const std::vector<std::uint32_t> &group) const {
    Duration longest = 0;
    for (const std::uint32_t o : group) longest = std::max(longest, level_.lifted[o] ? costs_[o] - 1 : 0);
    return longest;
  }

  // Service of others than the level's tasks for which its jobs can wait in the queue of a device: as the window says,
  // for each request of the level.
  [[nodiscard]] Duration served_before(std::size_t device, Duration window) const {
    Duration served = 0;
    Duration longest = 0;
    Duration before = 0;
    Duration requests = 0;
    bool is_ordered = true;
    for (std::uint32_t o = 0; o < counts_.size(); ++o) {
      const CompiledTask &other = task_set_.tasks[o];
      if (!uses(other, device)) continue;
      const DeviceUse &use = other.devices[device];
      if (level_.first[o] || level_.lifted[o]) {
        requests = add(requests, multiply(counts_[o].in(window - 1), use.requests));
        is_ordered = is_ordered && level_.first[o] && !other.can_sink;
      } else {
        served = add(served, multiply(demand_.active(o, window), use.service));
        longest = std::max(longest, use.longest);
        before = add(before, multiply(other.at_once, use.longest));
      }
    }
    const bool is_fifo = task_set_.devices[device].queue == Device::Queue::Fifo;
    if (is_fifo || is_ordered) served = std::min(served, multiply(requests, is_fifo ? before : longest));
    return requests > 0 ? served : 0;
  }

  const Demand &demand_;
  const TaskSet &task_set_;
  std::uint32_t t_;
  Rivals level_;
  std::vector<JobCount> counts_;  // of jobs that become ready in the period
  std::vector<Duration> costs_;
  double load_ = 0;
};

}  // namespace

std::optional<Duration> busy_period_of(const Demand &demand, std::uint32_t t, bool all) {
  return Period(demand, t, all).response();
}

}  // namespace redag::analysis::any_features
