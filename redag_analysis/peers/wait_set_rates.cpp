// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/peers/wait_set_rates.hpp"

#include <algorithm>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"
#include "redag_analysis/many_workers/global.hpp"
#include "redag_analysis/many_workers/waiting_window.hpp"

namespace redag::analysis {
namespace {

// From a task's arrival to its finish: C, and the shares of others.
struct FromReady {
  Duration response = 0;
  std::vector<Duration> shares;  // of the response, by TaskId
};

struct Callback {
  Duration wcet = 0;
  Duration period = 0;
  Duration ready = 0;     // J: latest arrival after the unit's release
  Duration response = 0;  // R, from arrival to finish
  std::size_t place = 0;  // in the order of registration
};

// All callbacks of an executor, with what is known of them so far. Responses only grow.
class Executor {
 public:
  /// Computes the response of one callback, given `callbacks`; empty if it is above `limit` or no end was found.
  using Respond =
      std::function<std::optional<FromReady>(const std::vector<Callback> &callbacks, std::size_t i, Duration limit)>;

  Executor(const TaskSet &task_set, Respond respond) : task_set_(task_set), respond_(std::move(respond)) {
    callbacks_.resize(task_set.tasks.size());
    std::size_t place = 0;
    for (const bool data : {false, true}) {  // timers before subscriptions, each in the order of TaskIds
      for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
        const CompiledTask &task = task_set.tasks[t];
        if (task.data == data) callbacks_[t] = {task.wcet, task_set.units[task.unit].period, 0, task.wcet, place++};
      }
    }
  }

  Outcome run() {
    const std::string_view absent = solve();
    std::vector<ResponseBound> responses(task_set_.units.size());
    for (std::size_t u = 0; u < responses.size(); ++u) {
      if (absent.empty()) {
        responses[u] = explain(task_set_.units[u]);
      } else {
        responses[u].absent = absent;
      }
    }
    return from_units(task_set_, std::move(responses));
  }

 private:
  // Computes arrival and response of each callback, units in their order and tasks in that of their edges.
  std::string_view solve() {
    std::vector<Duration *> values;
    std::vector<std::uint32_t> whose;
    for (const Unit &unit : task_set_.units) {
      for (const std::uint32_t t : unit.tasks) {
        values.push_back(&callbacks_[t].ready);
        values.push_back(&callbacks_[t].response);
        whose.push_back(t);
      }
    }
    return global::agree(values, "a callback's response time can reach its next release, and then no other bound holds",
                         [&](std::size_t k) {
                           const std::uint32_t t = whose[k / 2];
                           if (k % 2 == 1) return respond(t);
                           callbacks_[t].ready = latest_arrival(t);
                           return true;
                         });
  }

  bool respond(std::uint32_t t) {
    Callback &callback = callbacks_[t];
    const Duration limit = limit_of(task_set_.units[task_set_.tasks[t].unit]) - callback.ready;
    if (limit < callback.wcet) return false;
    Effort::spend(callbacks_.size());
    const auto found = respond_(callbacks_, t, limit);
    if (!found || found->response > limit) return false;
    callback.response = found->response;
    return true;
  }

  static Duration limit_of(const Unit &unit) { return std::min(unit.limit, unit.period); }

  [[nodiscard]] Duration latest_arrival(std::uint32_t t) const {
    const CompiledTask &task = task_set_.tasks[t];
    Duration latest = task.data ? 0 : task.jitter;
    for (const std::uint32_t p : task.predecessors) {
      latest = std::max(latest, add(callbacks_[p].ready, callbacks_[p].response));
    }
    return latest;
  }

  // Goes back from the task that ends last to the one that it waited for, and so on, and sums up what all take.
  [[nodiscard]] ResponseBound explain(const Unit &unit) const {
    const auto end = [&](std::uint32_t t) { return callbacks_[t].ready + callbacks_[t].response; };
    std::uint32_t at = *std::max_element(unit.tasks.begin(), unit.tasks.end(),
                                         [&](std::uint32_t a, std::uint32_t b) { return end(a) < end(b); });
    ResponseBound bound;
    bound.response = end(at);
    if (!Effort::itemises(static_cast<std::uint32_t>(&unit - task_set_.units.data()))) return bound;
    std::map<std::size_t, Duration> shares;
    Duration own = 0;
    Duration jitter = 0;
    for (bool more = true; more;) {
      const auto found = respond_(callbacks_, at, limit_of(unit) - callbacks_[at].ready);
      own += callbacks_[at].wcet;
      for (std::size_t j = 0; j < found->shares.size(); ++j) {
        if (found->shares[j] != 0) shares[j] += found->shares[j];
      }
      jitter = callbacks_[at].ready;
      more = false;
      for (const std::uint32_t p : task_set_.tasks[at].predecessors) {
        if (end(p) != jitter) continue;
        at = p;
        jitter = 0;
        more = true;
        break;
      }
    }
    bound.terms.push_back(Term{Term::Kind::Own, TaskId(), unit.dag, own, 1});
    for (const auto &[j, amount] : shares) {
      bound.terms.push_back(Term{Term::Kind::Interference, TaskId(j), task_set_.tasks[j].dag, amount, 0});
    }
    if (jitter > 0) bound.terms.push_back(Term{Term::Kind::Jitter, TaskId(), unit.dag, jitter, 0});
    return bound;
  }

