// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/task_bounds.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/one_worker/levels.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"

namespace redag::analysis::one_worker {
namespace {

// Work of others in the busy period that does not depend on its length.
Duration sum_of(const std::vector<Once> &all) {
  Duration sum = 0;
  for (const Once &once : all) sum = add(sum, add(once.stretch, once.follows));
  return sum;
}

class TaskBounds {
 public:
  TaskBounds(const TaskSet &task_set, bool deferred, std::span<const std::uint32_t> units)
      : task_set_(task_set),
        deferred_(deferred),
        asked_(units),
        levels_(task_set),
        ends_in_time_(task_set.units.size(), true) {
    bounds_.resize(task_set.tasks.size());
  }

  // Tasks without successors come first: if all of a unit's are bounded, so are its instances, which then never
  // overlap.
  std::vector<ResponseBound> run() {
    std::vector<std::uint32_t> order = task_set_.by_rank;
    std::stable_sort(order.begin(), order.end(),
                     [this](std::uint32_t a, std::uint32_t b) { return levels_.of(a) < levels_.of(b); });
    std::size_t done = 0;
    for (const bool is_last : {true, false}) {
      for (const std::uint32_t t : order) {
        if (task_set_.tasks[t].successors.empty() != is_last || !is_asked(t)) continue;
        Effort::reached(done++, order.size());
        bound(t);
        if (is_last && !bounds_[t].response) ends_in_time_[task_set_.tasks[t].unit] = false;
      }
    }
    return std::move(bounds_);
  }

 private:
  // The busy period of one task.
  struct Window {
    std::vector<Stage> stages;
    std::vector<std::vector<Interferer>> others;  // by stage
    std::vector<std::vector<Once>> once;          // by stage
    std::vector<Duration> own;                    // by stage: work of the task's own instance until the stage ends
    Duration instance = 0;                        // work of each earlier instance of its unit
    std::vector<Duration> ends;                   // by stage
    std::vector<Duration> longest;                // the ends of the job with the longest response
  };

  [[nodiscard]] bool is_asked(std::uint32_t t) const {
    return asked_.empty() || std::find(asked_.begin(), asked_.end(), task_set_.tasks[t].unit) != asked_.end();
  }

  [[nodiscard]] const Unit &unit_of(std::uint32_t t) const { return task_set_.units[task_set_.tasks[t].unit]; }

  void bound(std::uint32_t t) {
    const std::uint32_t u = task_set_.tasks[t].unit;
    Window window;
    window.stages = levels_.stages_of(t, ends_in_time_[u]);
    window.instance = levels_.volume(u, window.stages.front().level);
    for (const Stage &stage : window.stages) {
      window.once.push_back(levels_.once(t, window.stages.front().level, stage.own));
      window.others.push_back(levels_.others(u, stage.level));
      Duration own = 0;
      for (const std::uint32_t other : stage.own) own = add(own, task_set_.tasks[other].wcet);
      window.own.push_back(own);
    }
    const FixedPoint result = respond(t, window);
    ResponseBound &bound = bounds_[t];
    bound.absent = result.absent;
    if (!result.found) return;
    bound.response = result.found->response;
    bound.from_ready = result.found->from_ready;
    if (Effort::itemises(u) && !window.longest.empty()) bound.terms = terms_of(t, window, *result.found);
  }

  // The work of others that became ready before the stage, of which the later stages know only a part.
  [[nodiscard]] static Int128 begun(const Window &window, std::size_t stage) {
    Int128 sum = 0;
    for (std::size_t s = 0; s < stage; ++s) {
      for (const Interferer &other : window.others[s]) {
        sum += Int128{jobs_in(other, window.ends[s], false)} * other.wcet;
      }
      for (const Interferer &other : window.others[s + 1]) {
        sum -= Int128{jobs_in(other, window.ends[s], false)} * other.wcet;
      }
    }
    return sum;
  }

  FixedPoint respond(std::uint32_t t, Window &window) const {
    const Unit &unit = unit_of(t);
    const Duration last_region = deferred_ ? task_set_.tasks[t].last_region : 0;
    int steps = 0;
    Response worst;
    Duration length = 0;
    window.ends.assign(window.stages.size(), 0);
    for (std::int64_t q = 0;; ++q) {
      const Int128 before = Int128{q} * window.instance;
      const Duration stop = saturate(Int128{unit.limit} - unit.ahead() + Int128{q} * unit.period - last_region);
      for (std::size_t s = 0; s < window.stages.size(); ++s) {
        const bool is_last = s + 1 == window.stages.size();
        const Int128 start =
            sum_of(window.once[s]) + before + begun(window, s) + window.own[s] - (is_last ? last_region : 0);
        Duration &end = window.ends[s];
        end = std::max({end, saturate(start), s > 0 ? window.ends[s - 1] : 0});
        if (!settle(is_last && deferred_, start, window.others[s], stop, end, steps)) return no_fixed_point(steps);
      }
      const Duration end = add(window.ends.back(), last_region);
      const auto response = static_cast<Duration>(Int128{unit.ahead()} + end - Int128{q} * unit.period);
      const auto from_ready = static_cast<Duration>(end - std::max(Int128{0}, Int128{q} * unit.period - unit.ahead()));
      const Duration longest = std::max(worst.from_ready, from_ready);
      if (response > worst.response) {
        worst = Response{response, window.ends.back(), q, 0};
        window.longest = window.ends;
      }
      worst.from_ready = longest;
      // The busy period is over if all work that arrived before is done when the next instance comes.
      const Int128 all = sum_of(window.once.back()) + before + window.instance;
      const Duration next = saturate((Int128{q} + 1) * unit.period - unit.ahead());
      length = std::max(length, saturate(all));
      if (settle(false, all, window.others.front(), next, length, steps)) return FixedPoint{worst, {}};
      if (length <= next && length < kUnbounded) return no_fixed_point(steps);  // the steps ran out
    }
  }

