// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/analyze.hpp"

#include <algorithm>
#include <utility>

namespace redag::analysis {
namespace {

void keep_tightest(std::vector<Tightest> &best, const std::vector<ResponseBound> &found, const Method &method) {
  for (std::size_t i = 0; i < found.size() && i < best.size(); ++i) {
    if (!found[i].response || (best[i].response && *best[i].response <= *found[i].response)) continue;
    best[i] = Tightest{found[i].response, &method, found[i]};
  }
}

Outcome apply_within(const System &system, const Method &method, const Effort::Limits &limits) {
  const Effort effort(limits);
  try {
    return method.apply(system);
  } catch (const Effort::GaveUp &gave_up) {
    if (gave_up.scope != &effort) throw;
    return NotApplicable{gave_up.why, true};
  }
}

MethodReport run(const System &system, const Method &method, const Effort::Limits &limits) {
  MethodReport report;
  report.method = &method;
  const bool is_covered = system.not_analysable.empty() || (system.has_modes && method.knows_modes);
  report.outcome = is_covered ? apply_within(system, method, limits) : NotApplicable{system.not_analysable};
  if (const Bound *bound = report.bound()) {
    report.verdict = verdict(system, *bound);
    report.trusted = bound->unsound.empty();
  }
  return report;
}

Bound apply_itemised(const System &system, const Method &method, std::vector<std::uint32_t> units) {
  Effort::Limits limits;
  limits.itemised = {Itemised::Which::Units, std::move(units)};
  const Effort effort(limits);
  return std::get<Bound>(method.apply(system));
}

Bound combine(const std::vector<Tightest> &tasks, const std::vector<Tightest> &dags) {
  Bound bound;
  for (const Tightest &best : tasks) bound.tasks.push_back(best.bound);
  for (const Tightest &best : dags) bound.dags.push_back(best.bound);
  return bound;
}

// The report points into `methods`.
Report report_of(const System &system, const std::vector<Method> &methods, const AnalyzeOptions &options) {
  Report report;
  report.tasks.resize(system.tasks.size());
  report.dags.resize(system.dags.size());
  for (const Method &method : methods) {
    Effort::Limits limits;
    limits.steps = options.effort;
    limits.itemised.which = options.itemise ? Itemised::Which::All : Itemised::Which::None;
    if (options.stop) {
      limits.stop = [&](const EffortAt &at) {
        return options.stop(AnalysisProgress{method, report.methods.size(), methods.size(), at});
      };
    }
    report.methods.push_back(run(system, method, limits));
    const MethodReport &last = report.methods.back();
    if (!last.trusted) continue;
    keep_tightest(report.tasks, last.bound()->tasks, method);
    keep_tightest(report.dags, last.bound()->dags, method);
    if (last.bound()->accepts == true) report.by.push_back(&method);
  }

  if (verdict(system, combine(report.tasks, report.dags)) == Verdict::Schedulable) {
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

Report analyze(const System &system, const AnalyzeOptions &options) { return report_of(system, methods(), options); }

Report analyze(const System &system, std::vector<Method> methods, const AnalyzeOptions &options) {
  const auto owned = std::make_shared<const std::vector<Method>>(std::move(methods));
  Report report = report_of(system, *owned, options);
  report.owned = owned;
  return report;
}

ResponseBound itemised(const System &system, const Tightest &tightest, TaskId task) {
  const Bound bound = apply_itemised(system, *tightest.method, {system.tasks[task.value].unit});
  return bound.tasks[task.value];
}

ResponseBound itemised(const System &system, const Tightest &tightest, DagId dag) {
  const Bound bound = apply_itemised(system, *tightest.method, system.dags[dag.value].units);
  return bound.dags[dag.value];
}

Bound tightest_of(const Report &report) { return combine(report.tasks, report.dags); }

bool is_shown_schedulable(const System &system) {
  if (!system.not_analysable.empty()) return false;
  Effort::Limits limits;
  limits.steps = kUsualEffort;
  limits.itemised.which = Itemised::Which::None;
  std::vector<Tightest> tasks(system.tasks.size());
  std::vector<Tightest> dags(system.dags.size());
  for (const bool quick : {true, false}) {
    for (const Method &method : methods()) {
      if (method.quick != quick) continue;
      const MethodReport report = run(system, method, limits);
      if (!report.trusted) continue;
      if (report.verdict == Verdict::Schedulable) return true;
      keep_tightest(tasks, report.bound()->tasks, method);
      keep_tightest(dags, report.bound()->dags, method);
    }
  }
  return verdict(system, combine(tasks, dags)) == Verdict::Schedulable;
}

}  // namespace redag::analysis