  const TaskSet &task_set_;
  Respond respond_;
  std::vector<Callback> callbacks_;  // by TaskId
};

std::optional<std::string> why_not_rates(const TaskSet &task_set) {
  if (auto reason = why_not_directly(task_set)) return reason;
  if (task_set.mode != sched::Preemption::None) return "rclcpp's executors do not preempt";
  if (!task_set.groups.empty()) return "with exclusive groups, the callbacks of a busy group can miss every window";
  return std::nullopt;
}

std::optional<std::string> why_not_one_thread(const TaskSet &task_set) {
  if (task_set.platform.workers != 1) {
    return "requires one thread, but the platform has " + std::to_string(task_set.platform.workers) + " workers";
  }
  return why_not_rates(task_set);
}

// Where all keep J + R <= T, the published busy window holds one job of each callback (docs/analysis.md, "rclcpp's
// executors"). Its result is then the sum of all executions.
std::optional<FromReady> casini_response(const std::vector<Callback> &callbacks, std::size_t i, Duration /*limit*/) {
  FromReady found;
  for (const Callback &callback : callbacks) {
    found.response = add(found.response, callback.wcet);
    found.shares.push_back(callback.wcet);
  }
  found.shares[i] = 0;
  return found;
}

// Returns 1 if j is registered before i, else 0.
Duration before(const std::vector<Callback> &callbacks, std::size_t j, std::size_t i) {
  return callbacks[j].place < callbacks[i].place ? 1 : 0;
}

// The work in any window of length x by jobs that execute one after the other, within J + R of their releases.
Duration work_of(const Callback &callback, Duration x) {
  const Duration until = add(x, callback.ready + callback.response - callback.wcet);
  return add(multiply(until / callback.period, callback.wcet), std::min(callback.wcet, until % callback.period));
}

std::optional<FromReady> rates_response(const std::vector<Callback> &callbacks, std::size_t i, Duration limit,
                                        std::uint32_t threads) {
  const Callback &own = callbacks[i];
  std::vector<Duration> works(callbacks.size(), 0);
  global::FirstWindow first(threads, 0);
  for (std::size_t j = 0; j < callbacks.size(); ++j) {
    if (j != i) first.add(callbacks[j].wcet);
  }
  Duration d = first.length();
  const bool found = global::least_fixed_point(limit - own.wcet + 1, d, [&](Duration waiting) {
    Effort::spend(callbacks.size());
    global::Largest largest(threads - 1);
    Duration sum = 0;
    for (std::size_t j = 0; j < callbacks.size(); ++j) {
      if (j == i) continue;
      works[j] = std::min(work_of(callbacks[j], waiting), multiply(1 + before(callbacks, j, i), callbacks[j].wcet));
      sum = add(sum, works[j]);
      if (works[j] >= waiting) largest.offer(works[j]);
    }
    return global::least_window(sum, largest.entries(), threads);
  });
  if (!found) return std::nullopt;
  FromReady result{d - 1 + own.wcet, std::vector<Duration>(callbacks.size(), 0)};
  // Shares of a sum that is divided once: they add up to d - 1. With very many threads the last one takes what remains.
  const auto m = static_cast<Duration>(threads);
  Duration sum = 0;
  for (std::size_t j = 0; j < callbacks.size(); ++j) {
    const Duration more = sum + std::min(works[j], d);
    result.shares[j] = more / m - sum / m;
    sum = more;
  }
  if (const std::size_t last = i == callbacks.size() - 1 ? 0 : callbacks.size() - 1; last != i) {
    result.shares[last] += d - 1 - sum / m;
  }
  return result;
}

Outcome apply_casini(const TaskSet &task_set) {
  if (auto reason = why_not_one_thread(task_set)) return NotApplicable{*reason};
  return Executor(task_set, casini_response).run();
}

Outcome apply_rates(const TaskSet &task_set) {
  if (auto reason = why_not_rates(task_set)) return NotApplicable{*reason};
  const std::uint32_t threads = task_set.platform.workers;
  const Duration longest = kUnbounded / 4 / threads / static_cast<Duration>(task_set.tasks.size() + 2);
  for (const Unit &unit : task_set.units) {
    if (std::max(unit.period, unit.volume) > longest) return NotApplicable{"the times are too long for exact sums"};
  }
  return Executor(task_set, [threads](const std::vector<Callback> &callbacks, std::size_t i,
                                      Duration limit) { return rates_response(callbacks, i, limit, threads); })
      .run();
}

constexpr std::string_view kOneThread =
    "rclcpp's SingleThreadedExecutor of Humble with a processor of its own, timers polled like subscriptions; one rate "
    "per DAG with edges, J + R <= T for all tasks; release jitter; no shared exclusive groups";

Method make_wait_set_method(std::string_view name, std::string_view cite, std::string_view assumptions,
                            std::string_view complexity, Outcome (*apply)(const TaskSet &)) {
  return Method{
      .name = name,
      .subject = Subject::Dag,
      .cite = cite,
      .assumptions = assumptions,
      .complexity = complexity,
      .apply = apply,
  };
}

}  // namespace

Method casini() {
  return make_wait_set_method(
      "casini",
      "D. Casini, T. Blass, I. Luetkebohle, B. Brandenburg, Response-time analysis of ROS 2 processing chains "
      "under reservation-based scheduling, ECRTS 2019",
      kOneThread, "O(tasks^2) per round, at most 1000 rounds", apply_casini);
}

Method wait_set_rates() {
  return make_wait_set_method(
      "wait_set_rates",
      "docs/analysis.md, \"rclcpp's executors\"; after T. Blass et al., RTSS 2021; in place of X. Jiang et al., "
      "RTSS 2022, and H. Sobhani, H. Choi, H. Kim, RTAS 2023",
      "rclcpp's single- or multi-threaded executor of Humble, m threads with processors of their own; one rate per DAG "
      "with edges, J + R <= T for all tasks; release jitter; no shared exclusive groups",
      "pseudo-polynomial; O(tasks^2) per step, at most 1000 rounds", apply_rates);
}

}  // namespace redag::analysis
