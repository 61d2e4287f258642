// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/changes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <sstream>

#include "redag/model/callback_match.hpp"

namespace redag::robot {
namespace {

bool matches(std::string_view pattern, std::string_view text) { return pattern.empty() || glob_match(pattern, text); }

bool matches(const ProcessMatch &match, const LiveProcess &process) {
  return matches(match.name, process.name) && matches(match.command, process.command) &&
         matches(match.cgroup, process.cgroup);
}

// True for the number, and for each word of the name: "eth0" for "IR-PCI-MSI 524288-edge eth0, eth1".
bool matches(const std::string &pattern, const LiveInterrupt &interrupt) {
  if (glob_match(pattern, std::to_string(interrupt.number))) return true;
  std::istringstream words(interrupt.name);
  for (std::string word; words >> word;) {
    if (word.back() == ',') word.pop_back();
    if (glob_match(pattern, word)) return true;
  }
  return false;
}

class Comparison {
 public:
  Comparison(const Robot &robot, const Plan &plan, const Snapshot &snapshot)
      : robot_(robot), plan_(plan), snapshot_(snapshot), threads_of_entry_(robot.threads.size()) {
    changes_.running.resize(robot.processes.size());
  }

  Changes run() {
    for (const LiveProcess &process : snapshot_.processes) compare(process);
    for (const Interrupts &entry : robot_.interrupts) compare(entry);
    remark_on_processes();
    remark_on_threads();
    return std::move(changes_);
  }

 private:
  void compare(const LiveProcess &process) {
    std::optional<std::size_t> known;
    for (std::size_t p = 0; p < robot_.processes.size() && !known; ++p) {
      if (matches(robot_.processes[p].match, process)) known = p;
    }
    if (known) changes_.running[*known].push_back(process.pid);
    for (const LiveThread &thread : process.threads) compare(process, known, thread);
  }

  [[nodiscard]] std::optional<std::size_t> entry_of(const LiveProcess &process, std::optional<std::size_t> known,
                                                    const LiveThread &thread) const {
    for (std::size_t t = 0; t < robot_.threads.size(); ++t) {
      const Threads &entry = robot_.threads[t];
      const bool is_of_process = entry.process ? entry.process == known : matches(entry.match, process);
      if (is_of_process && matches(entry.thread, thread.name)) return t;
    }
    return std::nullopt;
  }

  void compare(const LiveProcess &process, std::optional<std::size_t> known, const LiveThread &thread) {
    const std::optional<std::size_t> entry = entry_of(process, known, thread);
    if (!entry && !known) return;
    ++changes_.matched;
    if (entry) ++threads_of_entry_[*entry];
    ThreadState after = thread.state;
    const std::optional<Scheduling> wanted = entry ? plan_.of_threads[*entry] : std::nullopt;
    const bool is_reserved = thread.state.scheduling.kind == Scheduling::Class::Deadline;
    if (wanted && is_reserved && wanted->kind != Scheduling::Class::Deadline) {
      changes_.remarks.push_back(
          fmt::format("thread '{}' ({}) has a reservation (SCHED_DEADLINE) and keeps it", thread.name, thread.id.tid));
    } else if (wanted && !is_same_level(*wanted, after.scheduling)) {
      after.scheduling = *wanted;
    }
    if (after.scheduling.kind != Scheduling::Class::Deadline) {
      set_cpus(entry, known, after);
    } else if (!is_reserved && !snapshot_.cpus.empty()) {
      after.cpus = snapshot_.cpus;  // The kernel gives no reservation to a thread that it may not put anywhere.
    }
    if (after == thread.state) return;
    changes_.threads.push_back(
        ThreadChange{thread.id, thread.name, process.name,
                     entry ? "threads " + robot_.threads[*entry].name : "process " + robot_.processes[*known].name,
                     thread.state, std::move(after)});
  }

  // A thread that stays within the processors of its process keeps its own: executors pin theirs.
  void set_cpus(std::optional<std::size_t> entry, std::optional<std::size_t> known, ThreadState &state) const {
    if (entry && !robot_.threads[*entry].cpus.empty()) {
      state.cpus = robot_.threads[*entry].cpus;
    } else if (known) {
      const std::vector<int> &allowed = robot_.cpu_sets[robot_.processes[*known].cpu_set].cpus;
      if (!std::includes(allowed.begin(), allowed.end(), state.cpus.begin(), state.cpus.end())) state.cpus = allowed;
    }
  }

  void compare(const Interrupts &entry) {
    bool found = false;
    for (const LiveInterrupt &interrupt : snapshot_.interrupts) {
      if (!matches(entry.match, interrupt)) continue;
      found = true;
      if (interrupt.cpus == entry.cpus) continue;
      changes_.interrupts.push_back(InterruptChange{interrupt.number, interrupt.name, interrupt.cpus, entry.cpus});
    }
    if (!found)
      changes_.remarks.push_back(fmt::format("irqs '{}': no interrupt matches '{}'", entry.name, entry.match));
  }

  void remark_on_processes() {
    for (std::size_t p = 0; p < robot_.processes.size(); ++p) {
      const std::size_t count = changes_.running[p].size();
      const std::string &name = robot_.processes[p].name;
      if (count == 0) changes_.remarks.push_back(fmt::format("process '{}' does not run", name));
      if (count > 1 && robot_.processes[p].workload) {
        changes_.remarks.push_back(
            fmt::format("process '{}' matches {} processes, and the bounds count its workload once", name, count));
      }
    }
  }

  void remark_on_threads() {
    for (std::size_t t = 0; t < robot_.threads.size(); ++t) {
      const Threads &entry = robot_.threads[t];
      if (threads_of_entry_[t] == 0) {
        changes_.remarks.push_back(fmt::format("threads '{}': none runs", entry.name));
      } else if (entry.is_counted() && threads_of_entry_[t] > entry.count) {
        changes_.remarks.push_back(fmt::format("threads '{}': {} run, and the bounds count {} ('count:')", entry.name,
                                               threads_of_entry_[t], entry.count));
      }
    }
  }

  const Robot &robot_;
  const Plan &plan_;
  const Snapshot &snapshot_;
  std::vector<std::size_t> threads_of_entry_;
  Changes changes_;
};

}  // namespace

Changes changes_of(const Robot &robot, const Plan &plan, const Snapshot &snapshot) {
  return Comparison(robot, plan, snapshot).run();
}

std::vector<std::string> remarks_on_executors(const Robot &robot, const Plan &plan, const Changes &changes,
                                              const System &system) {
  std::vector<std::string> remarks;
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    if (plan.of_executor[p].empty()) continue;
    const std::string wanted = levels_text(plan.of_executor[p]);
    for (const std::int64_t pid : changes.running[p]) {
      const auto given = system.environment_of(pid, runtime::kLevelsVariable);
      if (given == wanted) continue;
      remarks.push_back(
          fmt::format("process '{}' ({}) began {}, and its executor has an order of its own: start it with "
                      "{}={}",
                      robot.processes[p].name, pid, given ? "with other priorities" : "without priorities",
                      runtime::kLevelsVariable, wanted));
    }
  }
  return remarks;
}

}  // namespace redag::robot
