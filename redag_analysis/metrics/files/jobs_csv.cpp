// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/files/jobs_csv.hpp"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <map>
#include <optional>
#include <utility>

#include "redag/trace/output_file.hpp"

namespace redag::metrics {
namespace {

using trace::file_error;

constexpr std::string_view kHeader =
    "sequence,dag,task,job,release_ns,ready_ns,start_ns,finish_ns,deadline_ns,origin_ns,worker,on_worker_ns,"
    "preemptions,deferred,outcome,reason,response_ns,response_from_ready_ns,lateness_ns";
constexpr std::size_t kColumns = 19;

// Takes the next record off `text`; returns false if a quote is not closed.
bool take_record(std::string_view &text, std::vector<std::string> &fields, int &lines) {
  fields.assign(1, {});
  bool in_quotes = false;
  std::size_t i = 0;
  for (; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\n') ++lines;
    if (c == '"') {
      if (in_quotes && i + 1 < text.size() && text[i + 1] == '"') {
        fields.back() += text[++i];
      } else {
        in_quotes = !in_quotes;
      }
    } else if (!in_quotes && c == '\n') {
      ++i;
      break;
    } else if (!in_quotes && c == ',') {
      fields.emplace_back();
    } else if (in_quotes || c != '\r') {
      fields.back() += c;
    }
  }
  text.remove_prefix(i);
  return !in_quotes;
}

template <class Integer>
bool read(const std::string &field, Integer &value) {
  const char *end = field.data() + field.size();
  const auto [stop, error] = std::from_chars(field.data(), end, value);
  return error == std::errc{} && stop == end;
}

bool read_time(const std::string &field, Time &time) {
  time = kNever;
  return field.empty() || read(field, time);
}

template <class Enum>
bool read_name(const std::string &field, Enum &value, Enum last) {
  for (auto i = 0U; i <= static_cast<unsigned>(last); ++i) {
    value = static_cast<Enum>(i);
    if (field == to_string(value)) return true;
  }
  return false;
}

// Parses a row except DAG and task, which the caller handles. Returns null, or the name of the unreadable column.
const char *read_row(const std::vector<std::string> &fields, JobRecord &job) {
  if (!read(fields[0], job.sequence)) return "sequence";
  if (!read(fields[3], job.number)) return "job";
  if (!read_time(fields[4], job.release)) return "release_ns";
  if (!read_time(fields[5], job.ready)) return "ready_ns";
  if (!read_time(fields[6], job.start)) return "start_ns";
  if (!read_time(fields[7], job.finish)) return "finish_ns";
  if (!read_time(fields[8], job.deadline)) return "deadline_ns";
  if (!read_time(fields[9], job.origin)) return "origin_ns";
  job.worker = WorkerId::kNoneValue;
  if (!fields[10].empty() && !read(fields[10], job.worker)) return "worker";
  if (!read(fields[11], job.on_worker)) return "on_worker_ns";
  if (!read(fields[12], job.preemptions)) return "preemptions";
  if (fields[13] != "0" && fields[13] != "1") return "deferred";
  job.deferred = fields[13] == "1";
  if (!read_name(fields[14], job.outcome, JobOutcome::Aborted)) return "outcome";
  if (!read_name(fields[15], job.reason, kLastReason)) return "reason";
  return nullptr;
}

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

}  // namespace

std::string csv_quoted(const std::string &text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  // A field with a comma, a quote or a line break is put in quotes, and its quotes are doubled.
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"') result += '"';
    result += c;
  }
  return result + '"';
}

std::vector<std::string> csv_task_names(const Workload &workload) {
  std::vector<std::string> names;
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) names.push_back(csv_quoted(dag.name) + "," + csv_quoted(task.name));
  }
  return names;
}

std::string_view jobs_csv_header() { return kHeader; }

JobsCsvWriter::JobsCsvWriter(trace::OutputFile file, const Workload &workload, std::size_t most_held)
    : file_(std::move(file)), names_(csv_task_names(workload)), folder_(workload), most_held_(most_held) {
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

Result<void> write_jobs_csv(const std::string &path, const Workload &workload, std::span<const JobRecord> jobs) {
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  const std::vector<std::string> names = csv_task_names(workload);
  file->write(kHeader);
  file->write("\n");
  for (const JobRecord &job : jobs) file->write(row_of(job, names.at(job.task.value)));
  return file->commit();
}

Result<std::vector<JobRecord>> read_jobs_csv(const std::string &path, const Workload &workload) {
  const Result<std::string> text = trace::read_file(path);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  return parse_jobs_csv(*text, path, workload);
}

Result<std::vector<JobRecord>> parse_jobs_csv(std::string_view text, const std::string &file,
                                              const Workload &workload) {
  std::map<std::pair<std::string, std::string>, TaskId> ids;
  std::size_t next_id = 0;
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) ids.emplace(std::pair(dag.name, task.name), TaskId(next_id++));
  }
  if (text.substr(0, text.find('\n')) != kHeader) {
    return file_error(file, 1, "this is not a jobs.csv: the first line must be its header", std::string(kHeader));
  }
  text.remove_prefix(std::min(text.size(), kHeader.size() + 1));

  std::vector<JobRecord> jobs;
  std::vector<std::string> fields;
  int next_line = 2;
  while (!text.empty()) {
    const int line = next_line;
    if (!take_record(text, fields, next_line)) return file_error(file, line, "a quote is not closed");
    if (fields.size() != kColumns) {
      return file_error(file, line,
                        "each row must have " + std::to_string(kColumns) + " columns, but this one has " +
                            std::to_string(fields.size()));
    }
    JobRecord job;
    const auto id = ids.find(std::pair(fields[1], fields[2]));
    if (id == ids.end()) return file_error(file, line, "there is no task " + fields[1] + "." + fields[2]);
    job.task = id->second;
    if (const char *column = read_row(fields, job)) {
      return file_error(file, line, std::string("cannot parse column ") + column);
    }
    jobs.push_back(job);
  }
  return jobs;
}

}  // namespace redag::metrics
