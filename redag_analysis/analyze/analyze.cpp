// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/analyze.hpp"

#include <algorithm>
#include <utility>

namespace redag::analysis {
namespace {

// A bound of all jobs goes before one of those that end.
bool is_better(const ResponseBound &found, const Tightest &best) {
  if (!found.response || !best.response) return found.response.has_value();
  if (found.of_ended != best.bound.of_ended) return best.bound.of_ended;
  return *found.response < *best.response;
}

void keep_tightest(std::vector<Tightest> &best, const std::vector<ResponseBound> &found, const Method &method) {
  for (std::size_t i = 0; i < found.size() && i < best.size(); ++i) {
    if (is_better(found[i], best[i])) best[i] = Tightest{found[i].response, &method, found[i], nullptr};
  }
}

bool lacks_bounds(const TaskSet &task_set, const std::vector<Tightest> &tasks, const std::vector<Tightest> &dags) {
  for (std::size_t d = 0; d < dags.size(); ++d) {
    if (task_set.dags[d].deadline > 0 && !dags[d].response) return true;
  }
  return std::any_of(tasks.begin(), tasks.end(), [](const Tightest &task) { return !task.response; });
}

Outcome apply_within(const TaskSet &task_set, const Method &method, const Effort::Limits &limits) {
  const Effort effort(limits);
  try {
    return method.apply(task_set);
  } catch (const Effort::GaveUp &gave_up) {
    if (gave_up.scope != &effort) throw;
    return NotApplicable{gave_up.why, true};
  }
}

MethodReport run(const TaskSet &task_set, const Method &method, const Effort::Limits &limits) {
  MethodReport report;
  report.method = &method;
  const bool is_covered = task_set.not_analysable.empty() || (task_set.has_modes && method.knows_modes) ||
                          (task_set.has_waits && method.knows_waits) ||
                          (method.knows_all && !task_set.is_beyond_numbers);
  report.outcome = is_covered ? apply_within(task_set, method, limits) : NotApplicable{task_set.not_analysable};
  if (const Bound *bound = report.bound()) {
    report.verdict = verdict(task_set, *bound);
    report.trusted = bound->unsound.empty();
  }
  return report;
}

// Bounds more of the most urgent tasks, as if they were alone.
void bound_alone(const TaskSet &task_set, const std::vector<Method> &methods, const Effort::Limits &limits,
                 Report &report) {
  if (std::all_of(report.tasks.begin(), report.tasks.end(), [](const Tightest &task) { return task.response; })) return;
  const auto lacks_bound = [&](std::uint32_t t) { return !report.tasks[t].response; };
  for (std::vector<MostUrgent> parts = most_urgent(task_set); !parts.empty(); parts.pop_back()) {
    if (std::none_of(parts.back().tasks.begin(), parts.back().tasks.end(), lacks_bound)) break;
    const auto part = std::make_shared<const MostUrgent>(std::move(parts.back()));
    for (const Method &method : methods) {
      if (method.subject == Subject::TaskSet || method.is_paper() || method.knows_all) continue;
      const MethodReport found = run(part->task_set, method, limits);
      if (!found.trusted) continue;
      const auto keep = [&](Tightest &best, const ResponseBound &bound) {
        if (is_better(bound, best)) best = Tightest{bound.response, &method, in_whole(*part, bound), part};
      };
      const Bound &bound = *found.bound();
      for (std::size_t i = 0; i < bound.tasks.size(); ++i) keep(report.tasks[part->tasks[i]], bound.tasks[i]);
      for (std::size_t d = 0; d < bound.dags.size(); ++d) {
        const bool is_kept = part->task_set.dags[d].tasks.size() == task_set.dags[d].tasks.size();
        if (is_kept) keep(report.dags[d], bound.dags[d]);
      }
    }
  }
}

Bound apply_itemised(const TaskSet &task_set, const Method &method, std::vector<std::uint32_t> units) {
  Effort::Limits limits;
  limits.itemised = {Itemised::Which::Units, std::move(units)};
  const Effort effort(limits);
  return std::get<Bound>(method.apply(task_set));
}

Bound combine(const std::vector<Tightest> &tasks, const std::vector<Tightest> &dags) {
  Bound bound;
  for (const Tightest &best : tasks) bound.tasks.push_back(best.bound);
  for (const Tightest &best : dags) bound.dags.push_back(best.bound);
  return bound;
}

struct HowFar {
  bool always = false;       // a method that knows all features runs, too, where others leave nothing to it
  bool until_shown = false;  // ends with the first methods that show all deadlines to be met
};

// The report points into `methods`.
Report report_of(const TaskSet &task_set, const std::vector<Method> &methods, const AnalyzeOptions &options,
                 HowFar how_far) {
  Report report;
  report.tasks.resize(task_set.tasks.size());
  report.dags.resize(task_set.dags.size());
  const auto apply = [&](const Method &method, std::size_t index) {
    Effort::Limits limits;
    limits.steps = options.effort;
    limits.itemised.which = options.itemise ? Itemised::Which::All : Itemised::Which::None;
    if (options.stop) {
      limits.stop = [&](const EffortAt &at) {
        return options.stop(AnalysisProgress{method, index, methods.size(), at});
      };
    }
    MethodReport found = run(task_set, method, limits);
    if (!found.trusted) return found;
    keep_tightest(report.tasks, found.bound()->tasks, method);
    keep_tightest(report.dags, found.bound()->dags, method);
    if (found.bound()->accepts == true) report.by.push_back(&method);
    return found;
  };
  const auto are_met = [&] { return verdict(task_set, combine(report.tasks, report.dags)) == Verdict::Schedulable; };
  for (const Method &method : methods) {
    MethodReport later{&method, NotApplicable{"other methods bound all tasks"}};
    report.methods.push_back(method.knows_all ? std::move(later) : apply(method, report.methods.size()));
    report.verdict = report.methods.back().trusted ? report.methods.back().verdict : Verdict::NotShown;
    if (how_far.until_shown && report.verdict == Verdict::Schedulable) return report;
  }
  if (how_far.until_shown && are_met()) {
    report.verdict = Verdict::Schedulable;
    return report;
  }

  Effort::Limits limits;
  limits.steps = options.effort;
  limits.itemised.which = options.itemise ? Itemised::Which::All : Itemised::Which::None;
  bound_alone(task_set, methods, limits, report);
  for (std::size_t i = 0; i < methods.size(); ++i) {
    if (!methods[i].knows_all) continue;
    if (how_far.always || lacks_bounds(task_set, report.tasks, report.dags)) report.methods[i] = apply(methods[i], i);
  }

  if (are_met()) {
    for (const Tightest &best : report.tasks) {
      if (best.method != nullptr && std::find(report.by.begin(), report.by.end(), best.method) == report.by.end()) {
        report.by.push_back(best.method);
      }
    }
  }
  report.verdict = report.by.empty() ? Verdict::NotShown : Verdict::Schedulable;
  return report;
}

}  // namespace

Report analyze(const TaskSet &task_set, const AnalyzeOptions &options) {
  return report_of(task_set, methods(), options, {});
}

Report analyze(const TaskSet &task_set, std::vector<Method> methods, const AnalyzeOptions &options) {
  const auto owned = std::make_shared<const std::vector<Method>>(std::move(methods));
  Report report = report_of(task_set, *owned, options, {.always = true});
  report.owned = owned;
  return report;
}

ResponseBound itemised(const TaskSet &task_set, const Tightest &tightest, TaskId task) {
  if (tightest.part != nullptr) {
    const MostUrgent &part = *tightest.part;
    const auto place = std::find(part.tasks.begin(), part.tasks.end(), task.value) - part.tasks.begin();
    const auto own = static_cast<std::size_t>(place);
    const Bound bound = apply_itemised(part.task_set, *tightest.method, {part.task_set.tasks[own].unit});
    return in_whole(part, bound.tasks[own]);
  }
  const Bound bound = apply_itemised(task_set, *tightest.method, {task_set.tasks[task.value].unit});
  return bound.tasks[task.value];
}

ResponseBound itemised(const TaskSet &task_set, const Tightest &tightest, DagId dag) {
  const TaskSet &among = tightest.part != nullptr ? tightest.part->task_set : task_set;
  const Bound bound = apply_itemised(among, *tightest.method, among.dags[dag.value].units);
  return tightest.part != nullptr ? in_whole(*tightest.part, bound.dags[dag.value]) : bound.dags[dag.value];
}

Bound tightest_of(const Report &report) { return combine(report.tasks, report.dags); }

bool is_shown_schedulable(const TaskSet &task_set) {
  return report_of(task_set, methods(), {}, {.until_shown = true}).verdict == Verdict::Schedulable;
}

}  // namespace redag::analysis
