// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "redag/base/text.hpp"
#include "redag/base/words.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_analysis/text/wrap.hpp"

namespace redag::lab {
namespace {

using CallbackKind = Callback::Kind;
using Output = CallbackRecord::Output;
using Positions = std::vector<std::size_t>;

constexpr std::uint64_t kFewestRuns = 3;  // that tell a rate
constexpr std::size_t kQuantiles = 20;
constexpr std::size_t kColumns = 100;  // of comments
constexpr double kEdges = 2;           // runs or messages that begin and end of a recording cut off
constexpr double kAll = 0.95;          // of what is as many, but for a few that were lost
constexpr double kMost = 0.5;          // a message that is overwritten is not taken

bool is_at_least(std::uint64_t count, double share, std::uint64_t whole) {
  return static_cast<double>(count) + kEdges >= share * static_cast<double>(whole);
}
bool is_as_many(std::uint64_t a, std::uint64_t b) { return is_at_least(a, kAll, b) && is_at_least(b, kAll, a); }

std::string share_of(std::uint64_t part, std::uint64_t whole) {
  return format_percent(static_cast<double>(part) / static_cast<double>(whole));
}

/// Positions that belong together.
class Clusters {
 public:
  explicit Clusters(std::size_t count) : parents_(count) { std::iota(parents_.begin(), parents_.end(), 0); }
  /// The least position of the cluster.
  [[nodiscard]] std::size_t first(std::size_t position) const {
    while (parents_[position] != position) position = parents_[position];
    return position;
  }
  void join(std::size_t a, std::size_t b) { parents_[std::max(first(a), first(b))] = std::min(first(a), first(b)); }

 private:
  Positions parents_;
};

/// What becomes a task: a callback, or several of a node that together make one job.
struct Unit {
  Positions members;  // in Recording::callbacks(); a timer is first
  metrics::DurationSketch execution{1024};
  metrics::DurationSketch response{1024};
  Positions predecessors;  // units
  std::vector<std::string> notes;
};

class Importing {
 public:
  Importing(const Recording &recording, std::uint32_t pid)
      : callbacks_(recording.callbacks()), recording_(recording), pid_(pid), process_(recording.processes().at(pid)) {}

  ImportedWorkload run() {
    for (std::size_t i = 0; i < callbacks_.size(); ++i) {
      for (const auto &[topic, output] : callbacks_[i].outputs) publishers_[topic].push_back(i);
    }
    make_units(usable_callbacks());
    for (std::size_t unit = 0; unit < units_.size(); ++unit) find_predecessors(unit);
    open_circles();
    make_dags();
    describe();
    return std::move(result_);
  }

 private:
  [[nodiscard]] const CallbackRecord &first_of(const Unit &unit) const { return callbacks_[unit.members.front()]; }
  [[nodiscard]] bool is_timer(std::size_t callback) const {
    return callbacks_[callback].id.kind == CallbackKind::Timer;
  }

  // ---- callbacks ----

  Positions usable_callbacks() {
    Positions usable;
    std::size_t never = 0;
    std::uint64_t of_ros = 0;
    for (std::size_t i = 0; i < callbacks_.size(); ++i) {
      const CallbackRecord &callback = callbacks_[i];
      if (callback.process != pid_) continue;
      if (is_ros_internal(callback.id)) {
        of_ros += callback.runs;
        continue;
      }
      if (callback.id.kind == CallbackKind::Subscription) result_.messages += callback.runs;
      const bool is_slow = is_timer(i) && callback.id.period > (recording_.last() - callback.created) / 10;
      std::string why;
      if (callback.id.node.empty()) {
        why = "its node is unknown: the recording began later";
      } else if (callback.quiet.execution.size() + callback.publishing.execution.size() == 0) {
        why = "no run of it ended";
      } else if (callback.runs < kFewestRuns && !is_slow) {
        why = fmt::format("ran {}: its rate is unknown", plural(callback.runs, "time"));
      }
      if (callback.runs == 0) {
        ++never;
      } else if (why.empty()) {
        usable.push_back(i);
      } else {
        result_.left_out.push_back(fmt::format("{}: {}", to_string(callback.id), why));
      }
    }
    if (of_ros > 0)
      result_.left_out.push_back(fmt::format("{} of ROS itself, such as parameters", plural(of_ros, "run")));
    if (never > 0) result_.left_out.push_back(fmt::format("{} that never ran", plural(never, "callback")));
    return usable;
  }

