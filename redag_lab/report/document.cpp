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
#include "redag/base/words.hpp"
#include "redag/trace/run_info_json.hpp"
#include "redag/version.hpp"
#include "redag_analysis/metrics/miss.hpp"
#include "redag_lab/report/verdict.hpp"

namespace redag::report {
namespace {

using Json = nlohmann::ordered_json;
using metrics::JobCounts;
using metrics::JobRecord;
using metrics::JobStats;

Json optional_time(const std::optional<Duration> &time) { return time ? Json(*time) : Json(nullptr); }

Json to_json(const metrics::Distribution &d) {
  if (d.count == 0) return nullptr;
  return Json{{"count", d.count}, {"mean_ns", d.mean}, {"min_ns", d.min}, {"p50_ns", d.p50},
              {"p90_ns", d.p90},  {"p95_ns", d.p95},   {"p99_ns", d.p99}, {"max_ns", d.max}};
}

Json to_json(const JobCounts &jobs) {
  Json lost = Json::object();
  for (std::size_t i = 0; i < metrics::kReasonCount; ++i) {
    if (jobs.by_reason[i] > 0) lost[redag::to_string(static_cast<Reason>(i))] = jobs.by_reason[i];
  }
  return Json{{"released", jobs.released},
              {"finished", jobs.finished},
              {"late", jobs.late},
              {"skipped", jobs.skipped},
              {"aborted", jobs.aborted},
              {"in_flight", jobs.in_flight},
              {"missed", jobs.missed()},
              {"miss_ratio", jobs.miss_ratio_with_lost()},
              {"lost_by_reason", std::move(lost)},
              {"deferred", jobs.deferred},
              {"preemptions", jobs.preemptions},
              {"max_lateness_ns", optional_time(jobs.max_lateness)}};
}

Json to_json(const JobStats &jobs) {
  Json json = to_json(static_cast<const JobCounts &>(jobs));
  json["response"] = to_json(jobs.response);
  // By metrics::Stay.
  json["split"] = {{"total_ns", jobs.split.total.length}, {"longest_ns", jobs.split.longest.length}};
  return json;
}

Json to_json(const metrics::EndToEnd &end_to_end) {
  Json sinks = Json::array();
  for (const metrics::SinkSummary &sink : end_to_end.sinks) {
    sinks.push_back(Json{{"task", sink.task.value}, {"late", sink.late}, {"response", to_json(sink.response)}});
  }
  return Json{{"late", end_to_end.late}, {"response", to_json(end_to_end.response)}, {"sinks", std::move(sinks)}};
}

Json to_json(const Provenance &provenance) {
  return provenance.is_known() ? Json::parse(provenance_to_json(provenance)) : Json();
}

Json to_json(const Sentence &sentence) { return Json{{"tone", to_string(sentence.tone)}, {"text", sentence.text}}; }

Json to_json(const Spread &spread) { return Json{{"median", spread.median}, {"min", spread.min}, {"max", spread.max}}; }

// Returns a table stored by column, a third of the size of a list of objects.
Json columns(std::initializer_list<const char *> names) {
  Json table = Json::object();
  for (const char *name : names) table[name] = Json::array();
  return table;
}

Json to_json(const Window &window, Time end, const std::vector<Duration> &end_to_end) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> index;
  Json jobs = columns({"task", "number", "release", "deadline", "finish", "outcome", "reason", "missed"});
  for (const JobRecord &job : window.jobs) {
    index.emplace(std::pair(job.task.value, job.number), index.size());
    jobs["task"].push_back(job.task.value);
    jobs["number"].push_back(job.number);
    jobs["release"].push_back(job.release - window.begin);
    jobs["deadline"].push_back(job.deadline - job.release);
    jobs["finish"].push_back(job.finish == kNever ? Json(nullptr) : Json(job.finish - job.release));
    jobs["outcome"].push_back(static_cast<int>(job.outcome));
    jobs["reason"].push_back(static_cast<int>(job.reason));
    jobs["missed"].push_back(metrics::miss_of(job, end, end_to_end[job.task.value]) == metrics::Miss::None ? 0 : 1);
  }
  Json slices = columns({"task", "job", "worker", "begin", "length", "how"});
  for (const Slice &slice : window.slices) {
    const auto job = index.find({slice.task.value, slice.job});
    slices["task"].push_back(slice.task.value);
    slices["job"].push_back(job == index.end() ? Json(nullptr) : Json(job->second));
    slices["worker"].push_back(slice.worker);
    slices["begin"].push_back(slice.begin - window.begin);
    slices["length"].push_back(slice.end - slice.begin);
    slices["how"].push_back(static_cast<int>(slice.how));
  }
  Json services = columns({"task", "job", "device", "slot", "begin", "length"});
  for (const Service &service : window.services) {
    const auto job = index.find({service.task.value, service.job});
    services["task"].push_back(service.task.value);
    services["job"].push_back(job == index.end() ? Json(nullptr) : Json(job->second));
    services["device"].push_back(service.device.value);
    services["slot"].push_back(service.slot);
    services["begin"].push_back(service.begin - window.begin);
    services["length"].push_back(service.end - service.begin);
  }
  return Json{{"begin_ns", window.begin},
              {"end_ns", window.end},
              {"jobs", std::move(jobs)},
              {"slices", std::move(slices)},
              {"services", std::move(services)}};
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
  return Json{{"slices_in_all", schedule.slices_in_all},
              {"slices_shown", schedule.slices_shown},
              {"views", std::move(views)},
              {"windows", std::move(windows)}};
}

Json to_json(const Timeline &timeline) {
  return Json{{"begin_ns", timeline.begin},    {"bin_ns", timeline.bin},
              {"busy_ns", timeline.busy},      {"device_busy_ns", timeline.device_busy},
              {"released", timeline.released}, {"missed", timeline.missed}};
}

Json to_json(const RunDigest &run) {
  std::uint64_t checks = 0;
  for (const std::uint64_t count : run.check.checks_by_rule) checks += count;
  Json violations = Json::array();
  constexpr std::size_t kMost = 20;
  for (std::size_t i = 0; i < std::min(kMost, run.check.violations.size()); ++i) {
    violations.push_back(run.check.violations[i].to_string());
  }
  return Json{{"path", run.path},
              {"provenance", to_json(run.info.provenance)},
              {"seed", run.info.seed},
              {"released", run.summary.total.released},
              {"missed", run.summary.total.missed()},
              {"miss_ratio", run.summary.total.miss_ratio_with_lost()},
              {"worker_busy", run.summary.worker_busy},
              {"inversions", {{"count", run.summary.inversions.count}, {"longest_ns", run.summary.inversions.longest}}},
              {"checks", checks},
              {"violation_count", run.check.violation_count},
              {"violations", std::move(violations)}};
}

// Returns the distance of the worst job from its deadline, as a share of the deadline. Lost jobs rank above all others.
double closeness(const Group &group, const TaskRef &ref) {
  const JobStats &jobs = group.task(ref.id);
  if (jobs.lost() > 0) return 1e9 * jobs.miss_ratio_with_lost();
  const double lateness = jobs.max_lateness ? static_cast<double>(*jobs.max_lateness) : -1e18;
  return lateness / static_cast<double>(std::max<Duration>(1, ref.task->deadline));
}

class GroupWriter {
 public:
  GroupWriter(const Group &group, std::size_t most_tasks, std::size_t most_curves, std::vector<std::string> &cuts)
      : group_(group), refs_(flatten(group.workload())) {
    std::vector<TaskRef> order = refs_;
    std::stable_sort(order.begin(), order.end(),
                     [&](const TaskRef &a, const TaskRef &b) { return closeness(group, a) > closeness(group, b); });
    shown_.assign(refs_.size(), false);
    curves_ = shown_;
    for (std::size_t i = 0; i < order.size(); ++i) {
      shown_[order[i].id.value] = i < most_tasks;
      curves_[order[i].id.value] = i < most_curves;
    }
    const auto cut = [&](std::size_t most, const char *what) {
      if (order.size() <= most) return;
      cuts.push_back(fmt::format("{}: {} only the {} tasks that came closest to a miss, of {}", group.label(), what,
                                 format_count(most), format_count(order.size())));
    };
    cut(most_tasks, "the table of tasks shows");
    cut(most_curves, "the figures of response times and lateness show");
    const auto is_counted = [&](const TaskRef &ref) { return !group.samples(ref.id).is_exact; };
    if (std::any_of(refs_.begin(), refs_.end(), is_counted)) {
      cuts.push_back(fmt::format("{}: percentiles of tasks with many jobs are accurate to {:.1f} %", group.label(),
                                 100 * metrics::DurationSketch::kRelativeError));
    }
    const Schedule &schedule = group.schedule();
    if (schedule.slices_shown < schedule.slices_in_all) {
      cuts.push_back(
          fmt::format("{}: the schedule shows {} of {} slices on workers: the time around the worst jobs, and the "
                      "beginning; the overview covers the whole run",
                      group.label(), format_count(schedule.slices_shown), format_count(schedule.slices_in_all)));
    }
  }

