// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/files/jobs_csv.hpp"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "redag/trace/output_file.hpp"

namespace redag::metrics {
namespace {

constexpr std::string_view kHeader =
    "sequence,dag,task,job,release_ns,ready_ns,start_ns,finish_ns,deadline_ns,origin_ns,worker,on_worker_ns,"
    "preemptions,deferred,outcome,reason,response_ns,response_from_ready_ns,lateness_ns";
std::string row_of(const JobRecord &job, const std::string &name) {
  std::string row;
  const auto out = std::back_inserter(row);
  const auto time = [&row, out](Time value) {
    if (value != kNever) fmt::format_to(out, FMT_COMPILE("{}"), value);
    row += ',';
  };
  fmt::format_to(out, FMT_COMPILE("{},{},{},"), job.sequence, name, job.number);
  for (const Time value : {job.release, job.ready, job.start, job.finish, job.deadline, job.origin}) time(value);
  if (job.worker != WorkerId::kNoneValue) fmt::format_to(out, FMT_COMPILE("{}"), job.worker);
  fmt::format_to(out, FMT_COMPILE(",{},{},{},{},{},"), job.on_worker, job.preemptions, job.deferred ? 1 : 0,
                 to_string(job.outcome), to_string(job.reason));
  if (job.outcome == JobOutcome::Finished) {
    fmt::format_to(out, FMT_COMPILE("{},{},{}\n"), job.response(), job.response_from_ready(), job.lateness());
  } else {
    row += ",,\n";
  }
  return row;
}

// The order of a heap whose front was released first.
bool released_later(const JobRecord &a, const JobRecord &b) { return a.sequence > b.sequence; }

// Quotes a field by RFC 4180, if it needs quotes.
std::string quoted(const std::string &text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  // A field with a comma, a quote or a line break is put in quotes, and its quotes are doubled.
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"') result += '"';
    result += c;
  }
  return result + '"';
}

// Returns the fields "dag,task" by TaskId.
std::vector<std::string> task_names(const Workload &workload) {
  std::vector<std::string> names;
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) names.push_back(quoted(dag.name) + "," + quoted(task.name));
  }
  return names;
}

}  // namespace

JobsCsvWriter::JobsCsvWriter(trace::OutputFile file, const Workload &workload, std::size_t most_held)
    : file_(std::move(file)), names_(task_names(workload)), folder_(workload), most_held_(most_held) {
  file_.write(kHeader);
  file_.write("\n");
}

Result<JobsCsvWriter> JobsCsvWriter::create(const std::string &path, const Workload &workload, std::size_t most_held) {
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return JobsCsvWriter(*std::move(file), workload, most_held);
}

void JobsCsvWriter::add(std::span<const JobEvent> events) {
  folder_.add(events);
  folder_.drain_ended([this](const JobRecord &job) { hold(job); });
}

void JobsCsvWriter::hold(const JobRecord &job) {
  held_.push_back(job);
  std::push_heap(held_.begin(), held_.end(), released_later);
  while (!held_.empty() && (held_.front().sequence <= next_ || held_.size() > most_held_)) write_first();
}

void JobsCsvWriter::write_first() {
  std::pop_heap(held_.begin(), held_.end(), released_later);
  const JobRecord &job = held_.back();
  file_.write(row_of(job, names_.at(job.task.value)));
  next_ = std::max(next_, job.sequence + 1);
  held_.pop_back();
}

Result<void> JobsCsvWriter::commit() {
  const std::vector<JobRecord> live = folder_.in_flight();
  held_.insert(held_.end(), live.begin(), live.end());
  std::make_heap(held_.begin(), held_.end(), released_later);
  while (!held_.empty()) write_first();
  return file_.commit();
}

}  // namespace redag::metrics
