// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global_groups.hpp"

#include <algorithm>
#include <vector>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/jobs_in_progress.hpp"
#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/global.hpp"
#include "redag_analysis/many_workers/group_windows.hpp"

namespace redag::analysis {
namespace {

using global::GlobalUnit;
using global::SharedTerms;
using groups::Chain;
using groups::Question;

constexpr std::string_view kOverlap = "its response time can exceed 16 of its periods";
constexpr std::string_view kMixed =
    "its DAG can be released again before it has ended, and old and new data can meet where its paths join";
constexpr std::string_view kSkipped = "a job can wait for so long that the next release skips it";
constexpr std::string_view kBindsNow =
    "its DAG can be released again before it has ended, with a max_active, groups and an overhead of preemption";
constexpr int kMostRounds = 1000;

// Whether a task may answer after its next release. It may not without preemption, nor where other bounds rely on whole
// units that answer within their period.
enum class Beyond : bool { Never, Allowed };

class Analysis {
 public:
  Analysis(const TaskSet &task_set, Beyond beyond)
      : task_set_(task_set),
        preempts_(task_set.mode != sched::Preemption::None),
        beyond_(preempts_ ? beyond : Beyond::Never),
        view_(global::units_of(task_set, {.mode = preempts_ ? sched::Preemption::Full : sched::Preemption::None,
                                          .bounds = preempts_,
                                          .groups = true,
                                          .any_policy = true})),
        windows_(task_set, view_.units),
        answers_(task_set.tasks.size()),
        instances_(view_.units.size(), 1) {}

  [[nodiscard]] const std::optional<std::string> &reason() const { return view_.reason; }

  // A job that waits for a max_active can find another holder each time, and make it preempt.
  [[nodiscard]] bool preempts_too_often() const {
    return task_set_.platform.preempt_overhead > 0 &&
           std::any_of(view_.units.begin(), view_.units.end(), [](const GlobalUnit &unit) { return unit.bound > 0; });
  }

  Bound run() {
    std::vector<ResponseBound> of_units(task_set_.units.size());
    std::vector<ResponseBound> of_tasks(task_set_.tasks.size());
    bool known = true;
    for (std::size_t b = 0; b < windows_.blocks().size(); ++b) {
      const groups::Block &block = windows_.blocks()[b];
      Effort::reached(block.begin, view_.units.size());
      std::size_t culprit = block.begin;
      const std::string_view absent = known ? solve(b, culprit) : global::kMoreUrgent;
      for (std::size_t k = block.begin; k < block.end; ++k) {
        const std::uint32_t u = view_.units[k].unit;
        if (absent.empty()) {
          of_units[u] = itemise(b, k, last_of(k), false);
          for (const std::uint32_t t : task_set_.units[u].tasks) of_tasks[t] = itemise(b, k, t, answers_readiness(t));
          continue;
        }
        of_units[u].absent = known && k != culprit ? global::kPeer : absent;
        for (const std::uint32_t t : task_set_.units[u].tasks) of_tasks[t].absent = of_units[u].absent;
      }
      known = known && absent.empty();
    }
    Bound bound = from_units(task_set_, std::move(of_units));
    if (beyond_ == Beyond::Allowed) bound.tasks = std::move(of_tasks);
    return bound;
  }

 private:
  // The window that gave a task's response.
  struct Answer {
    std::uint32_t instances = 1;
    Duration repeated = 0;  // the largest response of a job that waits for its task's previous one
    Duration from_ready = 0;
  };

  [[nodiscard]] const std::vector<std::uint32_t> &tasks_of(std::size_t k) const {
    return task_set_.units[view_.units[k].unit].tasks;
  }

  [[nodiscard]] bool waits_for_group(std::uint32_t t) const {
    return preempts_ && task_set_.tasks[t].group != kNoGroup;
  }

