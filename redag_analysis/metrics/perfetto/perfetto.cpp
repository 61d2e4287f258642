// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto/perfetto.hpp"

#include <algorithm>
#include <map>
#include <unordered_map>
#include <utility>
#include <vector>

#include "redag/derived/clusters.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"
#include "redag_analysis/metrics/perfetto/perfetto_packets.hpp"

namespace redag::metrics {
namespace {

using perfetto::Argument;
using perfetto::Flows;
using perfetto::PacketWriter;
using perfetto::Track;

std::string_view to_text(Miss miss) {
  switch (miss) {
    case Miss::None: return "none";
    case Miss::Lost: return "lost";
    case Miss::Deadline: return "deadline";
    case Miss::EndToEnd: return "end_to_end";
  }
  return "?";
}

Argument number_of(std::uint32_t job) { return {"job", std::int64_t{job}}; }

}  // namespace

class PerfettoWriter::Impl {
 public:
  Impl(trace::OutputFile file, const trace::RunInfo &run)
      : writer_(std::move(file)), run_(run), refs_(flatten(run.workload)), watch_(run.workload), last_time_(run.start) {
    write_run();
    add_workers();
    add_tasks();
  }

  void add(const JobEvent &event) {
    if (event.task.value >= tasks_.size()) return;
    last_time_ = std::max(last_time_, event.time);
    watch_.add(std::span(&event, 1), [&](const JudgedJob &judged) { finish(event, judged); });
    if (event.kind == JobEventKind::Released) return release(event);
    if (is_mode_change(event.kind)) {
      return mark(event, event.kind == JobEventKind::HighMode ? "HI mode begins" : "HI mode ends");
    }
    Live *const job = find(event.task, event.job);
    if (job == nullptr) return;
    switch (event.kind) {
      case JobEventKind::Ready: become_ready(event, *job); break;
      case JobEventKind::Deferred: mark(event, "deferred"); break;
      case JobEventKind::Exceeded: mark(event, "budget used"); break;
      case JobEventKind::Dispatched:
      case JobEventKind::Resumed: open_slice(event, *job); break;
      case JobEventKind::Preempted: close_slice(*job, event.time); break;
      case JobEventKind::Waits:
        close_slice(*job, event.time);
        mark(event, waits_for(event.value));
        break;
      case JobEventKind::Served: mark(event, "served"); break;
      case JobEventKind::Woken: mark(event, "woken"); break;
      default: break;  // the others are done above, or show nothing
    }
  }

  Result<void> commit(Time end) {
    last_time_ = std::max(end, last_time_);
    watch_.finish(last_time_, [&](const JudgedJob &judged) {
      const TaskId task = judged.record.task;
      if (Live *const job = find(task, judged.record.number); job != nullptr) close(*job, task, last_time_, judged);
    });
    return writer_.commit();
  }

 private:
  struct Live {
    std::uint32_t number = 0;
    std::size_t lane = 0;
    std::uint32_t worker = WorkerId::kNoneValue;  // on which it has an open slice
    std::vector<std::uint64_t> flows;             // of the data that it will use
  };
  struct Worker {
    Track track;
    TaskId task;  // of the open slice
    std::uint32_t number = 0;
  };
  struct TaskState {
    std::uint64_t parent = 0;               // the track of its DAG
    std::vector<Track> lanes;               // as many as jobs overlap, of one name, which Perfetto draws as one
    std::vector<Live> live;                 // jobs
    std::vector<std::uint32_t> successors;  // tasks that use its data
  };
  struct Misses {
    std::uint64_t counter = 0;
    std::int64_t count = 0;
  };

  // The beginning of the run is time 0 of the file.
  [[nodiscard]] Time since_start(Time time) const { return std::max<Duration>(time - run_.start, 0); }

  Live *find(TaskId task, std::uint32_t number) {
    std::vector<Live> &live = tasks_[task.value].live;
    const auto job = std::find_if(live.begin(), live.end(), [&](const Live &one) { return one.number == number; });
    return job == live.end() ? nullptr : &*job;
  }