  /// True if these callbacks of a node can be one job: at most one timer, no service, and none beside another.
  [[nodiscard]] bool can_be_one_job(const Positions &members) const {
    const auto spoils = [&](std::size_t member) {
      const CallbackRecord &callback = callbacks_[member];
      return callback.id.kind == CallbackKind::Service || callback.most_at_once > 1 ||
             std::any_of(members.begin(), members.end(), [&](auto other) { return callback.overlaps.contains(other); });
    };
    return members.size() > 1 && std::none_of(members.begin(), members.end(), spoils) &&
           std::count_if(members.begin(), members.end(), [&](std::size_t i) { return is_timer(i); }) <= 1;
  }

  /// True if the callbacks store what they take until the last one of a round has it all, and publishes.
  [[nodiscard]] bool publish_in_turn(const Positions &members, const std::string &topic) const {
    std::uint64_t messages = 0;
    std::uint64_t rounds = UINT64_MAX;
    for (const std::size_t member : members) {
      messages += callbacks_[member].outputs.at(topic).messages;
      rounds = std::min(rounds, callbacks_[member].runs);
    }
    return messages >= kFewestRuns && is_as_many(messages, rounds);
  }

  /// The same where nothing is published: one run of each round is long, and not always that of the same callback.
  /// Returns what separates long runs from others; 0: it is not so.
  [[nodiscard]] Duration work_in_turn(const Positions &members) const {
    Duration shortest = kNever;
    Duration longest = 0;
    std::uint64_t rounds = UINT64_MAX;
    for (const std::size_t member : members) {
      const metrics::Distribution execution = callbacks_[member].quiet.execution.distribution();
      shortest = std::min(shortest, std::max<Duration>(execution.min, 1));
      longest = std::max(longest, execution.max);
      rounds = std::min(rounds, execution.count);
    }
    const auto limit = static_cast<Duration>(std::sqrt(static_cast<double>(shortest) * static_cast<double>(longest)));
    std::uint64_t work = 0;
    std::size_t changing = 0;
    for (const std::size_t member : members) {
      const std::uint64_t runs = callbacks_[member].quiet.execution.size();
      const std::uint64_t long_runs = longer_than(limit, callbacks_[member].quiet.execution).size();
      work += long_runs;
      if (std::min(long_runs, runs - long_runs) >= kFewestRuns) ++changing;
      if (!is_as_many(runs, rounds)) return 0;
    }
    return changing >= 2 && is_as_many(work, rounds) && longest >= 10 * shortest ? limit : 0;
  }

  static metrics::DurationSketch longer_than(Duration limit, const metrics::DurationSketch &all) {
    metrics::DurationSketch result{1024};
    const Duration longest = all.distribution().max;
    for (const metrics::CountedDurations &range : all.counted()) {
      for (std::uint64_t i = 0; range.low > limit && i < range.count; ++i) result.add(std::min(range.high, longest));
    }
    return result;
  }