  [[nodiscard]] Duration latest(const GlobalUnit &unit) const {
    return beyond_ == Beyond::Allowed ? multiply(unit.period, groups::kMostInstances) : unit.limit;
  }

  // Finds the least responses that agree with each other. Returns an empty text, or why there are none.
  std::string_view solve(std::size_t b, std::size_t &culprit) {
    const groups::Block &block = windows_.blocks()[b];
    for (std::size_t k = block.begin; k < block.end; ++k) windows_.start(k);
    changed_ = true;
    for (int round = 0; changed_; ++round) {
      if (round == kMostRounds) return global::kNoFixedPoint;
      changed_ = false;
      for (culprit = block.begin; culprit < block.end; ++culprit) {
        if (!respond(b, culprit)) return beyond_ == Beyond::Allowed ? kOverlap : global::kNoFixedPoint;
      }
    }
    for (culprit = block.begin; culprit < block.end; ++culprit) {
      if (binds_now(culprit)) return task_set_.platform.preempt_overhead > 0 ? kBindsNow : solve(b, culprit);
      const std::string_view why = why_overlap_harms(b, culprit);
      if (!why.empty()) return why;
      for (const std::uint32_t t : tasks_of(culprit)) find_answer_from_ready(b, culprit, t);
    }
    return {};
  }

  void raise(Duration &value, Duration to) {
    if (to <= value) return;
    value = to;
    changed_ = true;
  }

  // Returns false if a response is beyond what counts as bounded.
  bool respond(std::size_t b, std::size_t k) {
    const GlobalUnit &unit = view_.units[k];
    if (unit.volume > multiply(unit.period, view_.workers)) return false;
    const Duration stop = latest(unit) - unit.jitter;
    const std::vector<std::uint32_t> &tasks = tasks_of(k);
    for (const std::uint32_t t : tasks) {
      if (!waits_for_group(t)) continue;
      const auto wait =
          windows_.window_of(b, windows_.chain_of(b, k, {.task = t, .from_ready = true, .first_tick = true}), stop);
      if (!wait) return false;
      raise(windows_.of(t).wait, *wait);
    }
    // A chain with one more instance begins only if one of its tasks can be late for its next job.
    std::vector<bool> late(tasks.size(), true);
    for (std::uint32_t instances = 1;; ++instances) {
      std::vector<bool> late_again(tasks.size(), false);
      for (std::size_t i = 0; i < tasks.size(); ++i) {
        if (!is_any_late(k, late, tasks[i])) continue;
        const Duration since = static_cast<Duration>(instances - 1) * unit.period;
        const auto window =
            windows_.window_of(b, windows_.chain_of(b, k, {.task = tasks[i], .instances = instances}), stop + since);
        if (!window) return false;
        const Duration response = unit.jitter + *window - since;
        late_again[i] = response > unit.period;
        Answer &answer = answers_[tasks[i]];
        if (instances > 1) answer.repeated = std::max(answer.repeated, response);
        if (response > windows_.of(tasks[i]).response) answer.instances = instances;
        raise(windows_.of(tasks[i]).response, response);
      }
      instances_[k] = instances;
      if (std::none_of(late_again.begin(), late_again.end(), [](bool is) { return is; })) return true;
      if (beyond_ == Beyond::Never || instances == groups::kMostInstances) return false;
      late = std::move(late_again);
    }
  }

  [[nodiscard]] bool is_any_late(std::size_t k, const std::vector<bool> &late, std::uint32_t task) const {
    const std::vector<std::uint32_t> &tasks = tasks_of(k);
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      if (late[i] && (tasks[i] == task || windows_.follows(k, tasks[i], task))) return true;
    }
    return false;
  }

