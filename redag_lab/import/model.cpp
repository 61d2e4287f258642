// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "redag/base/text.hpp"
#include "redag/base/words.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_analysis/text/wrap.hpp"

namespace redag::lab {
namespace {

using CallbackKind = Callback::Kind;

constexpr std::uint64_t kFewestRuns = 3;  // that tell a rate
constexpr std::size_t kQuantiles = 20;
constexpr std::size_t kColumns = 100;  // of comments
constexpr double kAll = 0.95;          // so many of its runs publish: each does, but for those at begin and end
constexpr double kLeast = 0.5;         // a message that is overwritten is not taken

/// Counts that differ by what begin and end of a recording cut off, and by a few lost messages.
bool is_near(std::uint64_t a, std::uint64_t b) {
  const double difference = std::abs(static_cast<double>(a) - static_cast<double>(b));
  return difference <= 2 + (1 - kAll) * static_cast<double>(std::max(a, b));
}

/// What becomes a task: a callback, or several of a node that together make one job.
struct Unit {
  std::vector<std::size_t> members;  // positions in Recording::callbacks(); a timer is first
  std::uint64_t runs = 0;
  metrics::DurationSketch execution{1024};
  std::vector<std::size_t> predecessors;
  bool is_source = true;
  std::vector<std::string> notes;
};

/// Joins callbacks of a node which store what they take until the last one of a round has it all, and which then
/// publish one message.
class Joins {
 public:
  Joins(const Recording &recording, const std::vector<std::size_t> &callbacks) : recording_(recording) {
    parents_.resize(recording.callbacks().size());
    std::iota(parents_.begin(), parents_.end(), 0);
    std::map<std::pair<std::string, std::size_t>, std::vector<std::size_t>> publishers;
    for (const std::size_t callback : callbacks) {
      const CallbackRecord &record = recording.callbacks()[callback];
      for (const auto &[topic, output] : record.outputs) publishers[{record.id.node, topic}].push_back(callback);
    }
    for (const auto &[key, members] : publishers) {
      if (!is_round(members, key.second)) continue;
      for (const std::size_t member : members) parents_[root(member)] = root(members.front());
    }
  }

  std::size_t root(std::size_t callback) {
    while (parents_[callback] != callback) callback = parents_[callback];
    return callback;
  }

 private:
  [[nodiscard]] bool is_round(const std::vector<std::size_t> &members, std::size_t topic) const {
    std::uint64_t messages = 0;
    std::uint64_t rounds = UINT64_MAX;
    std::size_t timers = 0;
    for (const std::size_t member : members) {
      const CallbackRecord &record = recording_.callbacks()[member];
      messages += record.outputs.at(topic).messages;
      rounds = std::min(rounds, record.runs);
      if (record.id.kind == CallbackKind::Timer) ++timers;
      if (record.id.kind == CallbackKind::Service || record.most_at_once > 1) return false;
      for (const std::size_t other : members) {
        if (record.overlaps.contains(other)) return false;
      }
    }
    return members.size() > 1 && timers <= 1 && messages >= kFewestRuns && is_near(messages, rounds);
  }

  const Recording &recording_;
  std::vector<std::size_t> parents_;
};

class Importing {
 public:
  Importing(const Recording &recording, std::uint32_t process)
      : recording_(recording), pid_(process), process_(recording.processes().at(process)) {}

  ImportedWorkload run() {
    make_units();
    for (std::size_t unit = 0; unit < units_.size(); ++unit) find_predecessors(unit);
    break_cycles();
    make_dags();
    assume_groups();
    describe();
    return std::move(result_);
  }

 private:
  [[nodiscard]] const CallbackRecord &record(std::size_t callback) const { return recording_.callbacks()[callback]; }
  [[nodiscard]] const CallbackRecord &first_of(const Unit &unit) const { return record(unit.members.front()); }

