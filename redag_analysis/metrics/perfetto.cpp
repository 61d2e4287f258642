// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "redag/model/clusters.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"
#include "redag_analysis/metrics/perfetto_packets.hpp"
#include "redag_analysis/metrics/perfetto_tracks.hpp"

namespace redag::metrics {
namespace {

using perfetto::Argument;
using perfetto::ArgumentName;
using perfetto::ArgumentText;
using perfetto::Category;
using perfetto::Counters;
using perfetto::EventName;
using perfetto::Lanes;
using perfetto::PacketWriter;
using perfetto::SliceDetails;
using perfetto::SliceTrack;
using perfetto::Track;

const char *to_text(Miss miss) {
  switch (miss) {
    case Miss::None: return "none";
    case Miss::Lost: return "lost";
    case Miss::Deadline: return "deadline";
    case Miss::EndToEnd: return "end_to_end";
  }
  return "?";
}

}  // namespace

class PerfettoWriter::Impl {
 public:
  Impl(trace::OutputFile file, const trace::RunInfo &run)
      : writer_(std::move(file)),
        run_(run),
        refs_(flatten(run.workload)),
        watch_(run.workload),
        counters_(writer_),
        last_time_(run.start) {
    write_run();
    add_workers();
    add_tasks();
  }

  void add(const JobEvent &event) {
    if (event.task.value >= tasks_.size()) return;
    last_time_ = std::max(last_time_, event.time);
    counters_.advance(since_start(last_time_));
    watch_.add(std::span(&event, 1), [&](const JudgedJob &judged) { finish(event, judged); });
    if (event.kind == JobEventKind::Released) return release(event);
    if (is_mode_change(event.kind)) {
      return mark(event, event.kind == JobEventKind::HighMode ? "HI mode begins" : "HI mode ends");
    }
    Live *const job = find(event);
    if (job == nullptr) return;
    switch (event.kind) {
      case JobEventKind::Ready: become_ready(event, *job); break;
      case JobEventKind::Deferred: mark(event, "deferred"); break;
      case JobEventKind::Exceeded: mark(event, "budget used"); break;
      case JobEventKind::Dispatched:
        if (!std::exchange(job->started, true)) count(dag_of(event.task).active, 1);
        leave_ready(*job);
        open_slice(event, *job);
        break;
      case JobEventKind::Resumed: open_slice(event, *job); break;
      case JobEventKind::Preempted: close_slice(*job, event.time, {}); break;
      case JobEventKind::Waits:
        close_slice(*job, event.time, {});
        mark(event, waits_for(event.value));
        break;
      case JobEventKind::Served: mark(event, "served"); break;
      case JobEventKind::Woken: mark(event, "woken"); break;
      default: break;  // the others are done above, or show nothing
    }
  }

  Result<void> commit(Time end) {
    end = std::max(end, last_time_);
    watch_.finish(end, [&](const JudgedJob &judged) {
      const TaskId task = judged.record.task;
      if (Live *const job = find(task, judged.record.number); job != nullptr) close(*job, task, end, end, judged);
    });
    counters_.advance(kNever);
    return writer_.commit();
  }

 private:
  struct Live {
    std::uint32_t number = 0;
    std::size_t lane = 0;
    bool ready = false;
    bool started = false;
    std::uint32_t worker = WorkerId::kNoneValue;  // on which it has an open slice
    std::vector<std::uint64_t> flows_in;          // of the data that it will use
  };
  struct Worker {
    SliceTrack slices;
    TaskId task;  // of the open slice
    std::uint32_t number = 0;
  };
  struct TaskState {
    EventName name = EventName::None;
    Category category = Category::None;
    Lanes lanes;
    std::vector<Live> live;
    std::vector<std::uint32_t> successors;    // tasks that use its data
    std::vector<std::uint64_t> data;          // by successor: arrow from the last finished job; 0: it is drawn
    std::vector<std::uint32_t> place_before;  // by predecessor: this task's place among its successors
  };
  struct DagCounters {
    std::size_t active = 0;
    std::size_t misses = 0;
  };

