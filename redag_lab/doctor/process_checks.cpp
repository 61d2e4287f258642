// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/live/middleware_names.hpp"
#include "redag/live/owned_file.hpp"
#include "redag/live/reader.hpp"
#include "redag/threads/setup.hpp"
#include "redag/threads/threads.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/doctor/checks.hpp"

namespace redag::doctor {
namespace {

constexpr unsigned kLockMemory = 14;  // CAP_IPC_LOCK
constexpr unsigned kNice = 23;        // CAP_SYS_NICE
constexpr const char *kRosArguments = "--ros-args";

template <class Judge>
Finding on_each_process(const Subject &subject, const Judge &judge) {
  std::vector<Finding> findings;
  for (const Process &process : subject.processes) findings.push_back(judge(process));
  return worst_of(findings);
}

// The highest SCHED_FIFO priority that a process may have.
std::int64_t allowed_priority(const Subject &subject, const Process &process) {
  // Rights come from several places, so this process tries.
  if (subject.machine.is_this() && !subject.attached) {
    return runtime::available_fifo_priority(runtime::kHighestPriority);
  }
  const std::int64_t limit = limit_of(subject.machine, process, "Max realtime priority");
  if (limit >= runtime::kHighestPriority) return std::min<std::int64_t>(limit, 99);
  return has_capability(subject.machine, process, kNice) ? 99 : limit;
}

// The pool of an executor has names such as "redag-3".
bool is_worker(const std::string &name) {
  const std::size_t dash = name.rfind('-');
  return dash != std::string::npos && dash > 0 && number_in(name.substr(dash + 1)).has_value();
}

std::vector<std::string> arguments_of(const Subject &subject, const Process &process) {
  return words_of(subject.machine.text(process.file("cmdline")));
}

Finding judge_page(const live::Frame &frame) {
  std::uint64_t jobs = 0;
  std::uint64_t misses = 0;
  for (const live::DagFrame &dag : frame.dags) {
    jobs += dag.figures.released;
    misses += dag.figures.misses;
  }
  const std::string found = fmt::format("{}: preemption {}, {}, misses: {}", frame.name, frame.preemption,
                                        plural(frame.workers, "worker"), format_share(misses, jobs));
  if (!frame.alert.empty()) return {Verdict::Red, fmt::format("{}; {}", found, frame.alert)};
  return {misses > 0 || frame.preemption != "os" ? Verdict::Yellow : Verdict::Green, found};
}

}  // namespace

std::vector<Thread> Subject::threads() const {
  std::vector<Thread> all;
  for (const Process &process : processes) {
    for (Thread &thread : threads_of(machine, process)) all.push_back(std::move(thread));
  }
  return all;
}

// With running processes, the processors of their real-time threads, or of all threads where there are none. Else the
// isolated ones, or those of this program where there are none.
std::vector<int> Subject::cpus() const {
  if (!attached) {
    std::vector<int> isolated = machine.processors("/sys/devices/system/cpu/isolated");
    if (!isolated.empty()) return isolated;
  }
  const std::vector<Thread> all = threads();
  const bool any = std::any_of(all.begin(), all.end(), [](const Thread &thread) { return thread.priority > 0; });
  std::set<int> cpus;
  for (const Thread &thread : all) {
    if (!any || thread.priority > 0) cpus.insert(thread.cpus.begin(), thread.cpus.end());
  }
  if (cpus.empty()) throw Unreadable("the processors of the threads are not known");
  return {cpus.begin(), cpus.end()};
}

bool Subject::is_ros() const {
  const std::vector<Thread> all = threads();
  if (std::any_of(all.begin(), all.end(),
                  [](const Thread &each) { return live::is_middleware_thread_name(each.name); }))
    return true;
  return std::any_of(processes.begin(), processes.end(), [&](const Process &process) {
    const std::vector<std::string> arguments = arguments_of(*this, process);
    return std::find(arguments.begin(), arguments.end(), kRosArguments) != arguments.end();
  });
}

Finding check_realtime_right(const Subject &subject) {
  return on_each_process(subject, [&](const Process &process) -> Finding {
    const std::int64_t allowed = allowed_priority(subject, process);
    if (allowed < 2) return {Verdict::Red, "SCHED_FIFO is not allowed"};  // needs one for the timer, one for jobs
    return {allowed >= runtime::kHighestPriority ? Verdict::Green : Verdict::Yellow,
            fmt::format("SCHED_FIFO up to {}", allowed)};
  });
}

Finding check_memory_lock(const Subject &subject) {
  return on_each_process(subject, [&](const Process &process) -> Finding {
    const std::int64_t limit = limit_of(subject.machine, process, "Max locked memory");
    if (limit == kUnlimited || has_capability(subject.machine, process, kLockMemory)) {
      return {Verdict::Green, "unlimited"};
    }
    return {Verdict::Yellow, fmt::format("up to {} kB", limit / 1024)};
  });
}

Finding check_threads(const Subject &subject) {
  const std::vector<Thread> threads = subject.threads();
  const auto urgent = std::count_if(threads.begin(), threads.end(), [](const Thread &t) { return t.priority > 0; });
  return {urgent > 0 ? Verdict::Green : Verdict::Yellow,
          fmt::format("{} of {} have a real-time priority", urgent, threads.size())};
}

Finding check_middleware(const Subject &subject) {
  const std::vector<Thread> threads = subject.threads();
  int most_urgent = 0;
  for (const Thread &thread : threads) {
    if (is_worker(thread.name)) most_urgent = std::max(most_urgent, thread.priority);
  }
  std::vector<Finding> delivering;
  for (const Thread &thread : threads) {
    if (!live::is_middleware_thread_name(thread.name)) continue;
    const bool waits = most_urgent > 0 && thread.priority <= most_urgent;
    delivering.push_back(
        {waits ? Verdict::Red : Verdict::Green,
         fmt::format("{} has priority {}, workers up to {}", thread.name, thread.priority, most_urgent)});
  }
  if (delivering.empty()) throw Unreadable("no thread has a name of Cyclone DDS or Fast DDS");
  return worst_of(delivering);
}

Finding check_simulated_time(const Subject &subject) {
  return on_each_process(subject, [&](const Process &process) -> Finding {
    const std::vector<std::string> arguments = arguments_of(subject, process);
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      if (arguments[i].find("use_sim_time:=true") != std::string::npos)
        return {Verdict::Yellow, in_quotes(arguments[i])};
      if (i == 0 || arguments[i - 1] != "--params-file") continue;
      const std::string parameters =
          subject.machine.text(process.file(arguments[i][0] == '/' ? "root/" : "cwd/") + arguments[i]);
      if (parameters.find("use_sim_time: true") != std::string::npos) return {Verdict::Yellow, in_quotes(arguments[i])};
    }
    return {Verdict::Unknown, "no argument sets it; see ros2 param get NODE use_sim_time"};
  });
}

Finding check_live_page(const Subject &subject) {
  std::vector<Finding> findings;
  for (const Process &process : subject.processes) {
    const std::vector<std::string> ids = words_of(subject.machine.value(process.file("status"), "NSpid:"));
    const std::string folder = subject.machine.path(process.file("root") + live::kFolder);
    for (const live::Listed &listed : live::list_pages(folder)) {
      if (ids.empty() || number_in(ids.back()) != listed.pid) continue;  // the last one is that of its container
      findings.push_back(listed.page ? judge_page(listed.page->frame)
                                     : Finding{Verdict::Unknown, listed.page.error().front().message});
    }
  }
  if (findings.empty()) throw Unreadable("the processes publish none");
  return worst_of(findings);
}

}  // namespace redag::doctor