  void make_units() {
    std::vector<std::size_t> candidates;
    std::size_t never = 0;
    for (std::size_t i = 0; i < recording_.callbacks().size(); ++i) {
      const CallbackRecord &callback = record(i);
      if (callback.process != pid_) continue;
      if (callback.id.kind == CallbackKind::Subscription) result_.messages += callback.runs;
      const std::uint64_t ended = callback.quiet.size() + callback.publishing.size();
      if (callback.runs == 0) {
        if (!is_ros_internal(callback.id)) ++never;
      } else if (ended == 0) {
        leave_out(callback, "no run of it ended");
      } else if (callback.id.node.empty()) {
        leave_out(callback, "its node is unknown: the recording began later");
      } else if (callback.runs < kFewestRuns &&
                 (callback.id.kind != CallbackKind::Timer || !expires_rarely(callback))) {
        leave_out(callback, fmt::format("ran {}: its rate is unknown", plural(callback.runs, "time")));
      } else {
        candidates.push_back(i);
      }
    }
    if (never > 0) result_.left_out.push_back(fmt::format("{} that never ran", plural(never, "callback")));
    Joins joins(recording_, candidates);
    std::map<std::size_t, std::size_t> unit_of_root;
    for (const std::size_t callback : candidates) {
      const auto [place, is_new] = unit_of_root.try_emplace(joins.root(callback), units_.size());
      if (is_new) units_.emplace_back();
      units_[place->second].members.push_back(callback);
      unit_of_[callback] = place->second;
    }
    for (Unit &unit : units_) {
      std::stable_partition(unit.members.begin(), unit.members.end(),
                            [&](std::size_t member) { return record(member).id.kind == CallbackKind::Timer; });
      for (const std::size_t member : unit.members) {
        const CallbackRecord &callback = record(member);
        unit.execution.merge(callback.publishing);
        if (unit.members.size() == 1) unit.execution.merge(callback.quiet);
        result_.explained += callback.executed;
      }
      unit.runs = unit.execution.size();
      if (unit.members.size() > 1) unit.notes.push_back(joined_note(unit));
    }
  }

  void leave_out(const CallbackRecord &callback, const std::string &why) {
    result_.left_out.push_back(fmt::format("{}: {}", to_string(callback.id), why));
  }

  [[nodiscard]] bool expires_rarely(const CallbackRecord &timer) const {
    return timer.id.period > 0 && (recording_.last() - timer.created) / timer.id.period <= 10;
  }

  [[nodiscard]] std::string joined_note(const Unit &unit) const {
    std::vector<std::string> names;
    for (const std::size_t member : unit.members) {
      const CallbackId &id = record(member).id;
      names.push_back(id.kind == CallbackKind::Timer ? std::string("its timer") : id.name);
    }
    return fmt::format("one job of {}: the last of them publishes", join(names));
  }

  // ---- edges ----

  /// The callbacks of this process that publish to a topic, by unit, with their runs and messages.
  [[nodiscard]] std::map<std::size_t, CallbackRecord::Output> publishers_of(std::size_t topic,
                                                                            bool &from_others) const {
    std::map<std::size_t, CallbackRecord::Output> result;
    from_others = recording_.topics()[topic].outside > 0;
    for (std::size_t i = 0; i < recording_.callbacks().size(); ++i) {
      const auto output = record(i).outputs.find(topic);
      if (output == record(i).outputs.end()) continue;
      const auto unit = unit_of_.find(i);
      if (record(i).process != pid_ || unit == unit_of_.end()) {
        from_others = true;
        continue;
      }
      result[unit->second].runs += output->second.runs;
      result[unit->second].messages += output->second.messages;
    }
    return result;
  }

