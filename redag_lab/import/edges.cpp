// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "redag_lab/import/units.hpp"

namespace redag::lab {
namespace {

using CallbackKind = Callback::Kind;
using Output = CallbackRecord::Output;

constexpr double kMost = 0.5;  // a message that is overwritten is not taken

class FindingEdges {
 public:
  FindingEdges(const Recording &recording, std::vector<Unit> &units)
      : callbacks_(recording.callbacks()), recording_(recording), units_(units) {
    for (std::size_t unit = 0; unit < units.size(); ++unit) {
      for (const std::size_t member : units[unit].members) unit_of_[member] = unit;
    }
    for (std::size_t i = 0; i < callbacks_.size(); ++i) {
      for (const auto &[topic, output] : callbacks_[i].outputs) publishers_[topic].push_back(i);
    }
  }

  void run() {
    for (std::size_t unit = 0; unit < units_.size(); ++unit) find_predecessors(unit);
    open_circles();
  }

 private:
  [[nodiscard]] const CallbackRecord &first_of(const Unit &unit) const { return callbacks_[unit.members.front()]; }

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
  const std::vector<CallbackRecord> &callbacks_;
  const Recording &recording_;
  std::vector<Unit> &units_;
  std::map<std::string, Positions> publishers_;  // of topics: callbacks
  std::map<std::size_t, std::size_t> unit_of_;   // callbacks
};

}  // namespace

void find_edges(const Recording &recording, std::vector<Unit> &units) { FindingEdges(recording, units).run(); }

}  // namespace redag::lab
