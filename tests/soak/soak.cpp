// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs an executor under load for a long time, while DAGs come and go, and checks whether anything grows. Writes a
// sample per minute as CSV (per second if it runs for less than ten minutes), and at the end a verdict on each series
// by its slope. Exits with 1 if something grows, or if no work was done.
//
//   redag_soak SECONDS [--workers 1] [--preemption auto] [--load 0.8] [--churn 2] [--csv FILE]
//
// Memory, threads and files must be flat in every run. Wake-ups and lateness also depend on the machine: they are
// judged only in runs of ten minutes and more.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "redag/engine/preemption_point.hpp"
#include "redag/live/publisher.hpp"
#include "redag/live/reader.hpp"
#include "redag/runtime/executor.hpp"
#include "tests/soak/process_figures.hpp"
#include "tests/soak/trend.hpp"

namespace redag::soak {
namespace {

using runtime::DagBuilder;
using runtime::Executor;
using runtime::TaskHandle;
using std::chrono::nanoseconds;
using std::chrono::steady_clock;

struct Arguments {
  int seconds = 0;
  std::uint32_t workers = 1;
  PreemptionMode preemption = PreemptionMode::Auto;
  double load = 0.8;  // of each worker
  double churn = 2;   // DAGs that come, and DAGs that go, per second
  std::string csv;
};

constexpr Duration kLongRun = 600 * kSecond;
constexpr std::size_t kGuests = 3;
#ifdef __SANITIZE_ADDRESS__
constexpr bool kMemoryIsOurs = false;  // sanitizers keep freed memory for a while
#else
constexpr bool kMemoryIsOurs = true;
#endif

std::function<void()> busy(double share, Duration period) {
  const auto work = static_cast<Duration>(share * static_cast<double>(period));
  return [work] {
    while (job_cpu_time() < work) preemption_point();
  };
}

/// Steady DAGs and guests, which together use `load` of each worker's time.
class Load {
 public:
  explicit Load(const Arguments &arguments)
      : workers_(arguments.workers), unit_(arguments.load / 0.8), executor_(options_of(arguments)) {
    for (std::uint32_t i = 0; i < workers_; ++i) {
      DagBuilder control(fmt::format("control{}", i));
      const TaskHandle sense = control.timer("sense", nanoseconds(kFast), busy(0.05 * unit_, kFast));
      const TaskHandle plan = control.data("plan", {sense}, busy(0.20 * unit_, kFast));
      control.data("act", {plan}, busy(0.05 * unit_, kFast));
      executor_.add(std::move(control));
      DagBuilder vision(fmt::format("vision{}", i));
      const TaskHandle camera = vision.timer("camera", nanoseconds(4 * kFast), busy(0.05 * unit_, 4 * kFast));
      vision.data("detect", {camera}, busy(0.20 * unit_, 4 * kFast));
      executor_.add(std::move(vision));
      DagBuilder map(fmt::format("map{}", i));
      map.timer("update", nanoseconds(20 * kFast), busy(0.15 * unit_, 20 * kFast));
      executor_.add(std::move(map));
    }
    for (std::size_t i = 0; i < kGuests; ++i) come();
  }

  /// Removes the oldest guest and adds another. Every other guest is removed by its own body.
  void churn() {
    const Guest oldest = guests_.front();
    guests_.pop_front();
    if (oldest.leave) {
      *oldest.leave = true;
    } else {
      executor_.remove(oldest.dag);
    }
    come();
  }