  void make_units(const Positions &usable) {
    Clusters jobs(callbacks_.size());
    std::map<std::pair<std::string, std::string>, Positions> sets;  // by node, and topic that they publish to or ""
    for (const std::size_t i : usable) {
      for (const auto &[topic, output] : callbacks_[i].outputs) sets[{callbacks_[i].id.node, topic}].push_back(i);
      if (callbacks_[i].outputs.empty() && !is_timer(i)) sets[{callbacks_[i].id.node, {}}].push_back(i);
    }
    std::map<std::size_t, Duration> limits;  // of jobs that publish nothing
    for (const auto &[key, members] : sets) {
      const std::string &topic = key.second;
      if (!can_be_one_job(members) || (!topic.empty() && !publish_in_turn(members, topic))) continue;
      if (topic.empty() && (limits[members.front()] = work_in_turn(members)) == 0) continue;
      for (const std::size_t member : members) jobs.join(members.front(), member);
    }
    std::map<std::size_t, std::size_t> units;
    for (const std::size_t callback : usable) {
      const auto [unit, is_new] = units.try_emplace(jobs.first(callback), units_.size());
      if (is_new) units_.emplace_back();
      units_[unit->second].members.push_back(callback);
      unit_of_[callback] = unit->second;
    }
    for (Unit &unit : units_) {
      std::stable_partition(unit.members.begin(), unit.members.end(), [&](std::size_t i) { return is_timer(i); });
      std::vector<std::string> names;
      for (const std::size_t member : unit.members) {
        const CallbackRecord &callback = callbacks_[member];
        unit.execution.merge(callback.publishing.execution);
        unit.response.merge(callback.publishing.response);
        if (unit.members.size() == 1) {
          unit.execution.merge(callback.quiet.execution);
          unit.response.merge(callback.quiet.response);
        }
        if (const Duration limit = limits[unit.members.front()]; limit > 0) {
          unit.execution.merge(longer_than(limit, callback.quiet.execution));
        }
        result_.explained += callback.executed;
        names.push_back(is_timer(member) ? "its timer" : callback.id.name);
      }
      const metrics::Distribution execution = unit.execution.distribution();
      unit.notes.push_back(fmt::format("wcet: the longest of {}; median {}, 99 % within {}",
                                       plural(execution.count, "run"), humanize_duration(execution.p50),
                                       humanize_duration(execution.p99)));
      if (names.size() > 1)
        unit.notes.push_back(fmt::format("one job of {}: the last of a round does it", join(names)));
    }
  }

  // ---- edges ----

  /// Returns the unit whose every job sends the one message that this callback takes. Otherwise notes why there is
  /// none.
  std::optional<std::size_t> sender_of(const CallbackRecord &taker, std::vector<std::string> &notes) const {
    const std::string &topic = taker.id.name;
    std::map<std::size_t, Output> senders;
    bool others = recording_.is_sent_elsewhere(topic);
    if (const auto publishers = publishers_.find(topic); publishers != publishers_.end()) {
      for (const std::size_t i : publishers->second) {
        const auto unit = unit_of_.find(i);
        if (unit == unit_of_.end()) {
          others = true;
          continue;
        }
        senders[unit->second].runs += callbacks_[i].outputs.at(topic).runs;
        senders[unit->second].messages += callbacks_[i].outputs.at(topic).messages;
      }
    }
    if (senders.empty()) {
      notes.push_back(taker.takes_directly && !others
                          ? topic + " came from an unknown callback of this process: no event says who sent it"
                          : topic + " comes from outside of the callbacks of this process");
      return std::nullopt;
    }
    const auto &[unit, output] = *senders.begin();
    const std::string name = to_string(first_of(units_[unit]).id);
    std::string why;
    if (senders.size() > 1 || others) {
      why = fmt::format("{} has several publishers, {} among them: each message is one job", topic, name);
    } else if (const std::uint64_t runs = units_[unit].execution.size();
               !is_at_least(output.runs, kAll, runs) || !is_as_many(output.messages, output.runs)) {
      why = fmt::format("{} publishes {} {} times in {} runs: a rate of its own", name, topic, output.messages, runs);
    } else if (!is_as_many(taker.runs, output.messages)) {
      why = fmt::format("took {} of {} messages of {}", taker.runs, output.messages, name);
      if (is_at_least(taker.runs, kMost, output.messages)) {
        notes.push_back(why);
        return unit;
      }
    } else {
      return unit;
    }
    notes.push_back(why);
    return std::nullopt;
  }

