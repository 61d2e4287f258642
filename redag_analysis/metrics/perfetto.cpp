// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "redag/model/clusters.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/miss.hpp"

namespace redag::metrics {
namespace {

constexpr int kWorkersProcess = 1;
constexpr int kFirstDagProcess = 2;

// A JSON string with its quotes.
std::string json_text(const std::string &text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

class PerfettoWriter::Impl {
 public:
  Impl(trace::OutputFile file, const trace::RunInfo &run, const PerfettoOptions &options)
      : file_(std::move(file)), run_(run), options_(options), refs_(flatten(run.workload)), folder_(run.workload) {
    for (const TaskRef &ref : refs_) {
      TaskState state;
      state.label = json_text(ref.task->name);
      state.category = json_text(run.workload.dags[ref.dag.value].name);
      tasks_.push_back(std::move(state));
    }
    write_names();
  }

  void add(const JobEvent &event) {
    if (event.task.value >= tasks_.size()) return;
    folder_.add(std::span(&event, 1));
    last_time_ = std::max(last_time_, event.time);
    Live *job = find(event);
    switch (event.kind) {
      case JobEventKind::Released: tasks_[event.task.value].live.push_back(Live{event.job, {}, kNever, 0, {}}); break;
      case JobEventKind::Ready:
        if (job != nullptr) remember_sources(event.task, *job);
        break;
      case JobEventKind::Dispatched:
      case JobEventKind::Resumed:
        if (job != nullptr) open_slice(event, *job);
        break;
      case JobEventKind::Preempted:
        if (job != nullptr) close_slice(*job, event.time);
        break;
      case JobEventKind::Deferred: instant(event.task, event.time, "deferred", event.job); break;
      case JobEventKind::Exceeded: instant(event.task, event.time, "budget used", event.job); break;
      case JobEventKind::HighMode: instant(event.task, event.time, "HI mode begins", event.job); break;
      case JobEventKind::LowMode: instant(event.task, event.time, "HI mode ends", event.job); break;
      case JobEventKind::Started:
      case JobEventKind::Executed: break;
      case JobEventKind::Finished:
      case JobEventKind::Aborted:
      case JobEventKind::Skipped:
        if (job != nullptr) end(event, *job);
        break;
    }
  }

  Result<void> commit(Time end) {
    end = std::max(end, last_time_);
    for (const JobRecord &record : folder_.in_flight()) {
      for (Live &job : tasks_[record.task.value].live) {
        if (job.number != record.number) continue;
        close_slice(job, end);
        write_job(record, job, end, end);
      }
    }
    file_.write("\n]}\n");
    return file_.commit();
  }

 private:
  struct Slice {
    std::uint32_t worker = 0;
    Time from = 0;
    Time to = 0;
  };
  struct Live {
    std::uint32_t number = 0;
    std::vector<Slice> slices;
    Time since = kNever;
    std::uint32_t worker = 0;
    std::vector<Slice> sources;  // last slices of the jobs whose data it uses
  };
  struct TaskState {
    std::string label;
    std::string category;
    std::vector<Live> live;
    Slice last;  // of the job that finished last
    bool has_finished = false;
  };

  Live *find(const JobEvent &event) {
    for (Live &job : tasks_[event.task.value].live) {
      if (job.number == event.job) return &job;
    }
    return nullptr;
  }

  // Formats the time since the start of the run in microseconds, to the nanosecond.
  [[nodiscard]] std::string stamp(Time time) const { return duration(time - run_.start); }
  static std::string duration(Duration time) {
    const Duration size = time < 0 ? -time : time;
    return fmt::format("{}{}.{:03}", time < 0 ? "-" : "", size / 1000, size % 1000);
  }
  [[nodiscard]] int dag_process(TaskId task) const {
    return kFirstDagProcess + static_cast<int>(refs_[task.value].dag.value);
  }

  [[nodiscard]] std::string opening() const {
    std::string text = R"({"displayTimeUnit":"ms",)";
    if (run_.provenance.is_known()) text += "\"otherData\":" + provenance_to_json(run_.provenance) + ",";
    return text + "\"traceEvents\":[\n";
  }

  void write(const std::string &event) {
    file_.write(first_ ? opening() : ",\n");
    first_ = false;
    file_.write(event);
  }

  void write_name(const char *what, int process, std::uint32_t thread, const std::string &name) {
    write(fmt::format(R"({{"ph":"M","name":"{}","pid":{},"tid":{},"args":{{"name":{}}}}})", what, process, thread,
                      json_text(name)));
  }

  void write_names() {
    write_name("process_name", kWorkersProcess, 0, "workers (" + run_.executor + ", " + run_.preemption + ")");
    std::vector<std::string> names;
    for (const ClusterPart &part : parts_of(run_.workload)) {
      if (part.is_cluster()) names.resize(part.first_worker + part.workload.platform.workers, " of " + part.name);
    }
    names.resize(run_.config.workers);
    for (std::uint32_t w = 0; w < run_.config.workers; ++w) {
      write_name("thread_name", kWorkersProcess, w, "worker " + std::to_string(w) + names[w]);
    }
    for (std::size_t d = 0; d < run_.workload.dags.size(); ++d) {
      const int process = kFirstDagProcess + static_cast<int>(d);
      write_name("process_name", process, 0, "DAG " + run_.workload.dags[d].name);
    }
    for (std::size_t t = 0; t < refs_.size(); ++t) {
      write_name("thread_name", dag_process(TaskId(t)), refs_[t].index, refs_[t].task->name);
    }
  }

  void instant(TaskId task, Time time, const std::string &name, std::uint32_t number) {
    write(fmt::format(R"({{"ph":"i","s":"t","name":"{}","cat":{},"pid":{},"tid":{},"ts":{},"args":{{"job":{}}}}})",
                      name, tasks_[task.value].category, dag_process(task), refs_[task.value].index, stamp(time),
                      number));
  }

  void remember_sources(TaskId task, Live &job) {
    if (!options_.flows) return;
    const std::size_t first = task.value - refs_[task.value].index;
    for (const std::uint32_t p : refs_[task.value].task->predecessors) {
      const TaskState &source = tasks_[first + p];
      if (source.has_finished) job.sources.push_back(source.last);
    }
  }

  void open_slice(const JobEvent &event, Live &job) {
    job.since = event.time;
    job.worker = event.worker;
    for (const Slice &source : job.sources) {
      // An arrow binds to the slice that encloses its stamp; the last nanosecond of the source lies inside it.
      ++flow_;
      write(fmt::format(R"({{"ph":"s","id":{},"name":"data","cat":"data","pid":{},"tid":{},"ts":{}}})", flow_,
                        kWorkersProcess, source.worker, stamp(std::max(source.from, source.to - 1))));
      write(fmt::format(R"({{"ph":"f","bp":"e","id":{},"name":"data","cat":"data","pid":{},"tid":{},"ts":{}}})", flow_,
                        kWorkersProcess, event.worker, stamp(event.time)));
    }
    job.sources.clear();
  }

  static void close_slice(Live &job, Time at) {
    if (job.since == kNever) return;
    job.slices.push_back(Slice{job.worker, job.since, std::max(job.since, at)});
    job.since = kNever;
  }

  void end(const JobEvent &event, Live &job) {
    close_slice(job, event.kind == JobEventKind::Skipped ? event.time : event.value);
    TaskState &task = tasks_[event.task.value];
    if (event.kind == JobEventKind::Finished && !job.slices.empty()) {
      task.last = job.slices.back();
      task.has_finished = true;
    }
    for (const JobRecord &record : folder_.take_ended()) write_job(record, job, record.finish, event.time);
    if (event.kind == JobEventKind::Skipped) {
      instant(event.task, event.time, std::string("skipped: ") + to_string(event.reason), event.job);
    }
    const std::uint32_t number = event.job;
    std::erase_if(task.live, [&](const Live &other) { return other.number == number; });
  }

  // Writes the job's slices on its workers, and its span from release to end.
  void write_job(const JobRecord &record, const Live &job, Time end, Time now) {
    const TaskState &task = tasks_[record.task.value];
    std::string args = fmt::format(R"("job":{},"outcome":"{}","release_us":{})", record.number,
                                   to_string(record.outcome), stamp(record.release));
    if (record.reason != Reason::None) args += fmt::format(R"(,"reason":"{}")", to_string(record.reason));
    if (record.outcome == JobOutcome::Finished) {
      args += fmt::format(R"(,"response_us":{},"lateness_us":{})", duration(record.response()),
                          duration(record.lateness()));
    }
    for (const Slice &slice : job.slices) {
      write(fmt::format(R"({{"ph":"X","name":{},"cat":{},"pid":{},"tid":{},"ts":{},"dur":{},"args":{{{}}}}})",
                        task.label, task.category, kWorkersProcess, slice.worker, stamp(slice.from),
                        duration(slice.to - slice.from), args));
    }
    const std::string id = fmt::format("{}.{}", record.task.value, record.number);
    write(fmt::format(R"({{"ph":"b","id":"{}","name":{},"cat":{},"pid":{},"tid":{},"ts":{},"args":{{{}}}}})", id,
                      task.label, task.category, dag_process(record.task), refs_[record.task.value].index,
                      stamp(record.release), args));
    write(fmt::format(R"({{"ph":"e","id":"{}","name":{},"cat":{},"pid":{},"tid":{},"ts":{}}})", id, task.label,
                      task.category, dag_process(record.task), refs_[record.task.value].index,
                      stamp(std::max(record.release, end))));
    if (miss_of(record, now) == Miss::Deadline) instant(record.task, record.deadline, "deadline missed", record.number);
  }

  trace::OutputFile file_;
  const trace::RunInfo &run_;
  PerfettoOptions options_;
  std::vector<TaskRef> refs_;
  std::vector<TaskState> tasks_;
  JobFolder folder_;
  Time last_time_ = 0;
  std::uint64_t flow_ = 0;
  bool first_ = true;
};

PerfettoWriter::PerfettoWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PerfettoWriter::PerfettoWriter(PerfettoWriter &&) noexcept = default;
PerfettoWriter::~PerfettoWriter() = default;

Result<PerfettoWriter> PerfettoWriter::create(const std::string &path, const trace::RunInfo &run,
                                              const PerfettoOptions &options) {
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return PerfettoWriter(std::make_unique<Impl>(std::move(*file), run, options));
}

void PerfettoWriter::add(std::span<const JobEvent> events) {
  for (const JobEvent &event : events) impl_->add(event);
}

Result<void> PerfettoWriter::commit(Time end) { return impl_->commit(end); }

Result<void> write_perfetto(const std::string &path, const trace::Trace &trace, const PerfettoOptions &options) {
  Result<PerfettoWriter> writer = PerfettoWriter::create(path, trace.info, options);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  writer->add(trace.events);
  return writer->commit(trace.info.end);
}

}  // namespace redag::metrics