  Executor &executor() { return executor_; }
  /// Finished jobs of control0.act. Waits for the first one, because a busy machine needs time.
  [[nodiscard]] std::uint64_t finished() const {
    const auto give_up = steady_clock::now() + std::chrono::seconds(60);
    for (;;) {
      const std::uint64_t jobs = executor_.stats(DagId(0))[2].jobs.finished;
      if (jobs > 0 || steady_clock::now() > give_up) return jobs;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  [[nodiscard]] std::uint64_t guests() const { return number_; }

 private:
  struct Guest {
    DagId dag;
    std::shared_ptr<std::atomic<bool>> leave;  // null: another thread removes it
  };

  static runtime::ExecutorOptions options_of(const Arguments &arguments) {
    runtime::ExecutorOptions options;
    options.name = "soak";
    options.workers = arguments.workers;
    options.preemption = arguments.preemption;
    options.live = true;  // gives the response times
    return options;
  }

  void come() {
    const double share = 0.10 * unit_ * workers_ / kGuests;
    constexpr Duration kPeriod = 2 * kFast;
    Guest guest;
    if (number_ % 2 == 0) guest.leave = std::make_shared<std::atomic<bool>>(false);
    const auto id = std::make_shared<std::atomic<std::uint32_t>>();
    DagBuilder dag(fmt::format("guest{}", number_++));
    const TaskHandle first = dag.timer("first", nanoseconds(kPeriod), busy(share / 2, kPeriod));
    dag.data("second", {first}, [this, id, leave = guest.leave, work = busy(share / 2, kPeriod)] {
      work();
      if (leave && leave->exchange(false)) executor_.remove(DagId(id->load()));
    });
    guest.dag = executor_.add(std::move(dag));
    *id = guest.dag.value;
    guests_.push_back(guest);
  }

  static constexpr Duration kFast = 5 * kMillisecond;

  std::uint32_t workers_;
  double unit_;
  std::uint64_t number_ = 0;
  std::deque<Guest> guests_;
  Executor executor_;  // last member: its bodies use the others
};

/// Figures of one task, as `redag top` shows them.
class Observed {
 public:
  Observed(std::string dag, std::string task) : dag_(std::move(dag)), task_(std::move(task)) {}

  void look() {
    if (path_.empty()) {
      for (const live::Listed &listed : live::list_pages(live::kFolder)) {
        if (listed.pid == ::getpid()) path_ = listed.path;
      }
      if (path_.empty()) return;
    }
    const Result<live::Page> page = live::read_page(path_);
    if (!page) return;
    for (const live::TaskFrame &task : page->frame.tasks) {
      if (task.name != task_ || page->frame.dags[task.dag].name != dag_) continue;
      figures_ = task.figures;
      if (figures_.recent_jobs > 0) p99_.push_back(static_cast<double>(figures_.recent_p99) / kMicrosecond);
    }
  }
  /// The median of the samples since the last call, in microseconds.
  double take_p99() {
    if (p99_.empty()) return 0;
    const auto middle = p99_.begin() + static_cast<std::ptrdiff_t>(p99_.size() / 2);
    std::nth_element(p99_.begin(), middle, p99_.end());
    const double median = *middle;
    p99_.clear();
    return median;
  }
  [[nodiscard]] const live::page::Figures &figures() const { return figures_; }

 private:
  std::string dag_;
  std::string task_;
  std::string path_;
  live::page::Figures figures_{};
  std::vector<double> p99_;
};

/// The samples of a run.
struct Record {
  Series heap{"heap, KiB", 128, {}};
  Series resident{"resident, KiB", 2048, {}};
  Series threads{"threads", 0, {}};
  Series files{"files", 0, {}};
  Series wake_ups{"wake-ups a second", 0, {}};
  Series act{"control0.act, 99th percentile of the response, us", 0, {}};
  Series detect{"vision0.detect, 99th percentile of the response, us", 0, {}};

  bool judge(bool long_run) const {
    bool flat = true;
    for (const Series *series : {&heap, &resident, &threads, &files, &wake_ups, &act, &detect}) {
      // The first tenth is the start: pools fill, and every path is taken once.
      const std::size_t start = std::min(series->values.size(), series->values.size() / 10 + 1);
      const std::vector<double> values(series->values.begin() + static_cast<std::ptrdiff_t>(start),
                                       series->values.end());
      const Trend trend = trend_of(values);
      const bool of_the_machine = series == &wake_ups || series == &act || series == &detect;
      const double allowed = of_the_machine ? trend.first / 4 : series->allowed_growth;
      const bool grows = trend.growth > allowed;
      const bool memory = series == &heap || series == &resident;
      const bool counts = (long_run || !of_the_machine) && (kMemoryIsOurs || !memory);
      fmt::print("{}: {:.1f} at first, {:.1f} at last, growth {:+.2f} (allowed {:.2f}): {}\n", series->name,
                 trend.first, trend.last, trend.growth, allowed,
                 !counts ? "not judged"
                 : grows ? "GROWS"
                         : "flat");
      flat = flat && !(counts && grows);
    }
    return flat;
  }
};

int run(const Arguments &arguments) {
  std::FILE *csv = arguments.csv.empty() ? stdout : std::fopen(arguments.csv.c_str(), "w");
  if (csv == nullptr) {
    std::perror(arguments.csv.c_str());
    return 2;
  }
  Load load(arguments);
  for (const std::string &warning : load.executor().warnings()) std::fprintf(stderr, "%s\n", warning.c_str());
  load.executor().start();

  const Duration length = arguments.seconds * kSecond;
  const bool long_run = length >= kLongRun;
  const Duration step = long_run ? 60 * kSecond : kSecond / 4;
  const auto pause = nanoseconds(static_cast<Duration>(static_cast<double>(kSecond) / arguments.churn));
  Observed act("control0", "act");       // the end of the most urgent chain
  Observed detect("vision0", "detect");  // preempted by that chain, and by the guests
  Record record;
  ProcessFigures before = process_figures();
  std::uint64_t finished = 0;
  fmt::print(csv,
             "seconds,heap_kib,resident_kib,threads,files,wake_ups_per_s,cpu_share,jobs,misses,act_p99_us,detect_p99_"
             "us,dags_added\n");
  const auto begin = steady_clock::now();
  auto churn_at = begin + pause;
  auto look_at = begin + std::chrono::seconds(2);
  auto sampled = begin;
  while (sampled < begin + nanoseconds(length)) {
    const auto sample_at = sampled + nanoseconds(step);
    while (steady_clock::now() < sample_at) {
      std::this_thread::sleep_until(std::min({sample_at, churn_at, look_at}));
      const auto now = steady_clock::now();
      if (now >= churn_at) {
        load.churn();
        churn_at = now + pause;
      }
      if (now >= look_at) {
        act.look();
        detect.look();
        look_at = now + std::chrono::seconds(2);
      }
    }
    if (!long_run) {
      act.look();
      detect.look();
    }
    const ProcessFigures now = process_figures();
    const auto at = steady_clock::now();
    const double passed = std::chrono::duration<double>(at - sampled).count();
    sampled = at;
    const double wake_ups = static_cast<double>(now.wake_ups - before.wake_ups) / passed;
    const double share = static_cast<double>(now.cpu - before.cpu) / 1e9 / passed;
    before = now;
    finished = act.figures().finished;
    record.heap.values.push_back(now.heap_kib);
    record.resident.values.push_back(now.resident_kib);
    record.threads.values.push_back(now.threads);
    record.files.values.push_back(now.files);
    record.wake_ups.values.push_back(wake_ups);
    record.act.values.push_back(act.take_p99());
    record.detect.values.push_back(detect.take_p99());
    fmt::print(csv, "{:.1f},{:.1f},{:.0f},{:.0f},{:.0f},{:.1f},{:.3f},{},{},{:.0f},{:.0f},{}\n",
               std::chrono::duration<double>(at - begin).count(), now.heap_kib, now.resident_kib, now.threads,
               now.files, wake_ups, share, finished, act.figures().misses, record.act.values.back(),
               record.detect.values.back(), load.guests());
    std::fflush(csv);
  }
  finished = load.finished();
  load.executor().stop();
  if (csv != stdout) std::fclose(csv);
  fmt::print("preemption {}, {} workers, load {}, {} s; {} DAGs came; {} jobs of control0.act, {} late or skipped\n",
             to_string(load.executor().mode().mode), arguments.workers, arguments.load, arguments.seconds,
             load.guests(), finished, act.figures().misses);
  const bool flat = record.judge(long_run);
  if (finished == 0) fmt::print("no work was done\n");
  return flat && finished > 0 ? 0 : 1;
}

}  // namespace
}  // namespace redag::soak

int main(int argc, char **argv) {
  redag::soak::Arguments arguments;
  CLI::App app("An executor under load for a long time, while DAGs come and go: does anything grow?");
  app.add_option("seconds", arguments.seconds)->required()->check(CLI::Range(1, 7 * 24 * 3600));
  app.add_option("--workers", arguments.workers)->check(CLI::Range(1, 64));
  std::map<std::string, redag::PreemptionMode> modes;
  for (const auto mode : {redag::PreemptionMode::None, redag::PreemptionMode::Cooperative, redag::PreemptionMode::Os,
                          redag::PreemptionMode::Auto}) {
    modes[to_string(mode)] = mode;
  }
  const auto set_mode = [&](const std::string &mode) { arguments.preemption = modes.at(mode); };
  app.add_option_function<std::string>("--preemption", set_mode)->check(CLI::IsMember(modes));
  app.add_option("--load", arguments.load, "of each worker")->check(CLI::Range(0.01, 0.95));
  app.add_option("--churn", arguments.churn, "DAGs that come, and that go, a second")->check(CLI::Range(0.01, 1000.0));
  app.add_option("--csv", arguments.csv, "where the samples go; default: standard output");
  CLI11_PARSE(app, argc, argv);
  return redag::soak::run(arguments);
}