  // Returns why overlapping instances of the unit would break the proof; empty if they do not.
  std::string_view why_overlap_harms(std::size_t b, std::size_t k) {
    const GlobalUnit &unit = view_.units[k];
    if (longest_of(k) <= unit.limit) return {};
    for (const std::uint32_t t : tasks_of(k)) {
      const CompiledTask &task = task_set_.tasks[t];
      const bool joins = task.predecessors.size() > 1 || (!task.data && !task.predecessors.empty());
      for (const std::uint32_t p : task.predecessors) {
        if (joins && windows_.of(p).response >= unit.period) return kMixed;
      }
      if (windows_.of(t).response > task.limit && !starts_in_time(b, k, t)) return kSkipped;
    }
    return {};
  }

  // True if overlapping instances can reach a max_active that one instance cannot. From then on the max_active counts.
  bool binds_now(std::size_t k) {
    GlobalUnit &unit = view_.units[k];
    const DagId dag = task_set_.units[unit.unit].dag;
    const std::uint32_t max_active = task_set_.dags[dag.value].max_active;
    if (max_active == 0 || unit.bound > 0) return false;
    const Duration together = ceil_div(longest_of(k), unit.period);
    if (together < 2) return false;
    if (multiply(together, static_cast<Duration>(most_jobs_in_progress(task_set_, dag))) <= max_active) return false;
    unit.bound = std::min(max_active, view_.workers);
    return true;
  }

  [[nodiscard]] Duration longest_of(std::size_t k) const { return windows_.bound_of(last_of(k)).response; }

  // True if each job starts before the release that would skip it.
  bool starts_in_time(std::size_t b, std::size_t k, std::uint32_t task) {
    const GlobalUnit &unit = view_.units[k];
    const Duration limit = task_set_.tasks[task].limit - unit.jitter;
    for (std::uint32_t instances = 1; instances <= instances_[k]; ++instances) {
      const Question question = {
          .task = task, .instances = instances, .first_tick = true, .until = task_set_.tasks[task].limit};
      const Duration since = static_cast<Duration>(instances - 1) * unit.period;
      if (!windows_.window_of(b, windows_.chain_of(b, k, question), add(limit, since))) return false;
    }
    return true;
  }

  // True if a data task has its own bound from readiness; a data task's response runs from its own release.
  [[nodiscard]] bool answers_readiness(std::uint32_t t) const {
    return answers_[t].from_ready > 0 && answers_[t].from_ready < windows_.bound_of(t).response;
  }

  void find_answer_from_ready(std::size_t b, std::size_t k, std::uint32_t t) {
    if (beyond_ == Beyond::Never || !task_set_.tasks[t].data) return;
    const auto window =
        windows_.window_of(b, windows_.chain_of(b, k, {.task = t, .from_ready = true}), windows_.bound_of(t).response);
    // The jitter of releases contains what the machine takes in the window; a window from readiness does not.
    if (window && *window > answers_[t].repeated) answers_[t].from_ready = add(*window, task_set_.frozen);
  }

  [[nodiscard]] std::uint32_t last_of(std::size_t k) const {
    const std::vector<std::uint32_t> &tasks = tasks_of(k);
    return *std::max_element(tasks.begin(), tasks.end(), [&](std::uint32_t a, std::uint32_t c) {
      return windows_.bound_of(a).response < windows_.bound_of(c).response;
    });
  }

