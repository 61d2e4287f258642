// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <utility>

#include "redag_analysis/any_features/demand.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"

namespace redag::analysis::any_features {
namespace {

// The time of a window in which the job waits for others.
struct Parts {
  Duration apart = 0;    // while a worker can be idle
  Duration workers = 0;  // while all workers are busy
};

// The most instants y in which all workers execute this work: m y <= sum min(work, width y).
// `is_mixed`: the others can execute something else.
Duration share(const std::vector<std::pair<Duration, Duration>> &works, Duration workers, bool is_mixed) {
  Duration most = kUnbounded;
  for (int i = 0; i < (is_mixed ? 1 : 100); ++i) {
    Int128 sum = 0;
    for (const auto &[work, width] : works) sum += std::min(Int128{work}, Int128{width} * most);
    const Duration next = saturate(sum / workers);
    if (next >= most) break;
    most = next;
  }
  return most;
}

// The window of one job of a task, and of its task's jobs before it.
class Window {
 public:
  Window(const Demand &demand, std::uint32_t t, bool all)
      : demand_(demand),
        task_set_(demand.task_set),
        t_(t),
        own_(demand.task(t)),
        rivals_(rivals_of(task_set_, demand.few_threads, t, all, false)) {
    bool waits = false;
    for (std::uint32_t o = 0; o < task_set_.tasks.size(); ++o) {
      const CompiledTask &other = task_set_.tasks[o];
      waits = waits || (rivals_.fills[o] && other.wake_ups > 0);
      // A job can lie under others on its worker while further workers are idle.
      const bool can_lie = other.region < executes(other) || other.wake_ups > 0;
      if (task_set_.mode == sched::Preemption::Cooperative && (o == t || rivals_.are_beside(o)) && can_lie) {
        rivals_.divisor = 1;
      }
    }
    rivals_.fills_apart = rivals_.cap > 0 && (rivals_.cap < rivals_.divisor || waits);
  }

  [[nodiscard]] std::optional<Duration> length() const {
    const bool is_plain = !own_.data && own_.predecessors.empty();
    const Duration queued = std::max<Duration>(1, own_.limit / own_.period);
    for (const Duration earlier : {Duration{0}, own_.at_once + queued - 1}) {
      if (earlier == 0 && (!is_plain || own_.at_once > 1)) continue;
      const Duration whole = add(executes(own_), away(own_));
      const std::optional<Duration> one = fixed_point([&](Duration x) {
        const Parts parts = evaluate(earlier, x);
        return add(multiply(whole, earlier + 1), add(parts.apart, parts.workers));
      });
      const std::optional<Duration> parts = earlier == 0 ? stretch_by_stretch() : std::nullopt;
      const Duration least = std::min(one.value_or(kUnbounded), parts.value_or(kUnbounded));
      // Without earlier jobs, the response has to end before the next release.
      if (least < kUnbounded && (earlier > 0 || add(least, own_.jitter) <= own_.period)) return least;
    }
    return std::nullopt;
  }

 private:
  template <class Next>
  [[nodiscard]] std::optional<Duration> fixed_point(Next next) const {
    Duration x = 1;
    return global::least_fixed_point(demand_.stop, x, next) ? std::optional(x) : std::nullopt;
  }

  // A window for each stretch of execution and each request to a device. Others delay it only in these.
  [[nodiscard]] std::optional<Duration> stretch_by_stretch() const {
    const bool is_alone = own_.group == kNoGroup && rivals_.cap == 0 && !demand_.few_threads;
    if (own_.wake_ups == 0 || !is_alone) return std::nullopt;
    Duration sum = own_.elsewhere;
    for (const Duration stretch : own_.stretches) {
      const auto found = fixed_point([&](Duration x) { return add(stretch, evaluate(0, x).workers); });
      if (!found) return std::nullopt;
      sum = add(sum, *found);
    }
    for (std::size_t d = 0; d < task_set_.devices.size(); ++d) {
      if (!uses(own_, d)) continue;
      const DeviceUse &use = own_.devices[d];
      const auto found = fixed_point([&](Duration x) { return add(use.longest, queue_at(d, 1, x)); });
      if (!found) return std::nullopt;
      sum = add(sum, multiply(*found, use.requests));
    }
    return sum;
  }