  // The beginning of the run is time 0 of the file.
  [[nodiscard]] Time since_start(Time time) const { return std::max<Duration>(time - run_.start, 0); }
  [[nodiscard]] const DagCounters &dag_of(TaskId task) const { return dags_[refs_[task.value].dag.value]; }

  Live *find(TaskId task, std::uint32_t number) {
    for (Live &job : tasks_[task.value].live) {
      if (job.number == number) return &job;
    }
    return nullptr;
  }
  Live *find(const JobEvent &event) { return find(event.task, event.job); }

  void count(std::size_t counter, std::int64_t by) { counters_.change(counter, by, since_start(last_time_)); }

  // States what the run was, as an event at its beginning.
  void write_run() {
    const Track track = writer_.add_track("run " + run_.workload.name);
    const Provenance &from = run_.provenance;
    const auto argument = [&](const char *name, const std::string &value) {
      return Argument(writer_.argument_name(name), std::string_view(value));
    };
    const std::string policy = to_string(run_.config.policy);
    const std::string driver = to_string(run_.driver);
    std::vector<Argument> arguments = {argument("executor", run_.executor), argument("policy", policy),
                                       argument("preemption", run_.preemption), argument("driver", driver)};
    arguments.emplace_back(writer_.argument_name("seed"), static_cast<std::int64_t>(run_.seed));
    arguments.emplace_back(writer_.argument_name("lost_events"), static_cast<std::int64_t>(run_.lost_events));
    if (from.is_known()) {
      for (const Argument &one :
           {argument("created", from.created), argument("version", from.version), argument("revision", from.revision),
            argument("host", from.host), argument("kernel", from.kernel), argument("command", from.command),
            argument("calibration", from.calibration)}) {
        arguments.push_back(one);
      }
    }
    writer_.instant(track, 0, writer_.event_name("run"), arguments);
  }

  void add_workers() {
    workers_track_ = writer_.add_track("workers (" + run_.executor + ", " + run_.preemption + ")");
    ready_ = counters_.add(writer_.add_counter("ready jobs", workers_track_));
    std::unordered_map<std::uint32_t, std::string> clusters;
    for (const ClusterPart &part : parts_of(run_.workload)) {
      if (!part.is_cluster()) continue;
      for (std::uint32_t w = 0; w < part.workload.platform.workers; ++w) clusters[part.first_worker + w] = part.name;
    }
    for (std::uint32_t w = 0; w < run_.config.workers; ++w) {
      const auto cluster = clusters.find(w);
      add_worker(w, cluster == clusters.end() ? "" : " of " + cluster->second);
    }
  }

  Worker &add_worker(std::uint32_t number, const std::string &more) {
    const Track track = writer_.add_track("worker " + std::to_string(number) + more, workers_track_);
    return workers_.emplace(number, Worker{SliceTrack(track), {}, 0}).first->second;
  }

  Worker &worker(std::uint32_t number) {
    const auto known = workers_.find(number);
    return known == workers_.end() ? add_worker(number, "") : known->second;
  }

  void add_tasks() {
    job_ = writer_.argument_name("job");
    outcome_ = writer_.argument_name("outcome");
    miss_ = writer_.argument_name("miss");
    reason_ = writer_.argument_name("reason");
    slack_ = writer_.argument_name("slack_ns");
    tasks_.reserve(refs_.size());
    for (const Dag &dag : run_.workload.dags) {
      const Track parent = writer_.add_track("DAG " + dag.name);
      DagCounters counters;
      counters.active = counters_.add(writer_.add_counter("jobs in progress", parent));
      counters.misses = counters_.add(writer_.add_counter("misses", parent));
      dags_.push_back(counters);
      for (const Task &task : dag.tasks) {
        tasks_.push_back({writer_.event_name(task.name),
                          writer_.category(dag.name),
                          Lanes(writer_, task.name, parent),
                          {},
                          {},
                          {},
                          {}});
      }
    }
    for (std::size_t t = 0; t < refs_.size(); ++t) {
      for (const std::uint32_t p : refs_[t].task->predecessors) {
        std::vector<std::uint32_t> &successors = tasks_[t - refs_[t].index + p].successors;
        tasks_[t].place_before.push_back(static_cast<std::uint32_t>(successors.size()));
        successors.push_back(static_cast<std::uint32_t>(t));
      }
    }
    for (TaskState &task : tasks_) task.data.resize(task.successors.size());
  }

