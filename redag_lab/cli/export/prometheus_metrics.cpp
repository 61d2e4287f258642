// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/export/prometheus_metrics.hpp"

#include <prometheus/client_metric.h>
#include <prometheus/metric_type.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

namespace redag::cli {
namespace {

using live::DagFrame;
using live::Frame;
using live::TaskFrame;
using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

double seconds(Duration time) { return static_cast<double>(time) / static_cast<double>(kSecond); }

Labels with(Labels labels, Labels more) {
  labels.insert(labels.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
  return labels;
}

/// One metric, and its values of all executors.
class Family {
 public:
  Family(std::vector<MetricFamily> &families, MetricType type, const char *name, const char *help)
      : families_(families), index_(families.size()) {
    families.push_back({name, help, type, {}});
  }

  void add(const Labels &labels, double value) {
    ClientMetric &metric = add(labels);
    (families_[index_].type == MetricType::Counter ? metric.counter.value : metric.gauge.value) = value;
  }
  void add(const Labels &labels, std::uint64_t value) { add(labels, static_cast<double>(value)); }

  void add(const Labels &labels, const live::page::Spread &spread) {
    ClientMetric::Histogram &histogram = add(labels).histogram;
    for (std::size_t i = 0; i < live::page::kClasses; ++i) {
      histogram.sample_count += spread.all[i];
      const bool is_last = i + 1 == live::page::kClasses;
      // The longest time of a class: the next class begins a nanosecond later.
      const double most = is_last ? std::numeric_limits<double>::infinity() : seconds(live::page::least_in(i + 1) - 1);
      histogram.bucket.push_back({histogram.sample_count, most});
    }
    histogram.sample_sum = std::numeric_limits<double>::quiet_NaN();  // the page has none
  }

 private:
  ClientMetric &add(const Labels &labels) {
    ClientMetric &metric = families_[index_].metric.emplace_back();
    metric.label = labels;
    return metric;
  }

  std::vector<MetricFamily> &families_;
  std::size_t index_;
};

struct Families {
  std::vector<MetricFamily> all;
  Family info{all, MetricType::Gauge, "redag_executor_info", "How an executor runs; always 1."};
  Family workers{all, MetricType::Gauge, "redag_executor_workers", "Workers of an executor."};
  Family up{all, MetricType::Gauge, "redag_executor_uptime_seconds", "Time since an executor began."};
  Family age{all, MetricType::Gauge, "redag_page_age_seconds", "Age of the figures; above 2 s, the executor is stuck."};
  Family alert{all, MetricType::Gauge, "redag_executor_alert",
               "1 while something stops an executor, such as a deadlock."};
  Family left_out{all, MetricType::Gauge, "redag_page_rows_left_out", "DAGs and tasks for which the page has no room."};
  Family thread{all, MetricType::Counter, "redag_thread_cpu_seconds_total",
                "Processor time of jobs that ended on a thread."};
  Family released{all, MetricType::Counter, "redag_jobs_released_total", "Jobs released."};
  Family ended{all, MetricType::Counter, "redag_jobs_ended_total", "Jobs that ended, by outcome."};
  Family misses{all, MetricType::Counter, "redag_deadline_misses_total",
                "Jobs that were late, skipped, or aborted with data."};
  Family deferred{all, MetricType::Counter, "redag_jobs_deferred_total", "Jobs that waited because of max_active."};
  Family preemptions{all, MetricType::Counter, "redag_preemptions_total", "Times that a job lost its worker."};
  Family cpu{all, MetricType::Counter, "redag_cpu_seconds_total", "Processor time of jobs that ended."};
  Family jobs{all, MetricType::Gauge, "redag_jobs", "Jobs now, by state."};
  Family away{all, MetricType::Gauge, "redag_jobs_away", "Active jobs now that wait without a worker."};
  Family response{all, MetricType::Histogram, "redag_response_seconds", "Time from a job's release to its finish."};
  Family longest{all, MetricType::Gauge, "redag_response_max_seconds",
                 "Longest response time since the executor began."};
  Family period{all, MetricType::Gauge, "redag_period_seconds", "Period of a task."};
  Family deadline{all, MetricType::Gauge, "redag_deadline_seconds", "Relative deadline of a task."};
  Family bound{all, MetricType::Gauge, "redag_response_bound_seconds", "Proven bound on a task's response time."};
  Family end_to_end{all, MetricType::Histogram, "redag_end_to_end_seconds",
                    "Time from the release of a DAG's source to the finish of its worst sink."};
  Family end_to_end_longest{all, MetricType::Gauge, "redag_end_to_end_max_seconds", "Longest such time."};
  Family end_to_end_deadline{all, MetricType::Gauge, "redag_end_to_end_deadline_seconds",
                             "End-to-end deadline of a DAG."};
  Family end_to_end_late{all, MetricType::Counter, "redag_end_to_end_late_total",
                         "Answers of a DAG beyond that deadline."};
  Family slots{all, MetricType::Gauge, "redag_device_slots", "Jobs that a device can serve at a time."};
  Family used{all, MetricType::Gauge, "redag_device_slots_used", "Jobs that a device serves now."};
  Family queued{all, MetricType::Gauge, "redag_device_jobs_queued", "Jobs that wait for a slot of a device now."};
  Family served{all, MetricType::Counter, "redag_device_served_total", "Services of a device that ended."};
  Family device_busy{all, MetricType::Counter, "redag_device_busy_seconds_total",
                     "Time that the slots of a device were in use."};
  Family unreadable{all, MetricType::Gauge, "redag_unreadable_pages", "Live pages that the exporter could not read."};
};

void add_task(Families &to, const Labels &labels, const TaskFrame &task) {
  const live::page::Figures &figures = task.figures;
  to.released.add(labels, figures.released);
  for (const auto &[outcome, count] : {std::pair("finished", figures.finished), std::pair("skipped", figures.skipped),
                                       std::pair("aborted", figures.aborted)}) {
    to.ended.add(with(labels, {{"outcome", outcome}}), count);
  }
  to.misses.add(labels, figures.misses);
  to.deferred.add(labels, figures.deferred);
  to.preemptions.add(labels, figures.preemptions);
  to.cpu.add(labels, seconds(figures.cpu));
  for (const auto &[state, count] : {std::pair("active", figures.active), std::pair("ready", figures.ready),
                                     std::pair("waiting", figures.waiting)}) {
    to.jobs.add(with(labels, {{"state", state}}), std::uint64_t{count});
  }
  to.away.add(labels, std::uint64_t{figures.away});
  to.response.add(labels, task.spread);
  to.longest.add(labels, seconds(figures.response_max));
  if (task.period > 0) to.period.add(labels, seconds(task.period));
  if (task.deadline > 0) to.deadline.add(labels, seconds(task.deadline));
  if (task.bound > 0) to.bound.add(labels, seconds(task.bound));
}

void add_device(Families &to, const Labels &labels, const live::DeviceFrame &device) {
  to.slots.add(labels, std::uint64_t{device.slots});
  to.used.add(labels, std::uint64_t{device.used});
  to.queued.add(labels, std::uint64_t{device.queued});
  to.served.add(labels, device.served);
  to.device_busy.add(labels, seconds(device.busy));
}

// Response times of a DAG are end to end.
void add_dag(Families &to, const Labels &labels, const DagFrame &dag) {
  to.end_to_end.add(labels, dag.spread);
  to.end_to_end_longest.add(labels, seconds(dag.figures.response_max));
  if (dag.deadline == 0) return;
  to.end_to_end_deadline.add(labels, seconds(dag.deadline));
  to.end_to_end_late.add(labels, dag.late);
}

void add_executor(Families &to, const live::Listed &listed, const Frame &frame, Time now) {
  const Labels labels = {
      {"executor", frame.name}, {"pid", std::to_string(listed.pid)}, {"number", std::to_string(listed.number)}};
  to.info.add(with(labels, {{"program", frame.program},
                            {"driver", frame.driver},
                            {"preemption", frame.preemption},
                            {"policy", frame.policy}}),
              std::uint64_t{1});
  to.workers.add(labels, std::uint64_t{frame.workers});
  to.up.add(labels, seconds(frame.published - frame.began));
  to.age.add(labels, seconds(std::max<Duration>(now - frame.published, 0)));
  to.alert.add(labels, std::uint64_t{frame.alert.empty() ? 0U : 1U});
  to.left_out.add(labels, frame.left_out);
  for (const live::ThreadFrame &thread : frame.threads) {
    to.thread.add(with(labels, {{"thread", std::to_string(thread.index)}}), seconds(thread.used));
  }
  for (const live::DeviceFrame &device : frame.devices) add_device(to, with(labels, {{"device", device.name}}), device);
  for (const DagFrame &dag : frame.dags) add_dag(to, with(labels, {{"dag", dag.name}}), dag);
  for (const TaskFrame &task : frame.tasks) {
    add_task(to, with(labels, {{"dag", frame.dags[task.dag].name}, {"task", task.name}}), task);
  }
}

}  // namespace

std::vector<MetricFamily> metrics_of(const std::vector<live::Listed> &pages, Time now) {
  Families families;
  std::uint64_t unreadable = 0;
  for (const live::Listed &listed : pages) {
    if (listed.page) {
      add_executor(families, listed, listed.page->frame, now);
    } else {
      ++unreadable;
    }
  }
  families.unreadable.add({}, unreadable);
  std::erase_if(families.all, [](const MetricFamily &family) { return family.metric.empty(); });
  return std::move(families.all);
}

}  // namespace redag::cli