  [[nodiscard]] ResponseBound itemise(std::size_t b, std::size_t k, std::uint32_t task, bool from_ready) {
    const GlobalUnit &unit = view_.units[k];
    const Answer &answer = answers_[task];
    ResponseBound bound;
    bound.response = from_ready ? answer.from_ready : windows_.bound_of(task).response;
    if (!Effort::itemises(unit.unit)) return bound;
    const std::uint32_t instances = from_ready ? 1 : answer.instances;
    const Chain chain = windows_.chain_of(b, k, {.task = task, .instances = instances, .from_ready = from_ready});
    (void)windows_.window_of(b, chain, kUnbounded);
    const groups::Shares &shares = windows_.shares();
    const std::uint32_t m = view_.workers;
    SharedTerms terms(task_set_, unit);
    const TaskId self = tasks_of(k).size() == 1 || from_ready ? TaskId(task) : TaskId();
    const DagId dag = task_set_.units[unit.unit].dag;
    terms.add(Term{Term::Kind::Own, self, dag, chain.path - chain.overhead, 1});
    terms.add(Term{Term::Kind::Overhead, self, dag, chain.overhead, 0});
    const Duration since = static_cast<Duration>(instances - 1) * unit.period;
    terms.add(Term{Term::Kind::Earlier, self, dag, chain.length - chain.path - since, instances - 1});
    terms.add(Term{Term::Kind::Own, self, dag, shares.executes - chain.length, 0});
    terms.add_share(Term::Kind::Own, unit, shares.own_shared, unit.bound > 0 ? unit.bound : m);
    for (std::size_t j = 0; j < windows_.blocks()[b].end; ++j) {
      if (j == k) continue;
      terms.add(Term::Kind::Interference, view_.units[j], shares.serial[j]);
      terms.add_share(Term::Kind::Interference, view_.units[j], shares.shared[j], m);
    }
    for (const Chain::Group &group : chain.groups) {
      if (!group.holder) continue;
      const DagId whose = task_set_.tasks[*group.holder].dag;
      terms.add(
          Term{Term::Kind::Blocking, TaskId(*group.holder), whose, multiply(group.found, group.held), group.found});
    }
    terms.add_share(Term::Kind::Blocking, unit, shares.less_urgent, m);
    if (!from_ready) terms.add_jitter();
    if (from_ready) terms.add(Term{Term::Kind::Overhead, self, dag, task_set_.frozen, 0});
    bound.terms = terms.take();
    return bound;
  }

  const TaskSet &task_set_;
  bool preempts_;
  Beyond beyond_;
  global::Units view_;
  groups::Windows windows_;
  std::vector<Answer> answers_;           // by TaskId
  std::vector<std::uint32_t> instances_;  // by position: the most on a chain
  bool changed_ = false;                  // in this round
};

Outcome apply_within_groups(const TaskSet &task_set, Beyond beyond) {
  Analysis analysis(task_set, beyond);
  if (analysis.reason()) return NotApplicable{*analysis.reason()};
  if (analysis.preempts_too_often()) {
    return NotApplicable{"a max_active that binds cannot be combined with groups and an overhead of preemption"};
  }
  return analysis.run();
}

Outcome apply_units(const TaskSet &task_set) { return apply_within_groups(task_set, Beyond::Never); }

Outcome apply_groups(const TaskSet &task_set) {
  if (task_set.groups.empty()) return NotApplicable{"no exclusive group is shared: see the bounds without groups"};
  // A job that inherits can preempt once more than when it started. On one worker no charge covers this.
  if (task_set.platform.preempt_overhead > 0 && task_set.platform.workers == 1) {
    return NotApplicable{"groups cannot be combined with an overhead of preemption on one worker"};
  }
  return is_across_rates(task_set) ? across_rates(task_set, apply_units)
                                   : apply_within_groups(task_set, Beyond::Allowed);
}

}  // namespace

Method dag_groups() {
  return Method{
      .name = "dag_groups",
      .subject = Subject::Dag,
      .cite =
          "docs/analysis.md, \"Exclusive groups\"; after L. Sha, R. Rajkumar, J. Lehoczky, IEEE TC 39(9), 1990, and A. "
          "Melani et al., ECRTS 2015",
      .assumptions =
          "m workers, full preemption (a group's holder inherits) or none, any policy, one rate per DAG; with full "
          "preemption responses up to 16 T where no job is skipped, else R <= T; release jitter, shared levels, "
          "exclusive groups within and across DAGs; with full preemption max_active of DAGs in one part",
      .complexity = "pseudo-polynomial; O(tasks^2) per step",
      .apply = apply_groups,
  };
}

}  // namespace redag::analysis