  Json write() const {
    Json verdict = Json::array();
    for (const Sentence &sentence : verdict_of(group_)) verdict.push_back(to_json(sentence));
    Json runs = Json::array();
    for (const RunDigest &run : group_.runs()) runs.push_back(to_json(run));
    const RunBounds &bounds = group_.bounds();
    return Json{{"label", group_.label()},
                {"run", Json::parse(trace::run_info_to_json(group_.info()))},
                {"headline", to_json(headline_of({&group_, 1}))},
                {"verdict", std::move(verdict)},
                {"total", to_json(group_.total())},
                {"clusters", clusters()},
                {"devices", devices()},
                {"dags", dags()},
                {"tasks", tasks()},
                {"bounds",
                 {{"absent", bounds.absent},
                  {"schedulable", bounds.schedulable},
                  {"by", bounds.by},
                  {"assumes", bounds.assumes}}},
                {"runs", std::move(runs)},
                {"worst_run", group_.worst_run()},
                {"timeline", to_json(group_.timeline())},
                {"schedule", to_json(group_.schedule(), group_.info())},
                {"why", Json::parse(report::to_json(group_.why(), group_.info()))}};
  }

 private:
  static void add_bound(Json &row, const std::vector<BoundOf> &bounds, std::size_t at) {
    const bool known = at < bounds.size();
    row["bound_ns"] = known ? optional_time(bounds[at].response) : Json(nullptr);
    row["method"] = known ? bounds[at].method : std::string();
  }

