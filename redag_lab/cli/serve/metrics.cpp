// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/serve/metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <iterator>
#include <string_view>
#include <utility>

namespace redag::cli {
namespace {

using live::DagFrame;
using live::Frame;
using live::TaskFrame;

double seconds(Duration time) { return static_cast<double>(time) / static_cast<double>(kSecond); }

std::string label(std::string_view name, std::string_view value) {
  std::string text = fmt::format("{}=\"", name);
  for (const char c : value) {
    if (c == '\\' || c == '"') text += '\\';
    text += c == '\n' ? "\\n" : std::string(1, c);
  }
  return text + '"';
}

/// Adds a label to those of `labels`.
std::string with(const std::string &labels, std::string_view name, std::string_view value) {
  return labels + ',' + label(name, value);
}

/// One metric, and its values of all executors.
class Family {
 public:
  Family(const char *type, const char *name, const char *help) : type_(type), name_(name), help_(help) {}

  template <typename Number>
  void add(const std::string &labels, Number value) {
    add_line("", labels, static_cast<double>(value));
  }

  void add(const std::string &labels, const live::page::Spread &spread) {
    std::uint64_t count = 0;
    for (std::size_t i = 0; i < live::page::kClasses; ++i) {
      count += spread.all[i];
      // The longest time of a class: the next class begins a nanosecond later.
      const bool is_last = i + 1 == live::page::kClasses;
      const std::string most = is_last ? "+Inf" : fmt::to_string(seconds(live::page::least_in(i + 1) - 1));
      add_line("_bucket", with(labels, "le", most), static_cast<double>(count));
    }
    add_line("_count", labels, static_cast<double>(count));
    lines_ += fmt::format("{}_sum{{{}}} NaN\n", name_, labels);  // the page has none
  }

  /// Returns the metric's text; empty without values.
  [[nodiscard]] std::string text() const {
    if (lines_.empty()) return {};
    return fmt::format("# HELP {0} {1}\n# TYPE {0} {2}\n{3}", name_, help_, type_, lines_);
  }

 private:
  void add_line(const char *suffix, const std::string &labels, double value) {
    fmt::format_to(std::back_inserter(lines_), "{}{}{}{}{} {}\n", name_, suffix, labels.empty() ? "" : "{", labels,
                   labels.empty() ? "" : "}", value);
  }

  const char *type_;
  const char *name_;
  const char *help_;
  std::string lines_;
};

struct Families {
  std::deque<Family> all;  // keeps its elements in place
  Family &add(const char *type, const char *name, const char *help) { return all.emplace_back(type, name, help); }

