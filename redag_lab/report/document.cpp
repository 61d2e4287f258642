// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/run_info_json.hpp"
#include "redag/version.hpp"
#include "redag_analysis/metrics/files/summary_json.hpp"
#include "redag_analysis/metrics/miss.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/report/verdict.hpp"

namespace redag::report {
namespace {

using Json = nlohmann::ordered_json;
using metrics::JobRecord;

Json optional_time(const std::optional<Duration> &time) { return time ? Json(*time) : Json(nullptr); }

Json to_json(const Provenance &provenance) {
  return provenance.is_known() ? Json::parse(provenance_to_json(provenance)) : Json();
}

Json to_json(const Sentence &sentence) { return Json{{"tone", to_string(sentence.tone)}, {"text", sentence.text}}; }

Json to_json(const Spread &spread) { return Json{{"median", spread.median}, {"min", spread.min}, {"max", spread.max}}; }

// Returns a table by column, a third of the size of a list of objects.
template <class Row>
Json columns(const std::vector<Row> &rows, const std::vector<const char *> &names, auto cells_of) {
  Json table = Json::object();
  for (const char *name : names) table[name] = Json::array();
  for (const Row &row : rows) {
    const std::vector<Json> cells = cells_of(row);
    for (std::size_t i = 0; i < names.size(); ++i) table[names[i]].push_back(cells[i]);
  }
  return table;
}

Json to_json(const Window &window, Time end, const std::vector<Duration> &end_to_end) {
  std::map<std::pair<TaskId, std::uint32_t>, std::size_t> index;
  for (const JobRecord &job : window.jobs) index.emplace(std::pair(job.task, job.number), index.size());
  Json jobs = columns(window.jobs, {"task", "number", "release", "deadline", "finish", "outcome", "reason", "missed"},
                      [&](const JobRecord &job) -> std::vector<Json> {
                        const metrics::Miss miss = metrics::miss_of(job, end, end_to_end[job.task.value]);
                        return {job.task.value,
                                job.number,
                                job.release - window.begin,
                                job.deadline - job.release,
                                job.finish == kNever ? Json(nullptr) : Json(job.finish - job.release),
                                static_cast<int>(job.outcome),
                                static_cast<int>(job.reason),
                                miss == metrics::Miss::None ? 0 : 1};
                      });
  Json slices = columns(window.slices, {"task", "job", "device", "worker", "begin", "length", "how"},
                        [&](const Slice &slice) -> std::vector<Json> {
                          const auto job = index.find({slice.task, slice.job});
                          return {slice.task.value,
                                  job == index.end() ? Json(nullptr) : Json(job->second),
                                  slice.device.valid() ? Json(slice.device.value) : Json(nullptr),
                                  slice.worker,
                                  slice.begin - window.begin,
                                  slice.end - slice.begin,
                                  static_cast<int>(slice.how)};
                        });
  return Json{
      {"begin_ns", window.begin}, {"end_ns", window.end}, {"jobs", std::move(jobs)}, {"slices", std::move(slices)}};
}

Json to_json(const Schedule &schedule, const trace::RunInfo &run) {
  Json windows = Json::array();
  const std::vector<Duration> end_to_end = metrics::end_to_end_deadlines(run.workload);
  for (const Window &window : schedule.windows) windows.push_back(to_json(window, run.end, end_to_end));
  Json views = Json::array();
  for (const View &view : schedule.views) {
    Json row{{"window", view.window}, {"begin_ns", view.begin}, {"end_ns", view.end}};
    if (view.job) {
      const JobRecord &job = *view.job;
      row["task"] = job.task.value;
      row["job"] = job.number;
      row["missed"] = metrics::miss_of(job, run.end, end_to_end[job.task.value]) != metrics::Miss::None;
      row["lateness_ns"] = job.outcome == metrics::JobOutcome::Finished ? Json(job.lateness()) : Json();
    }
    views.push_back(std::move(row));
  }
  return Json{{"is_whole", schedule.is_whole}, {"views", std::move(views)}, {"windows", std::move(windows)}};
}

Json to_json(const RunDigest &run) {
  return Json{{"path", run.path},
              {"provenance", to_json(run.info.provenance)},
              {"seed", run.info.seed},
              {"released", run.summary.total.released},
              {"missed", run.summary.total.missed()},
              {"worker_busy", run.summary.worker_busy},
              {"violations", run.check.violation_count}};
}

void add_bound(Json &row, const std::vector<BoundOf> &bounds, std::size_t at, bool is_alarm) {
  const bool is_known = at < bounds.size();
  row["bound_ns"] = is_known ? optional_time(bounds[at].response) : Json(nullptr);
  row["method"] = is_known ? bounds[at].method : std::string();
  row["bound_alarm"] = is_alarm;
}

Json dags_of(const Group &group) {
  Json rows = Json::array();
  for (std::size_t d = 0; d < group.workload().dags.size(); ++d) {
    const Dag &dag = group.workload().dags[d];
    const metrics::DagSummary &measured = group.dags[d];
    Duration period = 0;
    for (const Task &task : dag.tasks) {
      if (period == 0 || (task.period > 0 && task.period < period)) period = task.period;
    }
    Json row{{"name", dag.name},
             {"tasks", dag.tasks.size()},
             {"period_ns", period},
             {"deadline_ns", dag.deadline},
             {"max_active", dag.max_active},
             {"peak_active", measured.peak_active},
             {"jobs", metrics::to_json(measured.jobs)},
             {"end_to_end", metrics::to_json(measured.end_to_end)}};
    if (!dag.cluster.empty()) row["cluster"] = dag.cluster;
    add_bound(row, group.bounds.dags, d, is_above_bound(group, DagId(d)));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json task_row(const Group &group, const TaskRef &ref) {
  const metrics::JobStats &jobs = group.tasks[ref.id.value];
  const metrics::TaskCheck &check = group.assumptions.tasks[ref.id.value];
  Json row{{"dag", ref.dag.value},
           {"name", ref.task->name},
           {"period_ns", ref.task->period},
           {"deadline_ns", ref.task->deadline},
           {"wcet_ns", ref.task->wcet},
           {"execution_max_ns", group.executions[ref.id.value]},
           {"wcet_exceeded", check.execution.is_exceeded},
           {"jobs", metrics::to_json(static_cast<const metrics::JobCounts &>(jobs))}};
  row["jobs"]["response"] = metrics::to_json(jobs.response);
  add_bound(row, group.bounds.tasks, ref.id.value,
            group.is_simulated() ? check.response.exceeded > 0 : check.response.is_alarm);
  return row;
}

// Returns the distance of the worst job from its deadline, as a share of the deadline. Lost jobs rank above all others.
double closeness(const Group &group, const TaskRef &ref) {
  const metrics::JobStats &jobs = group.tasks[ref.id.value];
  if (jobs.lost() > 0) return 1e9 * jobs.miss_ratio_with_lost();
  const double lateness = jobs.max_lateness ? static_cast<double>(*jobs.max_lateness) : -1e18;
  return lateness / static_cast<double>(std::max<Duration>(1, ref.task->deadline));
}

// Every task has a row with its name, which makes positions TaskIds. Beyond `most` they have nothing else.
Json tasks_of(const Group &group, std::size_t most) {
  const std::vector<TaskRef> refs = flatten(group.workload());
  std::vector<TaskRef> order = refs;
  std::stable_sort(order.begin(), order.end(),
                   [&](const TaskRef &a, const TaskRef &b) { return closeness(group, a) > closeness(group, b); });
  Json rows = Json::array();
  for (const TaskRef &ref : refs) rows.push_back(Json{{"dag", ref.dag.value}, {"name", ref.task->name}});
  for (std::size_t i = 0; i < std::min(most, order.size()); ++i) {
    rows[order[i].id.value] = task_row(group, order[i]);
  }
  return rows;
}

// Says what the document lacks of a group.
void add_cuts(const Group &group, std::size_t most_tasks, std::vector<std::string> &cuts) {
  const std::size_t tasks = group.workload().task_count();
  const auto add = [&](const std::string &what) { cuts.push_back(fmt::format("{}: {}", group.label, what)); };
  if (tasks > most_tasks) {
    add(fmt::format("tables and figures show only the {} tasks that came closest to a miss, of {}",
                    format_count(most_tasks), format_count(tasks)));
  }
  double error = 0;
  for (std::size_t t = 0; t < tasks; ++t) error = std::max(error, group.tasks[t].response.percentile_error);
  if (error > 0) add(fmt::format("percentiles of tasks with many jobs are accurate to {:.1f} %", 100 * error));
  if (!group.schedule.is_whole) add("the schedule shows the time around the worst jobs, and the beginning");
}

Json group_json(const Group &group, std::size_t most_tasks) {
  const Platform &platform = group.workload().platform;
  Json clusters = Json::array();
  for (const Cluster &one : platform.clusters) clusters.push_back({{"name", one.name}, {"workers", one.workers}});
  Json devices = Json::array();
  for (const Device &one : platform.devices) devices.push_back({{"name", one.name}, {"slots", one.slots}});
  Json verdict = Json::array();
  for (const Sentence &sentence : verdict_of(group)) verdict.push_back(to_json(sentence));
  Json runs = Json::array();
  for (const RunDigest &run : group.runs) runs.push_back(to_json(run));
  return Json{{"label", group.label},
              {"run", Json::parse(trace::run_info_to_json(group.info()))},
              {"headline", to_json(headline_of({&group, 1}))},
              {"verdict", std::move(verdict)},
              {"total", metrics::to_json(group.total)},
              {"clusters", std::move(clusters)},
              {"devices", std::move(devices)},
              {"dags", dags_of(group)},
              {"tasks", tasks_of(group, most_tasks)},
              {"bounds", {{"absent", group.bounds.absent}, {"assumes", group.bounds.assumes}}},
              {"runs", std::move(runs)},
              {"worst_run", group.worst_run},
              {"schedule", to_json(group.schedule, group.info())},
              {"why", report::to_json(group.why, group.info())}};
}

// Returns the deadline of a DAG's end-to-end response. In a DAG without edges each task answers by itself: its deadline
// is that of its tasks, if they have the same one.
std::optional<Duration> answer_deadline(const Dag &dag) {
  if (dag.deadline > 0) return dag.deadline;
  const Duration first = dag.tasks.front().deadline;
  const bool is_common = std::all_of(dag.tasks.begin(), dag.tasks.end(), [first](const Task &task) {
    return task.predecessors.empty() && task.deadline == first;
  });
  return is_common ? std::optional(first) : std::nullopt;
}

// Returns the figures of a DAG over the repetitions of a group. Shares and percentiles of the repetitions are spreads.
// Counts and the maximum cover all repetitions.
Json contender(const Group &group, DagId dag) {
  const metrics::DagSummary &all = group.dags[dag.value];
  const auto over_runs = [&](Duration metrics::Distribution::*figure) {
    std::vector<double> values;
    for (const RunDigest &run : group.runs) {
      const metrics::Distribution &response = run.summary.dags[dag.value].end_to_end.response;
      if (response.count > 0) values.push_back(static_cast<double>(response.*figure));
    }
    return values.empty() ? Json() : to_json(spread_of(std::move(values)));
  };
  const metrics::Distribution &response = all.end_to_end.response;
  return Json{{"released", all.jobs.released},
              {"late", all.jobs.late},
              {"missed", all.jobs.missed()},
              {"miss_ratio", to_json(misses_of(group, dag))},
              {"end_to_end_late", all.end_to_end.late},
              {"deadline_ns", optional_time(answer_deadline(group.workload().dags[dag.value]))},
              {"p50_ns", over_runs(&metrics::Distribution::p50)},
              {"p95_ns", over_runs(&metrics::Distribution::p95)},
              {"p99_ns", over_runs(&metrics::Distribution::p99)},
              {"max_ns", response.count > 0 ? Json(response.max) : Json()}};
}

Json comparison(std::span<const Group> groups) {
  Json rows = Json::array();
  for (const CommonDag &dag : common_dags(groups)) {
    Json row{{"name", dag.name}, {"groups", Json::array()}};
    for (std::size_t g = 0; g < groups.size(); ++g) row["groups"].push_back(contender(groups[g], dag.ids[g]));
    rows.push_back(std::move(row));
  }
  return Json{{"dags", std::move(rows)}};
}

// Returns the names of the workloads.
std::string title_of(std::span<const Group> groups) {
  std::vector<std::string> names;
  for (const Group &group : groups) {
    const std::string &name = group.workload().name;
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  constexpr std::size_t kMost = 3;
  if (names.size() > kMost) return fmt::format("{} workloads", names.size());
  return join(names);
}

}  // namespace

DigestOptions digest_options(std::size_t groups) {
  // A slice and its job take 60 to 100 bytes.
  constexpr std::size_t kMostSlices = 50'000;
  DigestOptions options;
  options.most_slices = std::clamp<std::size_t>(kMostSlices / std::max<std::size_t>(groups, 1), 200, 16'000);
  return options;
}

std::string to_json(std::span<const Group> groups, const DocumentOptions &options) {
  REDAG_CHECK(!groups.empty(), "a report of nothing");
  const std::size_t most_tasks = std::max<std::size_t>(options.most_tasks / groups.size(), 10);
  std::vector<std::string> cuts;
  Json list = Json::array();
  for (const Group &group : groups) {
    list.push_back(group_json(group, most_tasks));
    add_cuts(group, most_tasks, cuts);
  }
  const Json document{{"format", "redag.report/3"},
                      {"provenance", to_json(options.provenance)},
                      {"version", kVersion},
                      {"title", title_of(groups)},
                      {"headline", to_json(headline_of(groups))},
                      {"comparison", comparison(groups)},
                      {"groups", std::move(list)},
                      {"notes", options.notes},
                      {"cuts", cuts}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace redag::report