  Json clusters() const {
    Json rows = Json::array();
    for (const Cluster &cluster : group_.workload().platform.clusters) {
      rows.push_back(Json{{"name", cluster.name}, {"workers", cluster.workers}});
    }
    return rows;
  }

  Json devices() const {
    Json rows = Json::array();
    for (const Device &device : group_.workload().platform.devices) {
      rows.push_back(Json{{"name", device.name}, {"slots", device.slots}});
    }
    return rows;
  }

  Json dags() const {
    Json rows = Json::array();
    for (std::size_t d = 0; d < group_.workload().dags.size(); ++d) {
      const Dag &dag = group_.workload().dags[d];
      Duration period = 0;
      for (const Task &task : dag.tasks) {
        if (period == 0 || (task.period > 0 && task.period < period)) period = task.period;
      }
      Json row{{"name", dag.name},
               {"tasks", dag.tasks.size()},
               {"period_ns", period},
               {"deadline_ns", dag.deadline},
               {"max_active", dag.max_active},
               {"peak_active", group_.dags()[d].peak_active},
               {"jobs", to_json(group_.dag(DagId(d)))},
               {"end_to_end", to_json(group_.end_to_end(DagId(d)))}};
      if (!dag.cluster.empty()) row["cluster"] = dag.cluster;
      add_bound(row, group_.bounds().dags, d);
      row["bound_alarm"] = is_above_bound(group_, DagId(d));
      rows.push_back(std::move(row));
    }
    return rows;
  }

  Json tasks() const {
    Json rows = Json::array();
    for (const TaskRef &ref : refs_) {
      // Every task has a row with its name, which makes positions TaskIds. Tasks that were cut have nothing else.
      Json row{{"dag", ref.dag.value}, {"name", ref.task->name}};
      if (shown_[ref.id.value]) {
        row["period_ns"] = ref.task->period;
        row["deadline_ns"] = ref.task->deadline;
        row["wcet_ns"] = ref.task->wcet;
        row["execution_max_ns"] = group_.samples(ref.id).execution_max;
        row["wcet_exceeded"] = group_.assumptions().tasks[ref.id.value].execution.is_exceeded;
        const metrics::ResponseCheck &response = group_.assumptions().tasks[ref.id.value].response;
        const bool is_exact = group_.info().driver == trace::Driver::Simulator;
        row["bound_alarm"] = is_exact ? response.exceeded > 0 : response.is_alarm;
        add_bound(row, group_.bounds().tasks, ref.id.value);
        row["jobs"] = to_json(group_.task(ref.id));
      }
      if (curves_[ref.id.value]) add_curves(row, group_.samples(ref.id));
      rows.push_back(std::move(row));
    }
    return rows;
  }