  [[nodiscard]] std::string waits_for(std::int64_t device) const {
    const std::vector<Device> &devices = run_.workload.platform.devices;
    const bool is_known = device >= 0 && device < static_cast<std::int64_t>(devices.size());
    return is_known ? "waits for " + devices[static_cast<std::size_t>(device)].name : "waits";
  }

  void mark(const JobEvent &event, const std::string &name) {
    const Live *const job = find(event);
    Lanes &lanes = tasks_[event.task.value].lanes;
    const std::array arguments = {Argument(job_, std::int64_t{event.job})};
    writer_.instant(lanes[job == nullptr ? 0 : job->lane].track(), since_start(event.time), writer_.event_name(name),
                    arguments);
  }

  void release(const JobEvent &event) {
    TaskState &task = tasks_[event.task.value];
    Live job;
    job.number = event.job;
    const Time release = since_start(event.value);
    job.lane = task.lanes.free_lane(release);
    SliceTrack &lane = task.lanes[job.lane];
    const std::array arguments = {Argument(job_, std::int64_t{event.job})};
    writer_.begin(lane.track(), lane.begin(release), task.name, Category::None, {.arguments = arguments});
    task.live.push_back(std::move(job));
  }

  void become_ready(const JobEvent &event, Live &job) {
    if (!std::exchange(job.ready, true)) count(ready_, 1);
    const TaskState &task = tasks_[event.task.value];
    const std::size_t first = event.task.value - refs_[event.task.value].index;
    const std::vector<std::uint32_t> &predecessors = refs_[event.task.value].task->predecessors;
    for (std::size_t i = 0; i < predecessors.size(); ++i) {
      std::uint64_t &flow = tasks_[first + predecessors[i]].data[task.place_before[i]];
      if (flow != 0) job.flows_in.push_back(std::exchange(flow, 0));
    }
  }

  void leave_ready(Live &job) {
    if (std::exchange(job.ready, false)) count(ready_, -1);
  }

  void open_slice(const JobEvent &event, Live &job) {
    const TaskState &task = tasks_[event.task.value];
    Worker &on = worker(event.worker);
    if (on.slices.is_open()) {  // the event that ends it is missing
      if (Live *const other = find(on.task, on.number); other != nullptr) close_slice(*other, event.time, {});
    }
    on.task = event.task;
    on.number = event.job;
    job.worker = event.worker;
    const std::array arguments = {Argument(job_, std::int64_t{event.job})};
    writer_.begin(on.slices.track(), on.slices.begin(since_start(event.time)), task.name, task.category,
                  {.arguments = arguments, .flows_out = {}, .flows_in = job.flows_in});
    job.flows_in.clear();
  }

  // Returns false if the job has no worker.
  bool close_slice(Live &job, Time at, std::span<const std::uint64_t> flows) {
    if (job.worker == WorkerId::kNoneValue) return false;
    SliceTrack &slices = worker(std::exchange(job.worker, WorkerId::kNoneValue)).slices;
    writer_.end(slices.track(), slices.end(since_start(at)), {.arguments = {}, .flows_out = flows, .flows_in = {}});
    return true;
  }