  void add_waits(const std::vector<std::uint32_t> &tasks, TaskId self, DagId dag, std::vector<Term> &terms) const {
    Duration elsewhere = 0;
    for (const std::uint32_t t : tasks) elsewhere = add(elsewhere, task_set_.tasks[t].elsewhere);
    if (elsewhere > 0) terms.push_back(Term{Term::Kind::Suspended, self, dag, elsewhere, 0});
    for (std::size_t d = 0; d < task_set_.devices.size(); ++d) {
      DeviceUse use;
      for (const std::uint32_t t : tasks) {
        use.service = add(use.service, task_set_.tasks[t].devices[d].service);
        use.blocked = add(use.blocked, task_set_.tasks[t].devices[d].blocked);
      }
      if (use.service > 0) terms.push_back(Term{Term::Kind::Suspended, self, dag, use.service, 0, DeviceId(d)});
      if (use.blocked > 0) terms.push_back(Term{Term::Kind::Blocking, {}, {}, use.blocked, 0, DeviceId(d)});
    }
  }

  // The task's own instance: execution, waits and overheads.
  void add_own(std::uint32_t t, const std::vector<std::uint32_t> &tasks, std::vector<Term> &terms) const {
    Duration execution = 0;
    Duration overhead = 0;
    Duration waits = 0;
    for (const std::uint32_t other : tasks) {
      execution = add(execution, task_set_.tasks[other].wcet);
      overhead = add(overhead, task_set_.tasks[other].overhead);
      waits = add(waits, task_set_.tasks[other].waits);
    }
    const TaskId self = tasks.size() == 1 ? TaskId(t) : TaskId();
    const DagId dag = task_set_.tasks[t].dag;
    terms.push_back(Term{Term::Kind::Own, self, dag, execution - overhead - waits, 1});
    if (waits > 0) add_waits(tasks, self, dag, terms);
    if (overhead > 0) terms.push_back(Term{Term::Kind::Overhead, self, dag, overhead, 0});
  }

  [[nodiscard]] std::vector<Term> terms_of(std::uint32_t t, const Window &window, const Response &response) const {
    const Unit &unit = unit_of(t);
    const auto name = [](const Unit &of) { return of.tasks.size() == 1 ? TaskId(of.tasks.front()) : TaskId(); };
    std::vector<Term> terms;
    add_own(t, window.stages.back().own, terms);
    if (response.job > 0) {
      const Duration earlier = response.job * (window.instance - unit.period);
      terms.push_back(Term{Term::Kind::Earlier, name(unit), unit.dag, earlier, response.job});
    }
    for (const Once &once : window.once.back()) {
      const DagId dag = task_set_.tasks[once.task].dag;
      if (once.stretch > 0) terms.push_back(Term{Term::Kind::Blocking, TaskId(once.task), dag, once.stretch, 1});
      if (once.follows > 0) terms.push_back(Term{Term::Kind::Interference, {}, dag, once.follows, 1});
    }
    for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
      const Unit &other = task_set_.units[u];
      if (&other == &unit || levels_.volume(u, window.stages.front().level) == 0) continue;
      const auto jobs = [&](std::size_t stage) {
        return jobs_in({0, other.period, other.ahead()}, window.longest[stage],
                       deferred_ && stage + 1 == window.stages.size());
      };
      Duration amount = 0;
      Duration volume = 0;
      for (std::size_t s = window.stages.size(); s-- > 0;) {
        const Duration counted = levels_.volume(u, window.stages[s].level);
        amount += jobs(s) * (counted - volume);
        volume = counted;
      }
      const std::size_t shown = levels_.volume(u, window.stages.back().level) > 0 ? window.stages.size() - 1 : 0;
      if (amount > 0) terms.push_back(Term{Term::Kind::Interference, name(other), other.dag, amount, jobs(shown)});
    }
    const auto kind = unit.ahead() > 0 ? Term::Kind::Jitter : Term::Kind::Earlier;
    if (unit.ahead() != 0) terms.push_back(Term{kind, name(unit), unit.dag, unit.ahead(), 0});
    return terms;
  }

  const TaskSet &task_set_;
  bool deferred_;
  std::span<const std::uint32_t> asked_;  // the units whose tasks are bounded; none: all
  Levels levels_;
  std::vector<bool> ends_in_time_;  // by unit: no task without successors lacks a bound
  std::vector<ResponseBound> bounds_;
};

}  // namespace

Bound bound_tasks(const TaskSet &task_set, bool deferred, std::span<const std::uint32_t> units) {
  return from_tasks(task_set, TaskBounds(task_set, deferred, units).run());
}

}  // namespace redag::analysis::one_worker