  // States what the run was, as an event at its beginning.
  void write_run() {
    const Provenance &from = run_.provenance;
    std::vector<Argument> arguments = {{"executor", run_.executor},
                                       {"policy", to_string(run_.config.policy)},
                                       {"preemption", run_.preemption},
                                       {"driver", to_string(run_.driver)},
                                       {"seed", static_cast<std::int64_t>(run_.seed)},
                                       {"lost_events", static_cast<std::int64_t>(run_.lost_events)}};
    if (from.is_known()) {
      for (const Argument &one : std::initializer_list<Argument>{{"created", from.created},
                                                                 {"version", from.version},
                                                                 {"revision", from.revision},
                                                                 {"host", from.host},
                                                                 {"kernel", from.kernel},
                                                                 {"command", from.command},
                                                                 {"calibration", from.calibration}}) {
        arguments.push_back(one);
      }
    }
    writer_.instant(writer_.add_track("run " + run_.workload.name), 0, "run", arguments);
  }

  void add_workers() {
    workers_track_ = writer_.add_track("workers (" + run_.executor + ", " + run_.preemption + ")").id;
    for (const ClusterPart &part : parts_of(run_.workload)) {
      if (!part.is_cluster()) continue;
      for (std::uint32_t w = 0; w < part.workload.platform.workers; ++w) {
        worker(part.first_worker + w, " of " + part.name);
      }
    }
    for (std::uint32_t w = 0; w < run_.config.workers; ++w) worker(w);
  }

  // Returns the worker. One that the run does not describe gets its track when it is first seen.
  Worker &worker(std::uint32_t number, const std::string &of_cluster = {}) {
    const auto known = workers_.find(number);
    if (known != workers_.end()) return known->second;
    Track track = writer_.add_track("worker " + std::to_string(number) + of_cluster, workers_track_);
    return workers_.emplace(number, Worker{track, {}, 0}).first->second;
  }

  void add_tasks() {
    for (const Dag &dag : run_.workload.dags) {
      const std::uint64_t parent = writer_.add_track("DAG " + dag.name).id;
      misses_.push_back({writer_.add_counter("misses", parent)});
      const std::size_t first = tasks_.size();
      for (const Task &task : dag.tasks) {
        tasks_.push_back(
            {.parent = parent, .lanes = {writer_.add_track(task.name, parent)}, .live = {}, .successors = {}});
      }
      for (std::size_t t = 0; t < dag.tasks.size(); ++t) {
        for (const std::uint32_t p : dag.tasks[t].predecessors) {
          tasks_[first + p].successors.push_back(static_cast<std::uint32_t>(first + t));
        }
      }
    }
  }

  [[nodiscard]] std::string waits_for(std::int64_t device) const {
    const std::vector<Device> &devices = run_.workload.platform.devices;
    const bool is_known = device >= 0 && device < static_cast<std::int64_t>(devices.size());
    return is_known ? "waits for " + devices[static_cast<std::size_t>(device)].name : "waits";
  }

  void mark(const JobEvent &event, const std::string &name) {
    const Live *const job = find(event.task, event.job);
    const Track &lane = tasks_[event.task.value].lanes[job == nullptr ? 0 : job->lane];
    const Argument number = number_of(event.job);
    writer_.instant(lane, since_start(event.time), name, {&number, 1});
  }

  void release(const JobEvent &event) {
    TaskState &task = tasks_[event.task.value];
    const std::string &name = refs_[event.task.value].task->name;
    const Time release = since_start(event.value);
    const auto free =
        std::find_if(task.lanes.begin(), task.lanes.end(), [&](const Track &lane) { return lane.is_free_at(release); });
    Live job;
    job.number = event.job;
    job.lane = static_cast<std::size_t>(free - task.lanes.begin());
    if (free == task.lanes.end()) task.lanes.push_back(writer_.add_track(name, task.parent));
    const Argument number = number_of(event.job);
    writer_.begin(task.lanes[job.lane], release, name, "", {&number, 1});
    task.live.push_back(std::move(job));
  }

