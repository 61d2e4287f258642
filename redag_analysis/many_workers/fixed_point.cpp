// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/fixed_point.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "redag_analysis/core/effort.hpp"

namespace redag::analysis::global {
namespace {

constexpr int kMaxRounds = 1000;  // of all values together; ordinary task sets need about ten

}  // namespace

std::string_view agree(std::span<Duration *const> values, std::string_view exceeds,
                       const std::function<bool(std::size_t)> &evaluate) {
  bool changed = true;
  for (int round = 0; changed; ++round) {
    if (round == kMaxRounds) return "gave up: the response times did not converge in a thousand rounds";
    changed = false;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const Duration before = *values[k];
      if (!evaluate(k)) return exceeds;
      changed = changed || *values[k] != before;
    }
  }
  return {};
}

namespace {

// Calls f with units[k] as the last of its peers.
template <class F>
auto as_last(std::vector<GlobalUnit> &units, Peers peers, std::size_t k, F f) {
  std::swap(units[k], units[peers.end - 1]);
  auto result = f(peers.end - 1);
  std::swap(units[k], units[peers.end - 1]);
  return result;
}

}  // namespace

std::function<void(GlobalUnit &, const Part *)> narrows_to_part(const TaskSet &task_set) {
  return [&task_set](GlobalUnit &unit, const Part *part) {
    if (part != nullptr) narrow(task_set, *part, unit);
  };
}

Bound from_most_urgent(const TaskSet &task_set, std::vector<GlobalUnit> &units,
                       const std::function<void(GlobalUnit &)> &start,
                       const std::function<bool(std::size_t, bool)> &respond,
                       const std::function<ResponseBound(std::size_t)> &explain,
                       const std::function<void(GlobalUnit &, const Part *)> &narrow, bool overlap) {
  std::vector<ResponseBound> responses(task_set.units.size());
  std::vector<std::pair<std::uint32_t, ResponseBound>> parts;  // by task
  // Bounds the tasks of the unit at this position. It is bounded, so its instances do not overlap, and a task waits
  // only for what does not follow it.
  const auto bound_parts = [&](std::size_t k, bool alone) {
    const GlobalUnit whole = units[k];
    for (const std::uint32_t t : task_set.units[whole.unit].tasks) {
      const Part part = part_until(task_set, t);
      if (narrow == nullptr || part.paths.size() == whole.tasks) continue;
      narrow(units[k], &part);
      start(units[k]);
      if (respond(k, alone) && units[k].response < whole.response) parts.emplace_back(t, explain(k));
      units[k] = whole;
    }
    if (narrow != nullptr) narrow(units[k], nullptr);
    units[k] = whole;
  };
  bool known = true;
  Peers peers;
  for (; peers.begin < units.size(); peers.begin = peers.end) {
    Effort::reached(peers.begin, units.size());
    peers.end = peers_of(task_set, units, peers.begin).end;
    const bool alone = peers.end == peers.begin + 1;
    std::vector<Duration *> values;
    for (std::size_t k = peers.begin; k < peers.end && known && !alone; ++k) {
      start(units[k]);
      values.push_back(&units[k].response);
    }
    std::size_t culprit = peers.begin;
    const auto evaluate = [&](std::size_t i) {
      culprit = peers.begin + i;
      return as_last(units, peers, culprit, [&](std::size_t k) { return respond(k, false); });
    };
    const bool was_known = known;
    for (std::size_t k = peers.begin; k < peers.end && known && !alone; ++k) {
      known = units[k].response <= units[k].limit;
      if (!known) culprit = k;
    }
    if (known) known = alone ? respond(peers.begin, true) : agree(values, kNoFixedPoint, evaluate).empty();
    for (std::size_t k = peers.begin; k < peers.end; ++k) {
      ResponseBound &response = responses[units[k].unit];
      if (!known) {
        response.absent = !was_known ? kMoreUrgent : k == culprit ? kNoFixedPoint : kPeer;
        continue;
      }
      response = as_last(units, peers, k, [&](std::size_t last) {
        if (!alone && Effort::itemises(units[last].unit)) (void)respond(last, false);  // sets what explain() looks at
        ResponseBound whole = explain(last);
        if (units[last].tasks > 1) bound_parts(last, alone);
        return whole;
      });
    }
    if (known || !overlap) continue;
    known = std::all_of(units.begin() + static_cast<std::ptrdiff_t>(peers.begin),
                        units.begin() + static_cast<std::ptrdiff_t>(peers.end),
                        [&](GlobalUnit &unit) { return assume_overlap(task_set, unit); });
  }
  Bound bound = from_units(task_set, std::move(responses));
  for (auto &[task, part] : parts) bound.tasks[task] = if_bounded(std::move(part));
  return bound;
}

Bound all_that_agree(const TaskSet &task_set, std::vector<GlobalUnit> &units, std::string_view exceeds,
                     const std::function<bool(std::size_t)> &respond,
                     const std::function<ResponseBound(std::size_t)> &explain) {
  std::vector<Duration *> values;
  values.reserve(units.size());
  for (GlobalUnit &unit : units) values.push_back(&unit.response);
  const std::string_view absent =
      is_any_hopeless(units, task_set.platform.workers) ? exceeds : agree(values, exceeds, respond);
  std::vector<ResponseBound> responses(task_set.units.size());
  for (std::size_t k = 0; k < units.size(); ++k) {
    ResponseBound &response = responses[units[k].unit];
    if (absent.empty()) {
      response = explain(k);
    } else {
      response.absent = absent;
    }
  }
  return from_units(task_set, std::move(responses));
}

}  // namespace redag::analysis::global