  // Each tick that others execute counts once: where it can delay the job the most.
  [[nodiscard]] Parts evaluate(Duration earlier, Duration x) const {
    const std::size_t count = task_set_.tasks.size();
    Effort::spend(count);
    Parts parts;
    const Duration together = std::min<Duration>(rivals_.cap, rivals_.divisor);
    Duration in_dag = 0;
    Duration epochs = multiply(1 + own_.wake_ups, earlier + 1);
    Duration holder = 0;
    std::vector<std::pair<Duration, Duration>> rest;  // work, width
    for (std::uint32_t o = 0; o < count; ++o) {
      if (o == t_ || !(rivals_.first[o] || rivals_.are_beside(o))) continue;
      const CompiledTask &other = task_set_.tasks[o];
      if (rivals_.held_for[o] && rivals_.finds_one && place_of(task_set_, o) > place_of(task_set_, t_)) {
        holder = std::max(holder, multiply(add(executes(other), away(other)), earlier + 1));
        epochs = add(epochs, multiply(1 + other.wake_ups, earlier + 1));
        continue;
      }
      const Duration jobs = demand_.active(o, x);
      if (rivals_.are_beside(o)) epochs = add(epochs, multiply(jobs, 1 + other.wake_ups));
      const Duration waits = multiply(jobs, away(other));
      const Duration work = multiply(jobs, executes(other));
      if (rivals_.held_for[o]) {
        parts.apart = add(parts.apart, add(work, waits));
      } else if (rivals_.fills[o]) {
        in_dag = add(in_dag, add(waits, rivals_.fills_apart ? work : 0));
      } else if (demand_.few_threads) {
        parts.apart = add(parts.apart, waits);
      }
      if (rivals_.held_for[o] || (rivals_.fills[o] && rivals_.fills_apart)) continue;
      rest.emplace_back(work, other.at_once);
    }
    parts.apart = add(parts.apart, holder);
    if (in_dag > 0) parts.apart = add(parts.apart, in_dag / together);
    for (const std::vector<std::uint32_t> &group : task_set_.groups) {
      const Duration work = lifted_work(
          task_set_, group, rivals_, [&](std::uint32_t o) { return demand_.active(o, x); },
          [&](std::uint32_t o) { return o == t_ ? 0 : executes(task_set_.tasks[o]); });
      if (work > 0) rest.emplace_back(work, 1);
    }
    for (std::size_t d = 0; d < task_set_.devices.size(); ++d) {
      const Duration requests = uses(own_, d) ? multiply(own_.devices[d].requests, earlier + 1) : 0;
      parts.apart = add(parts.apart, queue_at(d, requests, x));
    }
    if (rivals_.blocking > 0) rest.emplace_back(multiply(rivals_.blocking, epochs), rivals_.divisor);
    // Where jobs of the DAG count for less than an instant each, other workers can execute the rest in that instant.
    parts.workers = share(rest, rivals_.divisor, rivals_.fills_apart && together > 1);
    return parts;
  }

  // While a job is in the queue of a device, all its slots serve others. Of less urgent tasks, these are services that
  // had begun before one of the own `requests` came; in a queue of requests, those that had come before.
  [[nodiscard]] Duration queue_at(std::size_t device, Duration requests, Duration x) const {
    const Device &served_by = task_set_.devices[device];
    bool is_asked = requests > 0;
    bool is_alone = true;  // no other job matters that can be in the queue
    Duration served = 0;
    Duration later = 0;    // of tasks that do not go first
    Duration longest = 0;  // one of them
    Duration before = 0;   // one request of each unfinished job
    for (std::uint32_t o = 0; o < task_set_.tasks.size(); ++o) {
      const CompiledTask &other = task_set_.tasks[o];
      if (o == t_ || !uses(other, device)) continue;
      const bool is_in_queue = rivals_.are_beside(o) || demand_.few_threads;
      is_asked = is_asked || is_in_queue;
      is_alone = is_alone && !is_in_queue;
      // What counts in full already does not count again.
      if (rivals_.held_for[o] || (rivals_.fills[o] && rivals_.cap <= served_by.slots) ||
          (demand_.few_threads && !rivals_.fills[o]))
        continue;
      const DeviceUse &use = other.devices[device];
      const Duration work = multiply(demand_.active(o, x), use.service);
      before = add(before, multiply(other.at_once, use.longest));
      if (rivals_.first[o] || rivals_.lifted[o]) {
        served = add(served, work);
      } else {
        later = add(later, work);
        longest = std::max(longest, use.longest);
      }
    }
    if (!is_asked) return 0;
    if (served_by.queue == Device::Queue::Priority && is_alone) {
      later = std::min(later, multiply(longest, multiply(requests, served_by.slots)));
    }
    served = add(served, later);
    if (served_by.queue == Device::Queue::Fifo && is_alone) served = std::min(served, multiply(before, requests));
    return served / served_by.slots;
  }

  const Demand &demand_;
  const TaskSet &task_set_;
  std::uint32_t t_;
  const CompiledTask &own_;
  Rivals rivals_;
};

}  // namespace

std::optional<Duration> window_of(const Demand &demand, std::uint32_t t, bool all) {
  return Window(demand, t, all).length();
}

}  // namespace redag::analysis::any_features