  /// Returns the unit whose every job sends the one message that this callback takes; otherwise says why there is none.
  std::optional<std::size_t> sender_of(const CallbackRecord &taker, std::vector<std::string> &notes) const {
    const std::optional<std::size_t> topic = recording_.find_topic(taker.id.name);
    bool from_others = false;
    const auto publishers =
        topic ? publishers_of(*topic, from_others) : std::map<std::size_t, CallbackRecord::Output>();
    if (publishers.empty()) {
      const bool hidden = taker.intra_process > 0 && !from_others;
      notes.push_back(hidden ? taker.id.name + " came intra-process from an unknown callback: no event says who sent it"
                             : taker.id.name + " comes from outside of the callbacks of this process");
      return std::nullopt;
    }
    const auto &[unit, output] = *publishers.begin();
    const Unit &sender = units_[unit];
    const std::string name = to_string(first_of(sender).id);
    if (publishers.size() > 1 || from_others) {
      notes.push_back(
          fmt::format("{} has several publishers, {} among them: each message is one job", taker.id.name, name));
    } else if (static_cast<double>(output.runs) < kAll * static_cast<double>(sender.runs) - 2) {
      notes.push_back(fmt::format("{} publishes {} in {} of {} runs: a rate of its own", name, taker.id.name,
                                  output.runs, sender.runs));
    } else if (!is_near(output.messages, output.runs)) {
      notes.push_back(fmt::format("{} publishes {} {} times in {} runs: a rate of its own", name, taker.id.name,
                                  output.messages, output.runs));
    } else if (static_cast<double>(taker.runs) < kLeast * static_cast<double>(output.messages) - 2) {
      notes.push_back(
          fmt::format("took {} of {} messages of {}: a rate of its own", taker.runs, output.messages, name));
    } else {
      if (!is_near(taker.runs, output.messages)) {
        notes.push_back(fmt::format("took {} of {} messages of {}", taker.runs, output.messages, name));
      }
      return unit;
    }
    return std::nullopt;
  }

  void find_predecessors(std::size_t position) {
    Unit &unit = units_[position];
    std::vector<std::string> notes;
    for (const std::size_t member : unit.members) {
      const CallbackRecord &callback = record(member);
      if (callback.id.kind != CallbackKind::Subscription) continue;
      const std::optional<std::size_t> sender = sender_of(callback, notes);
      if (!sender || *sender == position) continue;
      if (std::find(unit.predecessors.begin(), unit.predecessors.end(), *sender) == unit.predecessors.end()) {
        unit.predecessors.push_back(*sender);
      }
    }
    const bool is_timer = first_of(unit).id.kind == CallbackKind::Timer;
    unit.is_source = is_timer || unit.predecessors.empty();
    if (!notes.empty() && !unit.predecessors.empty())
      notes.emplace_back("unknown to the model: that it waits for this, too");
    unit.notes.insert(unit.notes.end(), notes.begin(), notes.end());
  }

  void break_cycles() {
    std::vector<bool> done(units_.size(), false);
    for (std::size_t left = units_.size(); left > 0;) {
      const std::size_t before = left;
      std::optional<std::size_t> earliest;
      for (std::size_t i = 0; i < units_.size(); ++i) {
        if (done[i]) continue;
        const auto &from = units_[i].predecessors;
        if (std::all_of(from.begin(), from.end(), [&](std::size_t p) { return bool{done[p]}; })) {
          done[i] = true;
          --left;
        } else if (!earliest || first_of(units_[i]).first_start < first_of(units_[*earliest]).first_start) {
          earliest = i;
        }
      }
      if (left != before || !earliest) continue;
      units_[*earliest].predecessors.clear();
      units_[*earliest].is_source = true;
      units_[*earliest].notes.emplace_back("its messages come around in a circle, which begins here in the model");
    }
  }

  // ---- tasks ----

