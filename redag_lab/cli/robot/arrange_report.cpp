// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/robot/arrange_report.hpp"

#include <fmt/format.h>

#include "redag/base/cpu_list.hpp"
#include "redag/base/text.hpp"
#include "redag/base/time.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

const char *key_name(PolicyKind policy) {
  switch (policy) {
    case PolicyKind::DeadlineMonotonic: return "deadline";
    case PolicyKind::Fixed: return "given";
    default: return "period";
  }
}

std::string key_text(PolicyKind policy, std::int64_t key) {
  return policy == PolicyKind::Fixed ? std::to_string(key) : format_duration(key);
}

// By the bounds: with the tests that decided.
std::string order_name(const robot::Robot &robot) {
  if (!robot.assigned) return policy_name(robot);
  return fmt::format("{} ({})", policy_name(robot), fmt::join(robot.assigned->tests, "; "));
}

std::string state_text(const robot::ThreadState &state, const robot::ThreadState &other) {
  std::string text = to_string(state.scheduling);
  if (state.cpus != other.cpus) text += " on " + format_cpu_list(state.cpus);
  return text;
}

Json state_json(const robot::ThreadState &state) {
  return Json{{"scheduling", to_string(state.scheduling)}, {"cpus", state.cpus}};
}

}  // namespace

std::string describe(const robot::Robot &robot, const robot::Plan &plan, const StreamTraits &terminal) {
  const robot::Order &order = plan.order;
  std::string text =
      fmt::format("{}: one order by {}", tinted(robot.name, Tint::Strong, terminal.colour), order_name(robot));
  if (plan.levels.empty()) return text + ", without tasks\n";
  text += fmt::format(", SCHED_FIFO {} to {}\n", plan.levels.front().priority, plan.levels.back().priority);
  text +=
      fmt::format("timers of executors: {} with the most urgent task, else just above their own\n", plan.band.timer);
  if (order.is_merged()) {
    text += fmt::format(
        "{} of {} {} share a level with others, because there are {} levels: they do not preempt each other\n",
        order.ranks - order.levels + 1, order.ranks, robot.by_bounds ? "places" : "rates", order.levels);
  }
  Table table({{.title = "priority", .number = true, .importance = 3},
               {.title = key_name(robot.policy), .number = true, .importance = 2},
               {.title = "who", .importance = 3, .prose = true}});
  for (const robot::PlannedLevel &level : plan.levels) {
    const std::string first = key_text(robot.policy, level.first);
    table.add({{std::to_string(level.priority)},
               {level.first == level.last ? first : first + " - " + key_text(robot.policy, level.last)},
               {fmt::format("{}", fmt::join(level.members, ", "))}});
  }
  text += "\n" + table.render(terminal.width, terminal.colour);
  std::string executors;
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    if (plan.of_executor[p].empty()) continue;
    executors += fmt::format("start '{}' with {}={}\n", robot.processes[p].name, runtime::kLevelsVariable,
                             robot::levels_text(plan.of_executor[p]));
  }
  return text + (executors.empty() ? "" : "\n") + executors;
}

std::string describe(const robot::Changes &changes, const StreamTraits &terminal) {
  if (changes.matched == 0 && changes.is_empty()) return "\nno thread that the robot names runs now\n";
  if (changes.is_empty()) return fmt::format("\nall {} threads that the robot names are as planned\n", changes.matched);
  std::string text = "\n";
  if (!changes.threads.empty()) {
    Table table({{.title = "thread", .importance = 3},
                 {.title = "number", .number = true, .importance = 2},
                 {.title = "program", .importance = 1},
                 {.title = "entry", .importance = 1},
                 {.title = "is", .importance = 2},
                 {.title = "becomes", .importance = 3}});
    for (const robot::ThreadChange &change : changes.threads) {
      table.add({{printable(change.name)},
                 {std::to_string(change.thread.tid)},
                 {printable(change.program)},
                 {change.entry},
                 {state_text(change.before, change.after)},
                 {state_text(change.after, change.before), Tint::Caution}});
    }
    text += table.render(terminal.width, terminal.colour);
  }
  for (const robot::InterruptChange &change : changes.interrupts) {
    text += fmt::format("interrupt {} ({}) moves from processors {} to {}\n", change.number, printable(change.name),
                        format_cpu_list(change.before), format_cpu_list(change.after));
  }
  return text;
}

Json to_json(const robot::Robot &robot, const robot::Plan &plan, const robot::Changes &changes) {
  const bool fixed = robot.policy == PolicyKind::Fixed;
  Json document = {{"format", "redag.arrange/1"},      {"robot", robot.name},
                   {"policy", policy_name(robot)},     {"timer_priority", plan.band.timer},
                   {"merged", plan.order.is_merged()}, {"levels", Json::array()},
                   {"executors", Json::object()},      {"threads", Json::array()},
                   {"interrupts", Json::array()},      {"matched_threads", changes.matched},
                   {"remarks", changes.remarks}};
  if (robot.assigned) document["search"] = Json{{"tests", robot.assigned->tests}, {"found", robot.assigned->found}};
  for (const robot::PlannedLevel &level : plan.levels) {
    document["levels"].push_back(Json{{"priority", level.priority},
                                      {fixed ? "first" : "first_ns", level.first},
                                      {fixed ? "last" : "last_ns", level.last},
                                      {"members", level.members}});
  }
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    if (!plan.of_executor[p].empty()) document["executors"][robot.processes[p].name] = plan.of_executor[p];
  }
  for (const robot::ThreadChange &change : changes.threads) {
    document["threads"].push_back(Json{{"pid", change.thread.pid},
                                       {"tid", change.thread.tid},
                                       {"name", change.name},
                                       {"program", change.program},
                                       {"entry", change.entry},
                                       {"is", state_json(change.before)},
                                       {"becomes", state_json(change.after)}});
  }
  for (const robot::InterruptChange &change : changes.interrupts) {
    document["interrupts"].push_back(
        Json{{"number", change.number}, {"name", change.name}, {"is", change.before}, {"becomes", change.after}});
  }
  return document;
}

}  // namespace redag::cli
