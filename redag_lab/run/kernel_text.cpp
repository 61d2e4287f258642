// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/kernel_text.hpp"

#include <algorithm>
#include <charconv>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>

namespace redag::lab {
namespace {

std::optional<std::int64_t> number(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end == text.data()) return std::nullopt;
  return value;
}

// The text between the last `name` and the next space; empty if there is none. Names of threads can hold anything, and
// stand before the numbers.
std::string_view field(std::string_view fields, std::string_view name) {
  const std::size_t at = fields.rfind(name);
  if (at == std::string_view::npos) return {};
  fields.remove_prefix(at + name.size());
  return fields.substr(0, fields.find(' '));
}

// "1234.567890" in nanoseconds.
std::optional<Time> time_of(std::string_view text) {
  const std::size_t point = text.find('.');
  if (point == std::string_view::npos || text.size() - point != 7) return std::nullopt;
  const auto seconds = number(text.substr(0, point));
  const auto micro = number(text.substr(point + 1));
  if (!seconds || !micro || *seconds < 0 || *seconds > kMaxDuration / kSecond - 1) return std::nullopt;
  return *seconds * kSecond + *micro * kMicrosecond;
}

// The name of an interrupt: "virtio0" of "irq=25 name=virtio0", "TIMER" of "vec=1 [action=TIMER]".
std::string name_of(std::string_view fields, bool soft) {
  std::string name(soft ? field(fields, "[action=") : fields.substr(std::min(fields.size(), fields.find("name=") + 5)));
  if (soft && !name.empty() && name.back() == ']') name.pop_back();
  return soft ? "softirq " + name : name;
}

}  // namespace

void KernelText::add(std::string_view text) {
  rest_ += text;
  std::size_t begin = 0;
  for (std::size_t end = rest_.find('\n'); end != std::string::npos; end = rest_.find('\n', begin)) {
    read(std::string_view(rest_).substr(begin, end - begin));
    begin = end + 1;
  }
  rest_.erase(0, begin);
}

// A line such as "  redag-0-77  [001] d..2.  12.345678: sched_switch: prev_comm=... ==> next_comm=...".
void KernelText::read(std::string_view line) {
  if (const std::size_t lost = line.find("[LOST "); line.rfind("CPU:", 0) == 0 && lost != std::string_view::npos) {
    lost_ += static_cast<std::uint64_t>(number(line.substr(lost + 6)).value_or(0));
    return;
  }
  constexpr std::string_view kEvents[] = {
      ": sched_switch: ", ": irq_handler_entry: ", ": irq_handler_exit: ", ": softirq_entry: ", ": softirq_exit: "};
  for (std::size_t kind = 0; kind < std::size(kEvents); ++kind) {
    const std::size_t at = line.find(kEvents[kind]);
    if (at == std::string_view::npos) continue;
    const std::string_view head = line.substr(0, at);
    const std::size_t blank = head.rfind(' ');
    const std::size_t bracket = head.rfind('[');
    if (blank == std::string_view::npos || bracket == std::string_view::npos) return;
    const std::optional<Time> time = time_of(head.substr(blank + 1));
    const std::optional<std::int64_t> cpu = number(head.substr(bracket + 1));
    if (!time || !cpu) return;
    const std::string_view fields = line.substr(at + kEvents[kind].size());
    if (kind == 0) return read_switch(*time, static_cast<int>(*cpu), fields);
    const bool soft = kind >= 3;
    const std::pair key(static_cast<int>(*cpu), soft);
    if (kind == 1 || kind == 3) {
      open_[key] = {*time, *time, key.first, name_of(fields, soft)};
    } else if (const auto begun = open_.find(key); begun != open_.end()) {
      begun->second.end = *time;
      events_.emplace_back(begun->second);
      open_.erase(begun);
    }
    return;
  }
}

void KernelText::read_switch(Time time, int cpu, std::string_view fields) {
  const std::size_t arrow = fields.rfind(" ==> next_comm=");
  if (arrow == std::string_view::npos) return;
  const std::string_view previous = fields.substr(0, arrow);
  const std::string_view next = fields.substr(arrow + 15);
  const auto from = number(field(previous, " prev_pid="));
  const auto to = number(field(next, " next_pid="));
  const auto priority = number(field(next, " next_prio="));
  const std::string_view state = field(previous, " prev_state=");
  if (!from || !to || !priority || state.empty()) return;
  const int next_thread = static_cast<int>(*to);
  events_.emplace_back(metrics::KernelSwitch{.time = time,
                                             .cpu = cpu,
                                             .from = static_cast<int>(*from),
                                             .runnable = state.front() == 'R',
                                             .to = next_thread,
                                             .to_priority = static_cast<int>(*priority)});
  if (next_thread == 0) return;
  std::string name(next.substr(0, next.rfind(" next_pid=")));
  std::string &known = names_[next_thread];
  if (known == name) return;
  known = std::move(name);
  named_.emplace_back(metrics::KernelThread{next_thread, known, 0});
}

std::vector<metrics::KernelRow> KernelText::take(Time until) {
  const auto at = [](const metrics::KernelRow &row) { return *metrics::time_of(row); };
  // Keeps the order of what one processor did in one microsecond.
  std::stable_sort(events_.begin(), events_.end(), [&](const auto &a, const auto &b) { return at(a) < at(b); });
  const auto begin =
      std::find_if(events_.begin(), events_.end(), [&](const auto &row) { return at(row) >= taken_until_; });
  const auto end = std::find_if(begin, events_.end(), [&](const auto &row) { return at(row) >= until; });
  lost_ += static_cast<std::uint64_t>(begin - events_.begin());
  std::vector<metrics::KernelRow> rows = std::exchange(named_, {});
  if (lost_ > 0) rows.emplace_back(metrics::KernelLoss{std::exchange(lost_, 0)});
  rows.insert(rows.end(), std::make_move_iterator(begin), std::make_move_iterator(end));
  events_.erase(events_.begin(), end);
  taken_until_ = until;
  return rows;
}

}  // namespace redag::lab