  void make_dags() {
    std::vector<std::size_t> component(units_.size());
    std::iota(component.begin(), component.end(), 0);
    const auto root = [&](std::size_t unit) {
      while (component[unit] != unit) unit = component[unit];
      return unit;
    };
    for (std::size_t i = 0; i < units_.size(); ++i) {
      for (const std::size_t p : units_[i].predecessors)
        component[std::max(root(i), root(p))] = std::min(root(i), root(p));
    }
    Workload &workload = result_.workload;
    workload.name = process_.program.empty() ? "imported" : process_.program;
    workload.platform.workers =
        std::max<std::uint32_t>(static_cast<std::uint32_t>(process_.executor_threads.size()), 1);
    std::set<std::string> dag_names;
    std::set<std::string> task_names;
    for (std::size_t first = 0; first < units_.size(); ++first) {
      if (root(first) != first) continue;
      Dag dag;
      dag.edges = Edges::Seen;
      std::vector<std::size_t> members;
      for (std::size_t i = first; i < units_.size(); ++i) {
        if (root(i) == first) members.push_back(i);
      }
      const auto source =
          *std::find_if(members.begin(), members.end(), [&](std::size_t i) { return units_[i].predecessors.empty(); });
      dag.name = unique(first_of(units_[source]).id.node.substr(1), dag_names);
      for (const std::size_t i : members) {
        dag.tasks.push_back(make_task(units_[i]));
        dag.tasks.back().name = unique(dag.tasks.back().name, task_names);
        for (const std::size_t p : units_[i].predecessors) {
          const auto at = std::find(members.begin(), members.end(), p) - members.begin();
          dag.tasks.back().predecessors.push_back(static_cast<std::uint32_t>(at));
        }
        order_.push_back(i);
        result_.notes.push_back(units_[i].notes);
      }
      inherit_periods(dag);
      workload.dags.push_back(std::move(dag));
    }
  }

  static std::string unique(const std::string &wanted, std::set<std::string> &taken) {
    std::string name = wanted;
    for (int n = 2; !taken.insert(name).second; ++n) name = fmt::format("{}_{}", wanted, n);
    return name;
  }

  Task make_task(Unit &unit) {
    const CallbackRecord &first = first_of(unit);
    Task task;
    task.name = to_string(first.id);
    set_execution(task, unit);
    const bool is_timer = first.id.kind == CallbackKind::Timer;
    task.callback = Callback{.node = first.id.node,
                             .kind = first.id.kind,
                             .name = first.id.name,
                             .period = first.id.period,
                             .index = is_timer ? std::optional(first.id.index) : std::nullopt};
    if (!unit.is_source) {
      task.activation = Activation::Data;
    } else if (is_timer) {
      task.period = timer_period(first, unit.notes);
      task.phase = Phase::Unknown;
    } else {
      const bool are_sent = first.sent.size() == first.begun.size();
      const Arrivals arrivals = estimate_arrivals(are_sent ? first.sent : first.begun);
      task.period = arrivals.period;
      task.jitter = arrivals.jitter;
      task.phase = arrivals.sporadic || first.id.kind == CallbackKind::Service ? Phase::Event : Phase::Unknown;
      if (task.phase == Phase::Event) task.jitter = 0;
      unit.notes.push_back(fmt::format("period and jitter as seen in {} {}{}{}", first.begun.size(),
                                       are_sent ? "messages, by when they were sent" : "runs, by their begin",
                                       arrivals.note.empty() ? "" : "; ", arrivals.note));
    }
    task.deadline = task.period;
    if (unit.members.size() == 1 && first.most_at_once > 1) task.concurrency = first.most_at_once;
    return task;
  }

  Duration timer_period(const CallbackRecord &timer, std::vector<std::string> &notes) const {
    const Duration stated = std::max<Duration>(timer.id.period, 1);
    if (timer.runs < 10) return stated;
    const Duration seen = (timer.last_start - timer.first_start) / static_cast<Duration>(timer.runs - 1);
    const double ratio = static_cast<double>(seen) / static_cast<double>(stated);
    if (ratio > 0.8 && ratio < 1.2) return stated;
    notes.push_back(fmt::format("ran every {} on average; unknown: {}", humanize_duration(seen),
                                ratio < 1 ? "the clock of its period, so this is the period here"
                                          : "whether it was late, cancelled at times, or on another clock"));
    return ratio < 1 ? seen : stated;
  }

