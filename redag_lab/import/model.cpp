// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_analysis/text/wrap.hpp"
#include "redag_lab/import/units.hpp"

namespace redag::lab {
namespace {

using CallbackKind = Callback::Kind;

constexpr std::size_t kQuantiles = 20;
constexpr std::size_t kColumns = 100;  // of comments

std::string share_of(std::uint64_t part, std::uint64_t whole) {
  return format_percent(static_cast<double>(part) / static_cast<double>(whole));
}

std::string unique_name(const std::string &wanted, std::set<std::string> &taken) {
  std::string name = wanted;
  for (int n = 2; !taken.insert(name).second; ++n) name = fmt::format("{}_{}", wanted, n);
  return name;
}

class Importing {
 public:
  Importing(const Recording &recording, std::uint32_t pid)
      : callbacks_(recording.callbacks()), recording_(recording), process_(recording.processes().at(pid)) {
    Units found = find_units(recording, pid);
    find_edges(recording, found.units);
    units_ = std::move(found.units);
    rank_units();
    result_.left_out = std::move(found.left_out);
    result_.messages = found.messages;
    result_.explained = found.explained;
  }

  ImportedWorkload run() {
    measure_delays();
    make_dags();
    describe();
    return std::move(result_);
  }

 private:
  [[nodiscard]] const CallbackRecord &first_of(const Unit &unit) const { return callbacks_[unit.members.front()]; }
  [[nodiscard]] bool is_timer(std::size_t callback) const {
    return callbacks_[callback].id.kind == CallbackKind::Timer;
  }

  /// Ranks units in the order in which the executor took ready callbacks of a kind, as far as it was seen: rclcpp goes
  /// by addresses or by registration, of which no event tells.
  void rank_units() {
    Positions unit_of(callbacks_.size(), SIZE_MAX);
    for (std::size_t i = 0; i < units_.size(); ++i) {
      for (const std::size_t member : units_[i].members) unit_of[member] = i;
    }
    std::vector<Positions> after(units_.size());
    Positions before(units_.size(), 0);
    std::map<std::pair<std::size_t, std::size_t>, std::uint64_t> turns;
    for (const auto &[pair, count] : recording_.turns()) turns[{unit_of[pair.first], unit_of[pair.second]}] += count;
    for (const auto &[pair, count] : turns) {
      const auto [first, second] = pair;
      const auto reverse = turns.find({second, first});
      if (std::max(first, second) == SIZE_MAX || (reverse != turns.end() && reverse->second >= count)) continue;
      after[first].push_back(second);
      ++before[second];
    }
    std::set<std::pair<std::size_t, std::size_t>> left;  // units, with how many come before; the least is next
    for (std::size_t i = 0; i < units_.size(); ++i) left.emplace(before[i], i);
    for (std::uint32_t rank = 0; !left.empty(); ++rank) {
      const std::size_t next = left.begin()->second;
      left.erase(left.begin());
      units_[next].rank = rank;
      for (const std::size_t unit : after[next]) {
        if (left.erase({before[unit], unit}) > 0) left.emplace(--before[unit], unit);
      }
    }
  }

  void measure_delays() {
    metrics::DurationSketch wake_ups{1024};
    metrics::DurationSketch turnarounds{1024};
    for (const Unit &unit : units_) {
      for (const EndedRun &run : unit.runs) {
        if (run.delay()) (*run.free <= *run.released ? wake_ups : turnarounds).add(*run.delay());
      }
    }
    result_.wake_ups = wake_ups.distribution();
    result_.overhead = turnarounds.size() >= kQuantiles ? turnarounds.distribution().p50 : result_.wake_ups.min;
  }

  // ---- tasks ----