  Family &info = add("gauge", "redag_executor_info", "How an executor runs; always 1.");
  Family &workers = add("gauge", "redag_executor_workers", "Workers of an executor.");
  Family &up = add("gauge", "redag_executor_uptime_seconds", "Time since an executor began.");
  Family &age = add("gauge", "redag_page_age_seconds", "Age of the figures; above 2 s, the executor is stuck.");
  Family &alert = add("gauge", "redag_executor_alert", "1 while something stops an executor, such as a deadlock.");
  Family &left_out = add("gauge", "redag_page_rows_left_out", "DAGs and tasks for which the page has no room.");
  Family &thread = add("counter", "redag_thread_cpu_seconds_total", "Processor time of jobs that ended on a thread.");
  Family &released = add("counter", "redag_jobs_released_total", "Jobs released.");
  Family &ended = add("counter", "redag_jobs_ended_total", "Jobs that ended, by outcome.");
  Family &misses = add("counter", "redag_deadline_misses_total", "Jobs that were late, skipped, or aborted with data.");
  Family &deferred = add("counter", "redag_jobs_deferred_total", "Jobs that waited because of max_active.");
  Family &preemptions = add("counter", "redag_preemptions_total", "Times that a job lost its worker.");
  Family &cpu = add("counter", "redag_cpu_seconds_total", "Processor time of jobs that ended.");
  Family &jobs = add("gauge", "redag_jobs", "Jobs now, by state.");
  Family &away = add("gauge", "redag_jobs_away", "Active jobs now that wait without a worker.");
  Family &response = add("histogram", "redag_response_seconds", "Time from a job's release to its finish.");
  Family &longest = add("gauge", "redag_response_max_seconds", "Longest response time since the executor began.");
  Family &period = add("gauge", "redag_period_seconds", "Period of a task.");
  Family &deadline = add("gauge", "redag_deadline_seconds", "Relative deadline of a task.");
  Family &bound = add("gauge", "redag_response_bound_seconds", "Proven bound on a task's response time.");
  Family &end_to_end = add("histogram", "redag_end_to_end_seconds",
                           "Time from the release of a DAG's source to the finish of its worst sink.");
  Family &end_to_end_longest = add("gauge", "redag_end_to_end_max_seconds", "Longest such time.");
  Family &end_to_end_deadline = add("gauge", "redag_end_to_end_deadline_seconds", "End-to-end deadline of a DAG.");
  Family &end_to_end_late = add("counter", "redag_end_to_end_late_total", "Answers of a DAG beyond that deadline.");
  Family &slots = add("gauge", "redag_device_slots", "Jobs that a device can serve at a time.");
  Family &used = add("gauge", "redag_device_slots_used", "Jobs that a device serves now.");
  Family &queued = add("gauge", "redag_device_jobs_queued", "Jobs that wait for a slot of a device now.");
  Family &served = add("counter", "redag_device_served_total", "Services of a device that ended.");
  Family &device_busy =
      add("counter", "redag_device_busy_seconds_total", "Time that the slots of a device were in use.");
  Family &unreadable = add("gauge", "redag_unreadable_pages", "Live pages that could not be read.");
};

void add_task(Families &to, const std::string &labels, const TaskFrame &task) {
  const live::page::Figures &figures = task.figures;
  to.released.add(labels, figures.released);
  for (const auto &[outcome, count] : {std::pair("finished", figures.finished), std::pair("skipped", figures.skipped),
                                       std::pair("aborted", figures.aborted)}) {
    to.ended.add(with(labels, "outcome", outcome), count);
  }
  to.misses.add(labels, figures.misses);
  to.deferred.add(labels, figures.deferred);
  to.preemptions.add(labels, figures.preemptions);
  to.cpu.add(labels, seconds(figures.cpu));
  for (const auto &[state, count] : {std::pair("active", figures.active), std::pair("ready", figures.ready),
                                     std::pair("waiting", figures.waiting)}) {
    to.jobs.add(with(labels, "state", state), count);
  }
  to.away.add(labels, figures.away);
  to.response.add(labels, task.spread);
  to.longest.add(labels, seconds(figures.response_max));
  if (task.period > 0) to.period.add(labels, seconds(task.period));
  if (task.deadline > 0) to.deadline.add(labels, seconds(task.deadline));
  if (task.bound > 0) to.bound.add(labels, seconds(task.bound));
}

void add_device(Families &to, const std::string &labels, const live::DeviceFrame &device) {
  to.slots.add(labels, device.slots);
  to.used.add(labels, device.used);
  to.queued.add(labels, device.queued);
  to.served.add(labels, device.served);
  to.device_busy.add(labels, seconds(device.busy));
}

// Response times of a DAG are end to end.
void add_dag(Families &to, const std::string &labels, const DagFrame &dag) {
  to.end_to_end.add(labels, dag.spread);
  to.end_to_end_longest.add(labels, seconds(dag.figures.response_max));
  if (dag.deadline == 0) return;
  to.end_to_end_deadline.add(labels, seconds(dag.deadline));
  to.end_to_end_late.add(labels, dag.late);
}

void add_executor(Families &to, const live::Listed &listed, const Frame &frame, Time now) {
  const std::string labels =
      fmt::format("{},pid=\"{}\",number=\"{}\"", label("executor", frame.name), listed.pid, listed.number);
  std::string how = with(labels, "program", frame.program);
  how = with(with(with(how, "driver", frame.driver), "preemption", frame.preemption), "policy", frame.policy);
  to.info.add(how, 1);
  to.workers.add(labels, frame.workers);
  to.up.add(labels, seconds(frame.published - frame.began));
  to.age.add(labels, seconds(std::max<Duration>(now - frame.published, 0)));
  to.alert.add(labels, frame.alert.empty() ? 0U : 1U);
  to.left_out.add(labels, frame.left_out);
  for (const live::ThreadFrame &thread : frame.threads) {
    to.thread.add(with(labels, "thread", std::to_string(thread.index)), seconds(thread.used));
  }
  for (const live::DeviceFrame &device : frame.devices) add_device(to, with(labels, "device", device.name), device);
  for (const DagFrame &dag : frame.dags) add_dag(to, with(labels, "dag", dag.name), dag);
  for (const TaskFrame &task : frame.tasks) {
    add_task(to, with(with(labels, "dag", frame.dags[task.dag].name), "task", task.name), task);
  }
}

}  // namespace

std::string metrics_text(const std::vector<live::Listed> &pages, Time now) {
  Families families;
  std::uint64_t unreadable = 0;
  for (const live::Listed &listed : pages) {
    if (listed.page) {
      add_executor(families, listed, listed.page->frame, now);
    } else {
      ++unreadable;
    }
  }
  families.unreadable.add("", unreadable);
  std::string text;
  for (const Family &family : families.all) text += family.text();
  return text;
}

}  // namespace redag::cli
