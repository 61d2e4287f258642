// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/links.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/model/clusters.hpp"
#include "redag_analysis/analyze/analyze.hpp"

namespace redag::robot {
namespace {

constexpr int kMostRounds = 100;

struct Responses {
  std::vector<std::optional<Duration>> tasks;  // by TaskId, from a job's own release on
  std::vector<std::optional<Duration>> dags;   // by DagId, from the release of the source on
};

Result<Responses> bounds_of(const Workload &workload, const analysis::AnalysisPlatform &platform) {
  Responses responses;
  responses.tasks.resize(workload.task_count());
  responses.dags.resize(workload.dags.size());
  for (const ClusterPart &part : parts_of(workload)) {
    if (part.workload.dags.empty()) continue;
    const Result<analysis::TaskSet> task_set = analysis::compile(part.workload, analysis::platform_of(platform, part));
    if (!task_set) return tl::unexpected<Diagnostics>(task_set.error());
    const analysis::Report report = analysis::analyze(*task_set);
    // Data of a job that is lost do not arrive at all.
    for (std::size_t t = 0; t < part.tasks.size(); ++t) {
      if (!report.tasks[t].bound.of_ended) responses.tasks[part.tasks[t].value] = report.tasks[t].response;
    }
    for (std::size_t d = 0; d < part.dags.size(); ++d) responses.dags[part.dags[d].value] = report.dags[d].response;
  }
  return responses;
}

// A link in the union.
struct Crossing {
  const Link &link;
  TaskRef from;
  Task &to;
};

// True if all tasks have one period, so that a job of the source is behind each job of the others.
bool has_one_rate(const Dag &dag) {
  return std::all_of(dag.tasks.begin(), dag.tasks.end(),
                     [&](const Task &task) { return task.period == dag.tasks.front().period; });
}

class Iteration {
 public:
  Iteration(const Robot &robot, const std::vector<std::size_t> &first_task, Workload &united) : united_(united) {
    const std::vector<TaskRef> tasks = flatten(united);
    std::vector<Task *> mutable_tasks;
    for (Dag &dag : united.dags) {
      for (Task &task : dag.tasks) mutable_tasks.push_back(&task);
    }
    for (const Link &link : robot.links) {
      Task &to = *mutable_tasks[first_task[link.to.process] + link.to.task.value];
      crossings_.push_back({link, tasks[first_task[link.from.process] + link.from.task.value], to});
      to.jitter = std::min(link.transport, to.period);
    }
  }

  /// Raises each jitter to what the bounds ask for. Returns true if one changed.
  Result<bool> step(const Responses &responses) {
    bool changed = false;
    Diagnostics mistakes;
    for (const Crossing &crossing : crossings_) {
      const std::optional<Duration> response = response_of(crossing.from, responses);
      if (!response) {
        mistakes.push_back(mistake(crossing,
                                   fmt::format("nothing bounds the response time of '{}', and so when its data arrive",
                                               crossing.link.from.name),
                                   "'redag analyze' says why there is no bound, if the link is left out"));
      } else if (*response + crossing.link.transport > crossing.to.period) {
        mistakes.push_back(mistake(
            crossing,
            fmt::format("data of '{}' can arrive {} after the release behind them, which is more than their period {}",
                        crossing.link.from.name, humanize_duration(*response + crossing.link.transport),
                        format_duration(crossing.to.period)),
            "lower the load, or the rate"));
      } else if (const Duration jitter = *response + crossing.link.transport; jitter > crossing.to.jitter) {
        crossing.to.jitter = jitter;
        changed = true;
      }
    }
    if (!mistakes.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes));
    return changed;
  }

  [[nodiscard]] Diagnostics no_fixed_point() const {
    return {mistake(crossings_.front(), "the bounds of this and further links found no fixed point", "lower the load")};
  }

 private:
  // From the release behind the data to their end. A data task's own bound begins later, with the end of a predecessor.
  [[nodiscard]] std::optional<Duration> response_of(const TaskRef &from, const Responses &responses) const {
    if (from.task->activation == Activation::Timer) return responses.tasks[from.id.value];
    if (!has_one_rate(united_.dags[from.dag.value])) return std::nullopt;
    return responses.dags[from.dag.value];
  }

  static Diagnostic mistake(const Crossing &crossing, std::string message, const char *hint) {
    const Place &at = crossing.link.place;
    return Diagnostic{Severity::Error, at.file, at.line, at.column, std::move(message), hint};
  }

  const Workload &united_;
  std::vector<Crossing> crossings_;
};

}  // namespace

Result<void> set_jitter_of_links(const Robot &robot, const std::vector<std::size_t> &first_task,
                                 const analysis::AnalysisPlatform &platform, Workload &united) {
  if (robot.links.empty()) return {};
  Iteration iteration(robot, first_task, united);
  for (int round = 0; round < kMostRounds; ++round) {
    const Result<Responses> responses = bounds_of(united, platform);
    if (!responses) return tl::unexpected<Diagnostics>(responses.error());
    const Result<bool> changed = iteration.step(*responses);
    if (!changed) return tl::unexpected<Diagnostics>(changed.error());
    if (!*changed) return {};
  }
  return tl::unexpected<Diagnostics>(iteration.no_fixed_point());
}

}  // namespace redag::robot