  void make_dags() {
    Clusters dags(units_.size());
    for (std::size_t i = 0; i < units_.size(); ++i) {
      for (const std::size_t p : units_[i].predecessors) dags.join(i, p);
    }
    Workload &workload = result_.workload;
    workload.name = process_.program.empty() ? "imported" : process_.program;
    workload.platform.workers = static_cast<std::uint32_t>(std::max<std::size_t>(process_.executor_threads.size(), 1));
    std::map<std::string, std::vector<Positions>> groups;  // of each node
    std::set<std::string> names;
    for (std::size_t first = 0; first < units_.size(); ++first) {
      if (dags.first(first) != first) continue;
      Positions members;
      for (std::size_t i = first; i < units_.size(); ++i) {
        if (dags.first(i) == first) members.push_back(i);
      }
      const std::size_t source =
          *std::find_if(members.begin(), members.end(), [&](std::size_t i) { return units_[i].predecessors.empty(); });
      Dag dag;
      dag.name = unique_name(first_of(units_[source]).id.node.substr(1), names);
      dag.edges = Edges::Seen;
      for (const std::size_t i : members) {
        Task task = make_task(units_[i]);
        task.name = unique_name(task.name, names);
        for (const std::size_t p : units_[i].predecessors) {
          const auto at = std::find(members.begin(), members.end(), p) - members.begin();
          task.predecessors.push_back(static_cast<std::uint32_t>(at));
        }
        if (task.concurrency == 1) task.group = group_of(i, groups[first_of(units_[i]).id.node]);
        result_.replays.push_back(replay_of(units_[i], task));
        result_.notes.push_back(units_[i].notes);
        dag.tasks.push_back(std::move(task));
      }
      inherit_periods(dag);
      workload.dags.push_back(std::move(dag));
    }
    drop_small_groups();
  }

  Task make_task(Unit &unit) const {
    const CallbackRecord &first = first_of(unit);
    const bool timer = is_timer(unit.members.front());
    Task task;
    task.name = to_string(first.id);
    set_execution(task, unit.execution);
    task.callback = Callback{.node = first.id.node,
                             .kind = first.id.kind,
                             .name = first.id.name,
                             .period = first.id.period,
                             .index = timer ? std::optional(first.id.index) : std::nullopt};
    if (timer) {
      task.period = timer_period(first, unit.notes);
      task.phase = Phase::Unknown;
    } else if (!unit.predecessors.empty()) {
      task.activation = Activation::Data;
    } else {
      const bool are_sent = first.sent.size() == first.begun.size();
      const Arrivals arrivals = estimate_arrivals(are_sent ? first.sent : first.begun);
      task.period = arrivals.period;
      task.phase = arrivals.sporadic || first.id.kind == CallbackKind::Service ? Phase::Event : Phase::Unknown;
      if (task.phase != Phase::Event) task.jitter = arrivals.jitter;
      unit.notes.push_back(fmt::format("period and jitter as seen in {} {}{}{}", first.begun.size(),
                                       are_sent ? "messages, by when they were sent" : "runs, by their begin",
                                       arrivals.note.empty() ? "" : "; ", arrivals.note));
    }
    task.deadline = task.period;
    if (unit.members.size() == 1) task.concurrency = first.most_at_once;
    return task;
  }

  [[nodiscard]] Replay replay_of(const Unit &unit, const Task &task) const {
    Replay replay;
    replay.rank = unit.rank;
    metrics::DurationSketch responses{1024};
    if (unit.runs.empty()) return replay;
    const Time first_release = unit.runs.front().released.value_or(unit.runs.front().start);
    const Duration stated = first_of(unit).id.period;
    const bool is_on_grid = unit.members.size() == 1 && stated > 0 && task.period == stated;
    for (const EndedRun &run : unit.runs) {
      if (run.released) responses.add(run.end - *run.released);
      // Releases of a timer that no run answered have a number, too.
      const std::size_t number =
          is_on_grid ? static_cast<std::size_t>((*run.released - first_release + task.period / 2) / task.period)
                     : replay.executions.size();
      const std::size_t count = std::clamp(number + 1, replay.executions.size(), kMostRuns);
      replay.executions.resize(count, run.execution);
      replay.delays.resize(count, run.delay().value_or(result_.overhead));
    }
    replay.responses = responses.distribution();
    std::vector<Duration> sorted = replay.executions;
    std::sort(sorted.begin(), sorted.end());
    const Duration upper = sorted[sorted.size() * 3 / 4];
    replay.undisturbed = upper + (upper - sorted[sorted.size() / 4]) * 3 / 2;  // Tukey's fence for outliers
    if (task.activation == Activation::Data) return replay;
    replay.offset = std::max<Time>(first_release - recording_.first(), 0);
    if (stated > 0) return replay;
    replay.gaps.push_back(0);
    Time last = first_release;
    for (std::size_t i = 1; i < unit.runs.size(); ++i) {
      const Time release = std::max(unit.runs[i].released.value_or(unit.runs[i].start), last + 1);
      replay.gaps.push_back(release - std::exchange(last, release) - task.period);
    }
    return replay;
  }

