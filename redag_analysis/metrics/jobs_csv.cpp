// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/jobs_csv.hpp"

#include <fmt/format.h>

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

// Quotes a field by RFC 4180: one with a comma, a quote or a line break is put in quotes, and its quotes are doubled.
std::string quoted(const std::string &text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"') result += '"';
    result += c;
  }
  return result + '"';
}

std::string time_field(Time time) { return time == kNever ? std::string() : std::to_string(time); }

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

}  // namespace

std::string_view jobs_csv_header() { return kHeader; }

Result<void> write_jobs_csv(const std::string &path, const Workload &workload, std::span<const JobRecord> jobs) {
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  std::vector<std::string> names;  // "dag,task" per TaskId
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) names.push_back(quoted(dag.name) + "," + quoted(task.name));
  }
  file->write(kHeader);
  file->write("\n");
  fmt::memory_buffer line;
  for (const JobRecord &job : jobs) {
    line.clear();
    const bool finished = job.outcome == JobOutcome::Finished;
    const auto out = std::back_inserter(line);
    fmt::format_to(out, "{},{},{},{},{},{},{},{},{},", job.sequence, names.at(job.task.value), job.number,
                   time_field(job.release), time_field(job.ready), time_field(job.start), time_field(job.finish),
                   time_field(job.deadline), time_field(job.origin));
    if (job.worker != WorkerId::kNoneValue) fmt::format_to(out, "{}", job.worker);
    fmt::format_to(out, ",{},{},{:d},{},{}", job.on_worker, job.preemptions, job.deferred, to_string(job.outcome),
                   to_string(job.reason));
    if (finished) {
      fmt::format_to(out, ",{},{},{}\n", job.response(), job.response_from_ready(), job.lateness());
    } else {
      fmt::format_to(out, ",,,\n");
    }
    file->write({line.data(), line.size()});
  }
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
