// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/kernel_judge.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <tuple>

#include <fmt/format.h>

namespace redag::testing {
namespace {

constexpr std::size_t kMostTexts = 5;
constexpr std::uint32_t kSettlingBeats = 2;

class Judge {
 public:
  explicit Judge(const KernelRun &run) : run_(run), beats_(run.cpus.size(), 0), runs_(run.cpus.size(), kUnknown) {}

  KernelVerdict verdict() {
    collect();
    for (const Point &point : points_) {
      if (point.time >= run_.end) break;
      take(point);
      look(point.time);
    }
    return std::move(verdict_);
  }

 private:
  static constexpr pid_t kUnknown = -1;

  struct Job {
    std::uint32_t level = 0;
    bool settled = false;  // the decision about it has been carried out
    bool begun = false;
    pid_t thread = kUnknown;
    Time inverted_since = kNever;
    std::vector<std::uint64_t> beats;  // of each processor at that time
    bool reported = false;
  };
  struct Point {
    Time time = 0;
    int order = 0;  // of what happens at one time: decision, kernel's event, begin, end
    std::size_t index = 0;
  };

  void collect() {
    for (std::size_t i = 0; i < run_.decisions.size(); ++i) points_.push_back({run_.decisions[i].time, 0, i});
    for (std::size_t i = 0; i < run_.events.size(); ++i) points_.push_back({run_.events[i].time, 1, i});
    for (std::size_t i = 0; i < run_.bodies.size(); ++i) {
      points_.push_back({run_.bodies[i].begin, 2, i});
      if (run_.bodies[i].end != kNever) points_.push_back({run_.bodies[i].end, 3, i});
    }
    std::sort(points_.begin(), points_.end(), [](const Point &a, const Point &b) {
      return std::tie(a.time, a.order, a.index) < std::tie(b.time, b.order, b.index);
    });
  }

  void take(const Point &point) {
    switch (point.order) {
      case 0: decide(run_.decisions[point.index]); break;
      case 1: kernel(run_.events[point.index]); break;
      case 2: begin(run_.bodies[point.index]); break;
      default: end(run_.bodies[point.index]); break;
    }
  }

  // Takes one decision at a time. A new decision means that the previous one has been carried out.
  void decide(const Decision &decision) {
    settle();
    for (const Decision::Change &change : decision.changes) {
      // The body of a started job may have ended before its thread reported it.
      if (!change.starts && jobs_.count(change.job) == 0) continue;
      Job &job = jobs_[change.job];
      job.level = change.level;
      job.settled = false;
      job.inverted_since = kNever;
    }
    pending_ = &decision;
    pending_beats_ = 0;
  }

  void settle() {
    if (pending_ == nullptr) return;
    for (const Decision::Change &change : pending_->changes) {
      if (const auto found = jobs_.find(change.job); found != jobs_.end()) found->second.settled = true;
    }
    pending_ = nullptr;
  }
  void settle_by(pid_t thread) {
    if (pending_ != nullptr && pending_->thread == thread) settle();
  }

  void kernel(const SwitchEvent &event) {
    const auto place = std::find(run_.cpus.begin(), run_.cpus.end(), event.cpu);
    if (place == run_.cpus.end()) return;
    const auto cpu = static_cast<std::size_t>(place - run_.cpus.begin());
    switch (event.kind) {
      case SwitchEvent::Kind::In:
        runs_[cpu] = event.thread;
        waits_[event.thread] = false;
        break;
      case SwitchEvent::Kind::Preempted:
      case SwitchEvent::Kind::Slept:
        runs_[cpu] = kUnknown;
        waits_[event.thread] = event.kind == SwitchEvent::Kind::Preempted;
        if (event.kind == SwitchEvent::Kind::Slept) settle_by(event.thread);
        break;
      case SwitchEvent::Kind::Beat:
        runs_[cpu] = event.thread;
        ++beats_[cpu];
        if (pending_ != nullptr && pending_->thread == event.thread && ++pending_beats_ >= kSettlingBeats) settle();
        break;
    }
  }

  void begin(const BodyRun &body) {
    settle_by(body.thread);
    const auto found = jobs_.find(body.job);
    if (found == jobs_.end()) {
      report(fmt::format("{}: {} began, and was not to start", format_duration(body.begin), name(body.job)));
      return;
    }
    found->second.begun = true;
    found->second.thread = body.thread;
  }

  void end(const BodyRun &body) {
    settle_by(body.thread);
    jobs_.erase(body.job);
  }

  [[nodiscard]] bool runs(pid_t thread) const { return std::find(runs_.begin(), runs_.end(), thread) != runs_.end(); }

  [[nodiscard]] bool waits(const Job &job) const {
    if (!job.settled) return false;
    if (!job.begun) return true;
    const auto found = waits_.find(job.thread);
    return found != waits_.end() && found->second && !runs(job.thread);
  }

  // Judges all jobs in progress.
  void look(Time now) {
    if (jobs_.empty()) return;
    ++verdict_.instants;
    const bool idle = std::find(runs_.begin(), runs_.end(), 0) != runs_.end();
    const std::pair<const JobKey, Job> *least = nullptr;
    for (const auto &entry : jobs_) {
      const Job &job = entry.second;
      if (!job.settled || !job.begun || !runs(job.thread)) continue;
      if (least == nullptr || least->second.level < job.level) least = &entry;
    }
    bool contended = false;
    for (auto &[key, job] : jobs_) {
      const bool waiting = waits(job);
      contended = contended || waiting;
      const bool overtaken = least != nullptr && least->second.level > job.level;
      if (!waiting || !(idle || overtaken)) {
        job.inverted_since = kNever;
        continue;
      }
      if (job.inverted_since == kNever) {
        job.inverted_since = now;
        job.beats = beats_;
      }
      if (job.reported || !all_served_since(job.beats)) continue;
      job.reported = true;
      report(fmt::format("{}: {} of level {} {} since {}, and {}", format_duration(now), name(key), job.level,
                         job.begun ? "waits" : "has not begun", format_duration(job.inverted_since),
                         overtaken ? fmt::format("{} of level {} runs", name(least->first), least->second.level)
                                   : std::string("a processor idles")));
    }
    if (contended) ++verdict_.contended;
  }

  [[nodiscard]] bool all_served_since(const std::vector<std::uint64_t> &before) const {
    for (std::size_t cpu = 0; cpu < beats_.size(); ++cpu) {
      if (beats_[cpu] - before[cpu] < kBeats) return false;
    }
    return true;
  }

  static std::string name(const JobKey &job) { return fmt::format("job {} of task {}", job.second, job.first); }

  void report(std::string text) {
    ++verdict_.violation_count;
    if (verdict_.violations.size() < kMostTexts) verdict_.violations.push_back(std::move(text));
  }

  const KernelRun &run_;
  KernelVerdict verdict_;
  std::vector<Point> points_;
  std::map<JobKey, Job> jobs_;  // started and not ended
  std::map<pid_t, bool> waits_;
  std::vector<std::uint64_t> beats_;  // by processor
  std::vector<pid_t> runs_;           // by processor: the thread that it runs
  const Decision *pending_ = nullptr;
  std::uint32_t pending_beats_ = 0;
};

}  // namespace

KernelVerdict judge(const KernelRun &run) { return Judge(run).verdict(); }

}  // namespace redag::testing