  static Duration timer_period(const CallbackRecord &timer, std::vector<std::string> &notes) {
    const Duration stated = std::max<Duration>(timer.id.period, 1);
    if (timer.runs < 10) return stated;
    const Duration seen = (timer.last_start - timer.first_start) / static_cast<Duration>(timer.runs - 1);
    const double ratio = static_cast<double>(seen) / static_cast<double>(stated);
    if (ratio > 0.8 && ratio < 1.2) return stated;
    notes.push_back(fmt::format("ran every {} on average; unknown: {}", humanize_duration(seen),
                                ratio < 1 ? "the clock of its period, so this is the period here"
                                          : "whether it was late, cancelled at times, or on another clock"));
    return ratio < 1 ? std::max<Duration>(seen, 1) : stated;
  }

  static void set_execution(Task &task, const metrics::DurationSketch &seen) {
    const metrics::Distribution execution = seen.distribution();
    task.wcet = std::max<Duration>(execution.max, 1);
    task.bcet = std::clamp<Duration>(execution.min, 0, task.wcet);
    if (execution.count < kQuantiles || task.bcet == task.wcet) {
      task.execution.kind = task.bcet > 0 ? ExecutionTime::Kind::Uniform : ExecutionTime::Kind::Constant;
      return;
    }
    task.execution.kind = ExecutionTime::Kind::Empirical;
    const Duration digit = std::max<Duration>(task.wcet / 2000, 1);  // no more digits than the measurement has
    std::uint64_t so_far = 0;
    std::vector<Duration> &samples = task.execution.samples;
    for (const metrics::CountedDurations &range : seen.counted()) {
      so_far += range.count;
      // A sample is the middle of one of twenty equal shares.
      while (samples.size() < kQuantiles && so_far * 2 * kQuantiles >= execution.count * (2 * samples.size() + 1)) {
        const Duration middle = range.low + (range.high - range.low) / 2;
        samples.push_back(
            std::clamp((middle + digit / 2) / digit * digit, std::max<Duration>(task.bcet, 1), task.wcet));
      }
    }
  }

  // ---- what the recording does not say ----

  /// Returns the first group of its node in which no callback ran at the same time as one of the unit, and adds it.
  std::string group_of(std::size_t unit, std::vector<Positions> &groups) {
    const CallbackRecord &first = first_of(units_[unit]);
    const std::string &node = first.id.node;
    if (first.group != 0) {
      // Its number among the groups of the process, in the order of their first callbacks.
      const auto at = std::find(known_groups_.begin(), known_groups_.end(), first.group);
      const auto number = at - known_groups_.begin() + 1;
      if (at == known_groups_.end()) known_groups_.push_back(first.group);
      return recording_.is_exclusive(first.process, first.group) ? fmt::format("group {}", number) : std::string();
    }
    are_groups_assumed_ = true;
    const auto overlaps = [&](std::size_t other) {
      for (const std::size_t member : units_[unit].members) {
        for (const std::size_t beside : units_[other].members) {
          if (callbacks_[member].overlaps.contains(beside)) return true;
        }
      }
      return false;
    };
    auto group = std::find_if(groups.begin(), groups.end(), [&](const Positions &members) {
      return std::none_of(members.begin(), members.end(), overlaps);
    });
    if (group == groups.end()) group = groups.insert(group, Positions());
    group->push_back(unit);
    return group == groups.begin() ? node : fmt::format("{} {}", node, group - groups.begin() + 1);
  }

  void drop_small_groups() {
    std::map<std::string, std::size_t> sizes;
    for (Dag &dag : result_.workload.dags) {
      for (const Task &task : dag.tasks) ++sizes[task.group];
    }
    bool some = false;
    for (Dag &dag : result_.workload.dags) {
      for (Task &task : dag.tasks) {
        if (sizes[task.group] == 1) task.group.clear();
        some = some || !task.group.empty();
      }
    }
    if (some && are_groups_assumed_) {
      result_.remarks.emplace_back(
          "unknown: callback groups. Assumed: callbacks of a node that never ran at the same time share a mutually "
          "exclusive one ('group').");
    }
  }