  // Begins an arrow to each successor of a task, from a job that finished now.
  const std::vector<std::uint64_t> &begin_flows(TaskState &task) {
    for (std::uint64_t &flow : task.data) flow = ++flows_;
    return task.data;
  }

  void finish(const JobEvent &event, const JudgedJob &judged) {
    Live *const job = find(event);
    if (job == nullptr) return;
    if (event.kind == JobEventKind::Skipped) mark(event, std::string("skipped: ") + to_string(event.reason));
    close(*job, event.task, judged.record.finish, event.time, judged);
    std::erase_if(tasks_[event.task.value].live, [&](const Live &other) { return other.number == event.job; });
  }

  // Ends all slices of a job at `end`. Its misses count at `now`.
  void close(Live &job, TaskId id, Time end, Time now, const JudgedJob &judged) {
    const JobRecord &record = judged.record;
    last_time_ = std::max(last_time_, now);
    TaskState &task = tasks_[id.value];
    SliceTrack &lane = task.lanes[job.lane];
    std::span<const std::uint64_t> flows;
    if (record.outcome == JobOutcome::Finished) flows = begin_flows(task);
    if (close_slice(job, end, flows)) flows = {};
    if (judged.miss == Miss::Deadline && record.deadline <= end) {
      const std::array arguments = {Argument(job_, std::int64_t{job.number})};
      writer_.instant(lane.track(), since_start(record.deadline), writer_.event_name("deadline missed"), arguments);
    }
    std::vector<Argument> &arguments = arguments_;
    arguments.assign(1, Argument(outcome_, writer_.argument_text(to_string(record.outcome))));
    if (record.outcome == JobOutcome::Finished) arguments.emplace_back(slack_, record.deadline - record.finish);
    if (judged.miss != Miss::None) arguments.emplace_back(miss_, writer_.argument_text(to_text(judged.miss)));
    if (record.reason != Reason::None) arguments.emplace_back(reason_, writer_.argument_text(to_string(record.reason)));
    writer_.end(lane.track(), lane.end(since_start(end)), {.arguments = arguments, .flows_out = flows, .flows_in = {}});
    leave_ready(job);
    if (job.started) count(dag_of(id).active, -1);
    if (judged.miss != Miss::None) count(dag_of(id).misses, 1);
  }

  PacketWriter writer_;
  const trace::RunInfo &run_;
  std::vector<TaskRef> refs_;
  DeadlineWatch watch_;
  Counters counters_;
  Track workers_track_ = Track::None;
  std::size_t ready_ = 0;
  std::vector<DagCounters> dags_;
  std::vector<TaskState> tasks_;
  std::unordered_map<std::uint32_t, Worker> workers_;
  ArgumentName job_ = ArgumentName::None;
  ArgumentName outcome_ = ArgumentName::None;
  ArgumentName miss_ = ArgumentName::None;
  ArgumentName reason_ = ArgumentName::None;
  ArgumentName slack_ = ArgumentName::None;
  std::vector<Argument> arguments_;  // reused
  std::uint64_t flows_ = 0;
  Time last_time_;
};

PerfettoWriter::PerfettoWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PerfettoWriter::PerfettoWriter(PerfettoWriter &&) noexcept = default;
PerfettoWriter::~PerfettoWriter() = default;

Result<PerfettoWriter> PerfettoWriter::create(const std::string &path, const trace::RunInfo &run) {
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return PerfettoWriter(std::make_unique<Impl>(std::move(*file), run));
}

void PerfettoWriter::add(std::span<const JobEvent> events) {
  for (const JobEvent &event : events) impl_->add(event);
}

Result<void> PerfettoWriter::commit(Time end) { return impl_->commit(end); }

Result<void> write_perfetto(const std::string &path, const trace::Trace &trace) {
  Result<PerfettoWriter> writer = PerfettoWriter::create(path, trace.info);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  writer->add(trace.events);
  return writer->commit(trace.info.end);
}

}  // namespace redag::metrics