  void find_predecessors(std::size_t position) {
    Unit &unit = units_[position];
    std::size_t known = 0;
    std::size_t inputs = 0;
    for (const std::size_t member : unit.members) {
      if (callbacks_[member].id.kind != CallbackKind::Subscription) continue;
      ++inputs;
      const std::optional<std::size_t> sender = sender_of(callbacks_[member], unit.notes);
      if (!sender || *sender == position) continue;
      ++known;
      if (std::find(unit.predecessors.begin(), unit.predecessors.end(), *sender) == unit.predecessors.end()) {
        unit.predecessors.push_back(*sender);
      }
    }
    if (known > 0 && known < inputs) unit.notes.emplace_back("unknown to the model: that it waits for the others, too");
  }

  void open_circles() {
    std::vector<bool> done(units_.size(), false);
    for (std::size_t left = units_.size(); left > 0;) {
      const std::size_t before = left;
      std::optional<std::size_t> earliest;
      for (std::size_t i = 0; i < units_.size(); ++i) {
        if (done[i]) continue;
        const Positions &from = units_[i].predecessors;
        if (std::all_of(from.begin(), from.end(), [&](std::size_t p) { return bool{done[p]}; })) {
          done[i] = true;
          --left;
        } else if (!earliest || first_of(units_[i]).first_start < first_of(units_[*earliest]).first_start) {
          earliest = i;
        }
      }
      if (left != before || !earliest) continue;
      units_[*earliest].predecessors.clear();
      units_[*earliest].notes.emplace_back("its messages come around in a circle, which begins here in the model");
    }
  }

  // ---- tasks ----

  static std::string unique(const std::string &wanted, std::set<std::string> &taken) {
    std::string name = wanted;
    for (int n = 2; !taken.insert(name).second; ++n) name = fmt::format("{}_{}", wanted, n);
    return name;
  }

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
      dag.name = unique(first_of(units_[source]).id.node.substr(1), names);
      dag.edges = Edges::Seen;
      for (const std::size_t i : members) {
        Task task = make_task(units_[i]);
        task.name = unique(task.name, names);
        for (const std::size_t p : units_[i].predecessors) {
          const auto at = std::find(members.begin(), members.end(), p) - members.begin();
          task.predecessors.push_back(static_cast<std::uint32_t>(at));
        }
        if (task.concurrency == 1) task.group = group_of(i, groups[first_of(units_[i]).id.node]);
        const CallbackRecord &callback = first_of(units_[i]);
        const Time begin = callback.id.period > 0 ? callback.created : callback.begun.front();
        result_.phases.push_back(task.activation == Activation::Data ? 0 : (begin - recording_.first()) % task.period);
        result_.responses.push_back(units_[i].response.distribution());
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
  std::string group_of(std::size_t unit, std::vector<Positions> &groups) const {
    const std::string &node = first_of(units_[unit]).id.node;
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
    if (some) {
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
    std::uint64_t seen = 0;
    for (const metrics::CountedDurations &range : process_.delays.counted()) {
      seen += range.count;
      result_.overhead = range.low;
      if (seen * 10 >= process_.delays.size()) break;  // a tenth of the runs found an idle thread
    }
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
      remark(
          fmt::format("A tenth of the runs began within {} of their release: what the executor takes "
                      "(--overhead-dispatch).",
                      humanize_duration(result_.overhead)));
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
  std::uint32_t pid_;
  const ProcessRecord &process_;
  std::map<std::string, Positions> publishers_;  // of topics: callbacks
  std::vector<Unit> units_;
  std::map<std::size_t, std::size_t> unit_of_;
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

}  // namespace redag::lab