  void describe() {
    for (const Unit &unit : units_) {
      for (const std::size_t member : unit.members) {
        if (callbacks_[member].id.kind != CallbackKind::Subscription) continue;
        (unit.predecessors.empty() ? result_.as_sources : result_.over_edges) += callbacks_[member].runs;
      }
    }
    result_.executed = process_.executed;
    result_.length = recording_.last() - recording_.first();
    result_.is_wall_time = !process_.has_switches;
    const auto remark = [&](std::string text) { result_.remarks.push_back(std::move(text)); };
    remark(fmt::format("{} in {}, on {} of {}, which 'workers' counts.", plural(process_.runs, "run"),
                       humanize_duration(recording_.last() - recording_.first()), process_.threads.size(),
                       plural(process_.executor_threads.size(), "thread of executors", "threads of executors")));
    remark(process_.has_switches
               ? "Execution is processor time, by the kernel's sched_switch."
               : "Execution is wall time, with preemption and waits: no sched_switch names these threads.");
    remark(fmt::format(
        "The tasks stand for {} of the time in callbacks. Of {}, {} came over edges, {} to sources with "
        "rates of their own.",
        share_of(static_cast<std::uint64_t>(result_.explained), static_cast<std::uint64_t>(result_.executed)),
        plural(result_.messages, "message"), share_of(result_.over_edges, result_.messages),
        share_of(result_.as_sources, result_.messages)));
    if (result_.overhead > 0) {
      remark(fmt::format("The executor takes {} from one callback to the next (--overhead-dispatch).",
                         humanize_duration(result_.overhead)));
    }
    if (result_.wake_ups.count > 0) {
      remark(fmt::format("An idle thread wakes up within {} (median; 99 % within {}).",
                         humanize_duration(result_.wake_ups.p50), humanize_duration(result_.wake_ups.p99)));
    }
    if (process_.unknown_runs > 0) {
      remark(fmt::format("unknown: {} of callbacks whose creation was not recorded.",
                         plural(process_.unknown_runs, "run")));
    }
    if (process_.torn_runs > 0) {
      remark(fmt::format("unknown: {} whose begin or end was not recorded.", plural(process_.torn_runs, "run")));
    }
    remark("unknown: which executor a callback belongs to, and clients' callbacks, which leave no events.");
  }

  const std::vector<CallbackRecord> &callbacks_;
  const Recording &recording_;
  const ProcessRecord &process_;
  std::vector<Unit> units_;
  std::vector<std::uint64_t> known_groups_;
  bool are_groups_assumed_ = false;
  ImportedWorkload result_;
};

}  // namespace

Result<ImportedWorkload> import_workload(const Recording &recording, std::uint32_t process) {
  ImportedWorkload imported = Importing(recording, process).run();
  if (imported.workload.dags.empty()) {
    return make_error(imported.left_out.empty() ? "none of its callbacks was seen to be created"
                                                : "no callback makes a task: " + imported.left_out.front(),
                      "record from before the nodes start, and for longer");
  }
  Diagnostics mistakes = validate(imported.workload);  // such as a name with a line feed
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  return imported;
}

std::string to_yaml(const ImportedWorkload &imported) {
  std::string text;
  const auto comment = [&](std::string line, std::size_t indent) {
    std::replace(line.begin(), line.end(), '\n', ' ');
    const std::string begin = std::string(indent, ' ') + "# ";
    for (const std::string &part : lines_within(printable(line), kColumns - begin.size())) text += begin + part + "\n";
  };
  for (const std::string &remark : imported.remarks) comment(remark, 0);
  for (const std::string &line : imported.left_out) comment("left out: " + line, 0);
  const std::string plain = redag::to_yaml(imported.workload);
  auto notes = imported.notes.begin();
  for (std::size_t at = 0; at < plain.size();) {
    const std::size_t end = plain.find('\n', at) + 1;
    const std::string_view line = std::string_view(plain).substr(at, end - at);
    const std::size_t indent = line.find_first_not_of(' ');
    if (line.substr(indent, 8) == "- {name:" && notes != imported.notes.end()) {
      for (const std::string &note : *notes++) comment(note, indent);
    }
    text += line;
    at = end;
  }
  return text;
}

std::string to_robot_yaml(std::vector<ImportedWorkload> processes, std::uint32_t cpus) {
  std::string text = fmt::format(
      "# Every process as it would be with an executor of ReDAG-RT. unknown: the processors; the recording has events "
      "of these.\nrobot: recorded\ncpus: 0-{}\nprocesses:\n",
      cpus - 1);
  std::set<std::string> names;
  for (ImportedWorkload &process : processes) {
    process.workload.platform.preemption = PreemptionMode::Os;
    process.workload.platform.workers = cpus;
    process.workload.name = unique_name(process.workload.name, names);
    const std::string plain = "\n" + to_yaml(process);
    const std::size_t name = plain.find("\nname: ") + 1;
    text += "  - " + plain.substr(name, plain.find('\n', name) + 1 - name) + "    workload:\n";
    for (std::size_t at = 1; at < plain.size();) {
      const std::size_t end = plain.find('\n', at) + 1;
      text += "      " + plain.substr(at, end - at);
      at = end;
    }
  }
  return text;
}

}  // namespace redag::lab
