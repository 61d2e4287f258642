// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/units.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "redag/base/text.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::lab {

bool is_at_least(std::uint64_t count, double share, std::uint64_t whole) {
  constexpr double kEdges = 2;  // runs or messages that begin and end of a recording cut off
  return static_cast<double>(count) + kEdges >= share * static_cast<double>(whole);
}

bool is_as_many(std::uint64_t a, std::uint64_t b) { return is_at_least(a, kAll, b) && is_at_least(b, kAll, a); }

namespace {

using CallbackKind = Callback::Kind;

class FindingUnits {
 public:
  FindingUnits(const Recording &recording, std::uint32_t pid)
      : callbacks_(recording.callbacks()), end_(recording.last()), pid_(pid) {}

  Units run() {
    make_units(usable_callbacks());
    return std::move(result_);
  }

 private:
  [[nodiscard]] bool is_timer(std::size_t callback) const {
    return callbacks_[callback].id.kind == CallbackKind::Timer;
  }

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
      const bool is_slow = is_timer(i) && callback.id.period > (end_ - callback.created) / 10;
      std::string why;
      if (callback.id.node.empty()) {
        why = "its node is unknown: the recording began later";
      } else if (callback.quiet.size() + callback.publishing.size() == 0) {
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
      const metrics::Distribution execution = callbacks_[member].quiet.distribution();
      shortest = std::min(shortest, std::max<Duration>(execution.min, 1));
      longest = std::max(longest, execution.max);
      rounds = std::min(rounds, execution.count);
    }
    const auto limit = static_cast<Duration>(std::sqrt(static_cast<double>(shortest) * static_cast<double>(longest)));
    std::uint64_t work = 0;
    std::size_t changing = 0;
    for (const std::size_t member : members) {
      const std::uint64_t runs = callbacks_[member].quiet.size();
      const std::uint64_t long_runs = longer_than(limit, callbacks_[member].quiet).size();
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
      const auto [unit, is_new] = units.try_emplace(jobs.first(callback), result_.units.size());
      if (is_new) result_.units.emplace_back();
      result_.units[unit->second].members.push_back(callback);
    }
    for (Unit &unit : result_.units) {
      std::stable_partition(unit.members.begin(), unit.members.end(), [&](std::size_t i) { return is_timer(i); });
      std::vector<std::string> names;
      for (const std::size_t member : unit.members) {
        const CallbackRecord &callback = callbacks_[member];
        unit.execution.merge(callback.publishing);
        if (unit.members.size() == 1) unit.execution.merge(callback.quiet);
        const Duration limit = limits[unit.members.front()];
        if (limit > 0) unit.execution.merge(longer_than(limit, callback.quiet));
        const Duration period = callback.id.period;
        const Time grid = period > 0 ? grid_of(callback) : 0;
        for (EndedRun run : callback.ended) {
          if (unit.members.size() > 1 && !run.publishes && (limit == 0 || run.execution <= limit)) continue;
          if (period > 0) run.released = last_expiry(grid, period, run.start, most_early(period));
          unit.runs.push_back(run);
        }
        result_.explained += callback.executed;
        names.push_back(is_timer(member) ? "its timer" : callback.id.name);
      }
      std::sort(unit.runs.begin(), unit.runs.end(),
                [](const EndedRun &a, const EndedRun &b) { return a.start < b.start; });
      const metrics::Distribution execution = unit.execution.distribution();
      unit.notes.push_back(fmt::format("wcet: the longest of {}; median {}, 99 % within {}",
                                       plural(execution.count, "run"), humanize_duration(execution.p50),
                                       humanize_duration(execution.p99)));
      if (names.size() > 1)
        unit.notes.push_back(fmt::format("one job of {}: the last of a round does it", join(names)));
    }
  }
  const std::vector<CallbackRecord> &callbacks_;
  Time end_;
  std::uint32_t pid_;
  Units result_;
};

}  // namespace

Units find_units(const Recording &recording, std::uint32_t process) { return FindingUnits(recording, process).run(); }

}  // namespace redag::lab