  void set_execution(Task &task, Unit &unit) const {
    const metrics::Distribution execution = unit.execution.distribution();
    task.wcet = std::max<Duration>(execution.max, 1);
    task.bcet = std::min(std::max<Duration>(execution.min, 0), task.wcet);
    unit.notes.insert(unit.notes.begin(),
                      fmt::format("wcet: the longest of {}; median {}, 99 % within {}", plural(execution.count, "run"),
                                  humanize_duration(execution.p50), humanize_duration(execution.p99)));
    if (execution.count < kQuantiles || task.bcet == task.wcet) {
      task.execution.kind = task.bcet > 0 ? ExecutionTime::Kind::Uniform : ExecutionTime::Kind::Constant;
      return;
    }
    task.execution.kind = ExecutionTime::Kind::Empirical;
    std::uint64_t seen = 0;
    const Duration digit = std::max<Duration>(task.wcet / 2000, 1);  // no more digits than the measurement has
    for (const metrics::CountedDurations &range : unit.execution.counted()) {
      seen += range.count;
      // Quantile i stands for the i-th of twenty equal shares: it is that share's middle.
      while (task.execution.samples.size() < kQuantiles &&
             static_cast<double>(seen) * 2 * kQuantiles >=
                 static_cast<double>(execution.count) * static_cast<double>(2 * task.execution.samples.size() + 1)) {
        const Duration middle = range.low + (range.high - range.low) / 2;
        task.execution.samples.push_back(
            std::clamp((middle + digit / 2) / digit * digit, std::max<Duration>(task.bcet, 1), task.wcet));
      }
    }
  }

  // ---- what the recording does not say ----

  /// Two callbacks that ran at once are in no common group. All others of a node can be in its default one.
  void assume_groups() {
    std::map<std::string, std::vector<std::vector<std::size_t>>> groups;  // of each node: units
    const auto overlap = [&](std::size_t a, std::size_t b) {
      return std::any_of(units_[a].members.begin(), units_[a].members.end(), [&](std::size_t member) {
        return std::any_of(units_[b].members.begin(), units_[b].members.end(),
                           [&](std::size_t other) { return record(member).overlaps.contains(other); });
      });
    };
    std::vector<Task *> tasks(units_.size());
    std::size_t next = 0;
    for (Dag &dag : result_.workload.dags) {
      for (Task &task : dag.tasks) tasks[order_[next++]] = &task;
    }
    bool some = false;
    for (std::size_t i = 0; i < units_.size(); ++i) {
      if (tasks[i]->concurrency > 1) continue;
      auto &of_node = groups[first_of(units_[i]).id.node];
      auto fits = std::find_if(of_node.begin(), of_node.end(), [&](const std::vector<std::size_t> &group) {
        return std::none_of(group.begin(), group.end(), [&](std::size_t other) { return overlap(i, other); });
      });
      if (fits == of_node.end()) fits = of_node.insert(fits, std::vector<std::size_t>());
      fits->push_back(i);
    }
    for (const auto &[node, of_node] : groups) {
      for (std::size_t n = 0; n < of_node.size(); ++n) {
        if (of_node[n].size() < 2) continue;
        some = true;
        for (const std::size_t i : of_node[n]) tasks[i]->group = n == 0 ? node : fmt::format("{} {}", node, n + 1);
      }
    }
    if (some) {
      result_.remarks.emplace_back(
          "unknown: callback groups. Assumed: callbacks of a node that never ran at the same time share a mutually "
          "exclusive one ('group').");
    }
  }