  void become_ready(const JobEvent &event, Live &job) {
    const TaskRef &ref = refs_[event.task.value];
    for (const std::uint32_t p : ref.task->predecessors) {
      const auto flow = flows_.find({event.task.value - ref.index + p, event.task.value});
      if (flow == flows_.end()) continue;
      job.flows.push_back(flow->second);
      flows_.erase(flow);
    }
  }

  void open_slice(const JobEvent &event, Live &job) {
    Worker &on = worker(event.worker);
    if (on.track.is_open) {  // the event that ends it is missing
      if (Live *const other = find(on.task, on.number); other != nullptr) close_slice(*other, event.time);
    }
    on.task = event.task;
    on.number = event.job;
    job.worker = event.worker;
    const TaskRef &ref = refs_[event.task.value];
    const Argument number = number_of(event.job);
    writer_.begin(on.track, since_start(event.time), ref.task->name, run_.workload.dags[ref.dag.value].name,
                  {&number, 1}, job.flows);
    job.flows.clear();
  }

  // Returns false if the job has no worker.
  bool close_slice(Live &job, Time at, Flows leaving = {}) {
    if (job.worker == WorkerId::kNoneValue) return false;
    writer_.end(worker(std::exchange(job.worker, WorkerId::kNoneValue)).track, since_start(at), {}, leaving);
    return true;
  }

  void finish(const JobEvent &event, const JudgedJob &judged) {
    Live *const job = find(event.task, event.job);
    if (job == nullptr) return;
    if (event.kind == JobEventKind::Skipped) mark(event, std::string("skipped: ") + to_string(event.reason));
    close(*job, event.task, judged.record.finish, judged);
    std::erase_if(tasks_[event.task.value].live, [&](const Live &other) { return other.number == event.job; });
  }

  // Ends all slices of a job at `end`. Its misses count now.
  void close(Live &job, TaskId id, Time end, const JudgedJob &judged) {
    const JobRecord &record = judged.record;
    Track &lane = tasks_[id.value].lanes[job.lane];
    std::vector<std::uint64_t> leaving;
    std::vector<Argument> arguments = {{"outcome", to_string(record.outcome)}};
    if (record.outcome == JobOutcome::Finished) {
      for (const std::uint32_t successor : tasks_[id.value].successors) {
        leaving.push_back(flows_[{id.value, successor}] = ++last_flow_);
      }
      arguments.push_back({"slack_ns", record.deadline - record.finish});
    }
    if (close_slice(job, end, leaving)) leaving.clear();
    if (judged.miss == Miss::Deadline && record.deadline <= end) {
      const Argument number = number_of(job.number);
      writer_.instant(lane, since_start(record.deadline), "deadline missed", {&number, 1});
    }
    if (judged.miss != Miss::None) arguments.push_back({"miss", to_text(judged.miss)});
    if (record.reason != Reason::None) arguments.push_back({"reason", to_string(record.reason)});
    writer_.end(lane, since_start(end), arguments, leaving);
    if (judged.miss == Miss::None) return;
    Misses &misses = misses_[refs_[id.value].dag.value];
    writer_.count(misses.counter, since_start(last_time_), ++misses.count);
  }

  PacketWriter writer_;
  const trace::RunInfo &run_;
  std::vector<TaskRef> refs_;
  DeadlineWatch watch_;
  std::uint64_t workers_track_ = 0;
  std::vector<Misses> misses_;  // by DagId
  std::vector<TaskState> tasks_;
  std::unordered_map<std::uint32_t, Worker> workers_;
  // The arrow from the last finished job of a task to a successor's next job, by both tasks, until it is drawn.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint64_t> flows_;
  std::uint64_t last_flow_ = 0;
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