  static void add_curves(Json &row, const Samples &samples) {
    Json values = Json::array();
    Json counts = Json::array();
    for (const CurvePoint &point : samples.responses) {
      values.push_back(point.value);
      counts.push_back(point.count);
    }
    row["responses"] = Json{{"value_ns", std::move(values)}, {"count", std::move(counts)}};
    row["lateness"] = samples.lateness.counts;
  }

  const Group &group_;
  std::vector<TaskRef> refs_;
  std::vector<bool> shown_;
  std::vector<bool> curves_;
};

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

// Returns the DAGs common to all groups with each group's figures over its repetitions. Shares and percentiles of the
// repetitions are spreads. Counts and the maximum cover all repetitions.
Json comparison(std::span<const Group> groups) {
  Json rows = Json::array();
  for (const Dag &dag : groups.front().workload().dags) {
    Json row{{"name", dag.name}, {"groups", Json::array()}};
    for (const Group &group : groups) {
      const std::vector<Dag> &dags = group.workload().dags;
      const auto same = std::find_if(dags.begin(), dags.end(), [&](const Dag &d) { return d.name == dag.name; });
      if (same == dags.end()) break;
      const auto index = static_cast<std::size_t>(same - dags.begin());
      const metrics::DagSummary &all = group.dags()[index];
      std::vector<double> misses;
      for (const RunDigest &run : group.runs()) {
        misses.push_back(run.summary.dags[index].jobs.miss_ratio_with_lost());
      }
      const auto over_runs = [&](Duration metrics::Distribution::*figure) {
        std::vector<double> values;
        for (const RunDigest &run : group.runs()) {
          const metrics::Distribution &response = run.summary.dags[index].end_to_end.response;
          if (response.count > 0) values.push_back(static_cast<double>(response.*figure));
        }
        return values.empty() ? Json() : to_json(spread_of(std::move(values)));
      };
      const metrics::Distribution &response = all.end_to_end.response;
      row["groups"].push_back(Json{
          {"released", all.jobs.released},
          {"late", all.jobs.late},
          {"missed", all.jobs.missed()},
          {"miss_ratio", to_json(spread_of(std::move(misses)))},
          {"end_to_end_late", all.end_to_end.late},
          {"deadline_ns", optional_time(answer_deadline(group.workload().dags[index]))},
          {"p50_ns", over_runs(&metrics::Distribution::p50)},
          {"p95_ns", over_runs(&metrics::Distribution::p95)},
          {"p99_ns", over_runs(&metrics::Distribution::p99)},
          {"max_ns", response.count > 0 ? Json(response.max) : Json()},
      });
    }
    if (row["groups"].size() == groups.size()) rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

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

DigestOptions digest_options(std::size_t groups) {
  // A slice and its job take 60 to 100 bytes.
  constexpr std::size_t kMostSlices = 50'000;
  DigestOptions options;
  options.most_slices = std::clamp<std::size_t>(kMostSlices / std::max<std::size_t>(groups, 1), 200, 16'000);
  return options;
}

std::string to_json(std::span<const Group> groups, const DocumentOptions &options) {
  REDAG_CHECK(!groups.empty(), "a report of nothing");
  std::vector<std::string> cuts;
  Json list = Json::array();
  for (const Group &group : groups) {
    list.push_back(GroupWriter(group, std::max<std::size_t>(options.most_tasks / groups.size(), 10),
                               std::max<std::size_t>(options.most_curves / groups.size(), 5), cuts)
                       .write());
  }
  Json words = Json::array();
  for (const Sentence &sentence : compare(groups)) words.push_back(to_json(sentence));
  for (const std::string &note : options.notes) words.push_back(to_json(Sentence{Tone::Caution, note}));
  const Json document{
      {"format", "redag.report/2"},
      {"provenance", to_json(options.provenance)},
      {"version", kVersion},
      {"title", title_of(groups)},
      {"headline", to_json(headline_of(groups))},
      {"comparison", {{"words", std::move(words)}, {"dags", groups.size() > 1 ? comparison(groups) : Json::array()}}},
      {"groups", std::move(list)},
      {"cuts", cuts}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace redag::report