  void describe() {
    for (std::size_t i = 0; i < units_.size(); ++i) {
      for (const std::size_t member : units_[i].members) {
        if (record(member).id.kind != CallbackKind::Subscription) continue;
        (units_[i].predecessors.empty() ? result_.as_sources : result_.over_edges) += record(member).runs;
      }
    }
    result_.executed = process_.executed;
    std::vector<std::string> remarks;
    remarks.push_back(
        fmt::format("{} in {}, on {} of the {} of executors. 'workers' counts the latter.",
                    plural(process_.runs, "run"), humanize_duration(recording_.last() - recording_.first()),
                    plural(process_.threads.size(), "thread"), plural(process_.executor_threads.size(), "thread")));
    remarks.push_back(process_.has_switches
                          ? "Execution is processor time, by the kernel's sched_switch."
                          : "Execution is wall time, with preemption and waits: no sched_switch names these threads.");
    remarks.push_back(
        fmt::format("The tasks stand for {} of the time in callbacks. Of {}, {} came over edges, {} to "
                    "sources with rates of their own.",
                    format_percent(share(result_.explained, result_.executed)), plural(result_.messages, "message"),
                    format_percent(share(result_.over_edges, result_.messages)),
                    format_percent(share(result_.as_sources, result_.messages))));
    if (process_.unknown_runs > 0) {
      remarks.push_back(fmt::format("unknown: {} of callbacks whose creation was not recorded ({} in them).",
                                    plural(process_.unknown_runs, "run"),
                                    humanize_duration(process_.unknown_executed)));
    }
    if (process_.torn_runs > 0) {
      remarks.push_back(
          fmt::format("unknown: {} whose begin or end was not recorded.", plural(process_.torn_runs, "run")));
    }
    if (recording_.disordered() > 0) {
      remarks.push_back(
          fmt::format("unknown: {} earlier than the one before.", plural(recording_.disordered(), "event")));
    }
    remarks.emplace_back(
        "unknown: which executor a callback belongs to, and clients' callbacks, which leave no events.");
    result_.remarks.insert(result_.remarks.begin(), remarks.begin(), remarks.end());
  }

  static double share(std::int64_t part, std::int64_t whole) {
    return whole == 0 ? std::nan("") : static_cast<double>(part) / static_cast<double>(whole);
  }
  static double share(std::uint64_t part, std::uint64_t whole) {
    return share(static_cast<std::int64_t>(part), static_cast<std::int64_t>(whole));
  }

  const Recording &recording_;
  std::uint32_t pid_;
  const ProcessRecord &process_;
  std::vector<Unit> units_;
  std::map<std::size_t, std::size_t> unit_of_;
  std::vector<std::size_t> order_;  // units by TaskId
  ImportedWorkload result_;
};

}  // namespace

std::vector<std::uint32_t> processes_with_callbacks(const Recording &recording) {
  std::vector<std::pair<Duration, std::uint32_t>> busy;
  for (const auto &[id, process] : recording.processes()) {
    if (process.runs > 0) busy.emplace_back(-process.executed, id);
  }
  std::sort(busy.begin(), busy.end());
  std::vector<std::uint32_t> result;
  for (const auto &[executed, id] : busy) result.push_back(id);
  return result;
}

Result<ImportedWorkload> import_workload(const Recording &recording, std::uint32_t process) {
  ImportedWorkload imported = Importing(recording, process).run();
  if (!imported.workload.dags.empty()) {
    Diagnostics mistakes = validate(imported.workload);
    if (has_errors(mistakes))
      return tl::unexpected<Diagnostics>(std::move(mistakes));  // such as a name with a line feed
    return imported;
  }
  if (imported.left_out.empty()) {
    return make_error(fmt::format("none of the callbacks of process {} was seen to be created", process),
                      "start the recording before the nodes");
  }
  return make_error(
      fmt::format("process {} has no callback that makes a task: {}", process, imported.left_out.front()));
}

std::string to_yaml(const ImportedWorkload &imported) {
  std::string text;
  const auto comment = [&](std::string line, std::size_t indent) {
    std::replace_if(
        line.begin(), line.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
    const std::string begin = std::string(indent, ' ') + "# ";
    for (const std::string &part : lines_within(printable(line), kColumns - begin.size())) text += begin + part + "\n";
  };
  for (const std::string &remark : imported.remarks) comment(remark, 0);
  for (const std::string &line : imported.left_out) comment("left out: " + line, 0);
  const std::string plain = redag::to_yaml(imported.workload);
  std::size_t task = 0;
  for (std::size_t at = 0; at < plain.size();) {
    const std::size_t end = plain.find('\n', at) + 1;
    const std::string_view line = std::string_view(plain).substr(at, end - at);
    const std::size_t indent = line.find_first_not_of(' ');
    if (line.substr(indent, 8) == "- {name:" && task < imported.notes.size()) {
      for (const std::string &note : imported.notes[task++]) comment(note, indent);
    }
    text += line;
    at = end;
  }
  return text;
}

}  // namespace redag::lab
