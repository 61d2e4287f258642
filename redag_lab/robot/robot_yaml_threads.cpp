// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot_yaml_reader.hpp"

#include <fmt/format.h>

namespace redag::robot {
namespace {

constexpr int kMostFifo = 99;
constexpr int kLeastNice = -20;
constexpr int kMostNice = 19;
constexpr std::uint32_t kMostThreads = 256;
// What Linux allows, and its coarsest tick.
constexpr Duration kLeastBudget = 1024;
constexpr Duration kLeastReserved = 100 * kMicrosecond;
constexpr Duration kMostReserved = 4 * kSecond;
constexpr Duration kCoarsestTick = 10 * kMillisecond;

using yaml::find;

}  // namespace

void ThreadsReader::read_threads(const Node &node) {
  Threads threads;
  threads.place = place_of(node);
  if (!check_map(node, "an entry of threads", {"name", "match", "level", "cpus", "count", "wcet", "period"}) ||
      !take_name(node, "an entry of threads", names_of_threads_, robot_.threads.size(), threads.name)) {
    return;
  }
  if (const Node *match = find(node, "match")) {
    read_match(*match, threads.match, &threads);
  } else {
    error(node, fmt::format("threads '{}' have no match", threads.name),
          "add 'match: {thread: NAME}' or 'match: {process: PROCESS, thread: NAME}'");
  }
  if (const Node *level = find(node, "level")) threads.level = read_level(*level);
  if (const Node *cpus_node = find(node, "cpus")) threads.cpus = read_cpus(*cpus_node);
  if (find(node, "level") == nullptr && find(node, "cpus") == nullptr) {
    error(node, fmt::format("threads '{}' have neither a level nor cpus", threads.name),
          "add 'level:' or 'cpus:', or remove the entry");
  }
  take(node, "count", threads.count,
       [this](const Node &value, auto key) { return integer<std::uint32_t>(value, key, 1, kMostThreads); });
  take(node, "wcet", threads.wcet, [this](const Node &value, auto key) { return positive_duration(value, key); });
  take(node, "period", threads.period, [this](const Node &value, auto key) { return positive_duration(value, key); });
  check_load(node, threads);
  if (threads.level && threads.level->kind == Level::Kind::Reservation && find(node, "cpus") != nullptr) {
    error(*find(node, "cpus"),
          fmt::format("threads '{}' have a reservation, which is for all processors", threads.name), "remove 'cpus:'");
  }
  robot_.threads.push_back(std::move(threads));
}

void ThreadsReader::check_load(const Node &node, Threads &threads) {
  const Node *wcet = find(node, "wcet");
  const Node *period = find(node, "period");
  const bool of_rate = threads.level && threads.level->kind == Level::Kind::Rate;
  if (of_rate && period != nullptr) {
    error(*period, fmt::format("threads '{}' have both a period and a rate", threads.name),
          "remove 'period:'; the rate is their period");
  }
  if (of_rate) threads.period = threads.level->rate;
  if (threads.level && threads.level->kind == Level::Kind::Reservation) {
    if (wcet == nullptr && period == nullptr) return;
    error(wcet != nullptr ? *wcet : *period,
          fmt::format("threads '{}' have a reservation, which says how long they delay tasks", threads.name),
          "remove 'wcet:' and 'period:'");
    return;
  }
  if (threads.level && !threads.level->interferes() && (wcet != nullptr || period != nullptr)) {
    error(wcet != nullptr ? *wcet : *period,
          fmt::format("threads '{}' delay no task at this level, and need no wcet or period", threads.name),
          "remove 'wcet:' and 'period:'");
  } else if (wcet != nullptr && period == nullptr && !of_rate) {
    error(*wcet, fmt::format("threads '{}' have a wcet, but no period", threads.name), "add 'period:'");
  } else if (wcet == nullptr && period != nullptr) {
    error(*period, fmt::format("threads '{}' have a period, but no wcet", threads.name), "add 'wcet:'");
  }
  if (threads.wcet > 0 && threads.period > 0 && threads.wcet > threads.period) {
    error(*wcet, fmt::format("wcet {} of threads '{}' exceeds their period {}", format_duration(threads.wcet),
                             threads.name, format_duration(threads.period)));
  }
}

std::optional<Level> ThreadsReader::read_level(const Node &node) {
  Level level;
  if (node.kind == Node::Kind::Scalar && (node.text == "above" || node.text == "below")) {
    level.kind = node.text == "above" ? Level::Kind::Above : Level::Kind::Below;
    return level;
  }
  if (node.kind != Node::Kind::Map) {
    unknown_choice(node, "level",
                   {"above", "below", "{task: PROCESS.DAG.TASK}", "{rate: PERIOD}", "{fifo: PRIORITY}", "{nice: NICE}",
                    "{reservation: {budget: TIME, period: TIME}}"});
    return std::nullopt;
  }
  if (!check_map(node, "level", {"task", "rate", "fifo", "nice", "reservation"})) return std::nullopt;
  if (node.children.size() != 2) {
    error(node, "level must have one of task, rate, fifo, nice and reservation");
    return std::nullopt;
  }
  const Node &value = node.children[1];
  bool is_read = false;
  if (find(node, "task") != nullptr) {
    level.kind = Level::Kind::Task;
    return take(node, "task", level.task, [this](const Node &at, auto key) { return read_task(at, key); })
               ? std::optional(level)
               : std::nullopt;
  }
  if (find(node, "reservation") != nullptr) {
    level.kind = Level::Kind::Reservation;
    is_read = read_reservation(value, level.reservation);
  } else if (find(node, "rate") != nullptr) {
    level.kind = Level::Kind::Rate;
    is_read = take(node, "rate", level.rate, [this](const Node &at, auto key) {
      return parse_rate(at.text) ? rate(at, key) : positive_duration(at, key);
    });
    if (robot_.policy == PolicyKind::Fixed) {
      error(value, "a rate has no place in an order by policy fixed", "use task, above, below or fifo");
      is_read = false;
    }
  } else {
    const bool fifo = find(node, "fifo") != nullptr;
    level.kind = fifo ? Level::Kind::Fifo : Level::Kind::Nice;
    is_read = take(node, fifo ? "fifo" : "nice", level.value, [&](const Node &at, auto key) {
      return integer<int>(at, key, fifo ? 1 : kLeastNice, fifo ? kMostFifo : kMostNice);
    });
  }
  return is_read ? std::optional(level) : std::nullopt;
}

bool ThreadsReader::read_reservation(const Node &node, Reservation &out) {
  if (!check_map(node, "reservation", {"budget", "period", "tick"})) return false;
  for (const char *key : {"budget", "period"}) {
    if (find(node, key) != nullptr) continue;
    error(node, fmt::format("the reservation has no '{}'", key), "write {budget: 2ms, period: 10ms}");
    return false;
  }
  const auto time = [this](const Node &at, auto key) { return positive_duration(at, key); };
  out.tick = kCoarsestTick;
  if (!take(node, "budget", out.budget, time) || !take(node, "period", out.period, time)) return false;
  if (find(node, "tick") != nullptr && !take(node, "tick", out.tick, time)) return false;
  const auto refuse_unless = [&](bool is_sound, const char *key, std::string message) {
    if (!is_sound) error(*find(node, key), std::move(message));
    return is_sound;
  };
  return refuse_unless(out.period >= kLeastReserved && out.period <= kMostReserved, "period",
                       fmt::format("the period of a reservation must be between {} and {}",
                                   format_duration(kLeastReserved), format_duration(kMostReserved))) &&
         refuse_unless(out.budget >= kLeastBudget && out.budget <= out.period, "budget",
                       fmt::format("the budget of a reservation must be between {} and its period {}",
                                   format_duration(kLeastBudget), format_duration(out.period))) &&
         refuse_unless(
             out.tick <= kCoarsestTick, "tick",
             fmt::format("the tick is at most {}, as no kernel has a longer one", format_duration(kCoarsestTick)));
}

void ThreadsReader::read_interrupts(const Node &node) {
  Interrupts interrupts;
  interrupts.place = place_of(node);
  if (!check_map(node, "an entry of irqs", {"name", "match", "cpus"}) ||
      !take_name(node, "an entry of irqs", names_of_interrupts_, robot_.interrupts.size(), interrupts.name)) {
    return;
  }
  if (find(node, "match") == nullptr) {
    error(node, fmt::format("irqs '{}' have no match", interrupts.name),
          "add 'match:' with a name from /proc/interrupts");
  }
  take_text(node, "match", interrupts.match);
  if (const Node *cpus_node = find(node, "cpus")) {
    interrupts.cpus = read_cpus(*cpus_node);
  } else {
    error(node, fmt::format("irqs '{}' have no cpus", interrupts.name), "add 'cpus:'");
  }
  robot_.interrupts.push_back(std::move(interrupts));
}

}  // namespace redag::robot
