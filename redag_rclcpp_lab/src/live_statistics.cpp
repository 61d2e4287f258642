// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "live_statistics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "redag/live/rates.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::Duration;
using redag::live::DagFrame;
using redag::live::DeviceFrame;
using redag::live::Frame;
using redag::live::Listed;
using redag::live::TaskFrame;
using redag::live::ThreadFrame;
using redag::live::page::Figures;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();  // the row has no such figure

double seconds(Duration time) { return static_cast<double>(time) / static_cast<double>(redag::kSecond); }
double stated(Duration time) { return time > 0 ? seconds(time) : kNone; }
double count(std::uint64_t number) { return static_cast<double>(number); }

/// A figure of a row.
template <class Row>
struct Column {
  const char *name;
  double (*value)(const Row &row, const Frame &frame);
};

constexpr std::array kFigures = {
    Column<Figures>{"rate", [](const Figures &f, const Frame &frame) { return rate_of(f, frame, false); }},
    Column<Figures>{"cpu", [](const Figures &f, const Frame &frame) { return cpu_of(f, frame, false); }},
    Column<Figures>{"released", [](const Figures &f, const Frame &) { return count(f.released); }},
    Column<Figures>{"finished", [](const Figures &f, const Frame &) { return count(f.finished); }},
    Column<Figures>{"skipped", [](const Figures &f, const Frame &) { return count(f.skipped); }},
    Column<Figures>{"aborted", [](const Figures &f, const Frame &) { return count(f.aborted); }},
    Column<Figures>{"misses", [](const Figures &f, const Frame &) { return count(f.misses); }},
    Column<Figures>{"deferred", [](const Figures &f, const Frame &) { return count(f.deferred); }},
    Column<Figures>{"preemptions", [](const Figures &f, const Frame &) { return count(f.preemptions); }},
    Column<Figures>{"cpu_time", [](const Figures &f, const Frame &) { return seconds(f.cpu); }},
    Column<Figures>{"response_p50", [](const Figures &f, const Frame &) { return seconds(f.response_p50); }},
    Column<Figures>{"response_p99", [](const Figures &f, const Frame &) { return seconds(f.response_p99); }},
    Column<Figures>{"response_max", [](const Figures &f, const Frame &) { return seconds(f.response_max); }},
    Column<Figures>{"recent_finished", [](const Figures &f, const Frame &) { return count(f.recent_jobs); }},
    Column<Figures>{"recent_misses", [](const Figures &f, const Frame &) { return count(f.recent_misses); }},
    Column<Figures>{"recent_preemptions", [](const Figures &f, const Frame &) { return count(f.recent_preemptions); }},
    Column<Figures>{"recent_cpu_time", [](const Figures &f, const Frame &) { return seconds(f.recent_cpu); }},
    Column<Figures>{"recent_response_p50", [](const Figures &f, const Frame &) { return seconds(f.recent_p50); }},
    Column<Figures>{"recent_response_p99", [](const Figures &f, const Frame &) { return seconds(f.recent_p99); }},
    Column<Figures>{"recent_response_max", [](const Figures &f, const Frame &) { return seconds(f.recent_max); }},
    Column<Figures>{"active", [](const Figures &f, const Frame &) { return count(f.active); }},
    Column<Figures>{"away", [](const Figures &f, const Frame &) { return count(f.away); }},
    Column<Figures>{"ready", [](const Figures &f, const Frame &) { return count(f.ready); }},
    Column<Figures>{"waiting", [](const Figures &f, const Frame &) { return count(f.waiting); }},
};

constexpr std::array kOfTasks = {
    Column<TaskFrame>{"period", [](const TaskFrame &t, const Frame &) { return stated(t.period); }},
    Column<TaskFrame>{"deadline", [](const TaskFrame &t, const Frame &) { return stated(t.deadline); }},
    Column<TaskFrame>{"bound", [](const TaskFrame &t, const Frame &) { return stated(t.bound); }},
    Column<TaskFrame>{"priority",
                      [](const TaskFrame &t, const Frame &) { return t.priority > 0 ? t.priority : kNone; }},
};

constexpr std::array kOfDags = {
    Column<DagFrame>{"max_active",
                     [](const DagFrame &d, const Frame &) { return d.max_active > 0 ? count(d.max_active) : kNone; }},
    Column<DagFrame>{"deadline", [](const DagFrame &d, const Frame &) { return stated(d.deadline); }},
    Column<DagFrame>{"late", [](const DagFrame &d, const Frame &) { return d.deadline > 0 ? count(d.late) : kNone; }},
    Column<DagFrame>{"recent_late",
                     [](const DagFrame &d, const Frame &) { return d.deadline > 0 ? count(d.recent_late) : kNone; }},
};

constexpr std::array kOfThreads = {
    Column<ThreadFrame>{"cpu", [](const ThreadFrame &t, const Frame &frame) { return share_of(t, frame, false); }},
    Column<ThreadFrame>{"cpu_time", [](const ThreadFrame &t, const Frame &) { return seconds(t.used); }},
};

constexpr std::array kOfDevices = {
    Column<DeviceFrame>{"slots", [](const DeviceFrame &d, const Frame &) { return count(d.slots); }},
    Column<DeviceFrame>{"used", [](const DeviceFrame &d, const Frame &) { return count(d.used); }},
    Column<DeviceFrame>{"queued", [](const DeviceFrame &d, const Frame &) { return count(d.queued); }},
    Column<DeviceFrame>{"busy", [](const DeviceFrame &d, const Frame &frame) { return share_of(d, frame, false); }},
    Column<DeviceFrame>{"rate", [](const DeviceFrame &d, const Frame &frame) { return rate_of(d, frame, false); }},
    Column<DeviceFrame>{"served", [](const DeviceFrame &d, const Frame &) { return count(d.served); }},
    Column<DeviceFrame>{"busy_time", [](const DeviceFrame &d, const Frame &) { return seconds(d.busy); }},
};

constexpr std::array kOfExecutors = {
    Column<Frame>{"workers", [](const Frame &frame, const Frame &) { return count(frame.workers); }},
    Column<Frame>{"uptime", [](const Frame &frame, const Frame &) { return seconds(frame.published - frame.began); }},
    Column<Frame>{"page_cpu_time", [](const Frame &frame, const Frame &) { return seconds(frame.publisher_cpu); }},
    Column<Frame>{"page_left_out", [](const Frame &frame, const Frame &) { return count(frame.left_out); }},
    Column<Frame>{"alert", [](const Frame &frame, const Frame &) { return frame.alert.empty() ? 0.0 : 1.0; }},
};

constexpr const char *kPageAge = "page_age";

std::string_view without_slashes(std::string_view text) {
  while (!text.empty() && text.front() == '/') text.remove_prefix(1);
  while (!text.empty() && text.back() == '/') text.remove_suffix(1);
  return text;
}

/// Returns the node and the rest of the name of a callback that no file names, such as "/imu timer 2 ms (0)"; otherwise
/// the name and "".
std::pair<std::string_view, std::string_view> parts_of(std::string_view task) {
  const std::size_t end = task.find(' ');
  if (task.empty() || task.front() != '/' || end == std::string_view::npos) return {task, {}};
  return {task.substr(0, end), task.substr(end + 1)};
}

template <class Columns>
void add_names(std::set<std::string, std::less<>> &names, const Columns &columns) {
  for (const auto &column : columns) names.insert(column.name);
}

}  // namespace

std::set<std::string, std::less<>> known_figures() {
  std::set<std::string, std::less<>> names{kPageAge};
  add_names(names, kFigures);
  add_names(names, kOfTasks);
  add_names(names, kOfDags);
  add_names(names, kOfThreads);
  add_names(names, kOfDevices);
  add_names(names, kOfExecutors);
  return names;
}

LiveStatistics::LiveStatistics(std::set<std::string, std::less<>> figures, std::uint32_t first_version,
                               std::size_t most)
    : figures_(std::move(figures)), most_(most), version_(first_version) {}

bool LiveStatistics::update(const std::vector<Listed> &pages, redag::Time now) {
  std::vector<const Listed *> readable;
  for (const Listed &listed : pages) {
    if (listed.page) readable.push_back(&listed);
  }
  std::stable_sort(readable.begin(), readable.end(),
                   [](const Listed *a, const Listed *b) { return a->page->frame.began < b->page->frame.began; });
  name_executors(readable);
  const bool is_first = names_.empty();
  has_changed_ = false;
  left_out_ = 0;
  values_.clear();
  prefixes_.clear();
  for (const Listed *listed : readable) add_executor(*listed, now);
  // These stand in every message, whatever is selected and left out.
  put({}, "executors", count(readable.size()));
  put({}, "unreadable_pages", count(pages.size() - readable.size()));
  put({}, "left_out", count(left_out_));
  if (names_.size() > values_.size()) {
    names_.resize(values_.size());
    has_changed_ = true;
  }
  if (has_changed_ && !is_first) ++version_;
  return has_changed_;
}

// An executor keeps its name while it lives: otherwise the curve of one would go on with the figures of another.
void LiveStatistics::name_executors(const std::vector<const Listed *> &pages) {
  std::map<Key, std::string> named;
  std::set<std::string, std::less<>> taken;
  const auto key_of = [](const Listed &listed) { return Key(listed.pid, listed.page->process.start, listed.number); };
  for (const Listed *listed : pages) {
    const auto known = executors_.find(key_of(*listed));
    if (known == executors_.end()) continue;
    taken.insert(known->second);
    named.insert(*known);
  }
  for (const Listed *listed : pages) {
    if (named.count(key_of(*listed)) > 0) continue;
    std::string name(without_slashes(listed->page->frame.name));
    if (name.empty()) name = listed->page->frame.program;
    if (taken.count(name) > 0) name = fmt::format("{}.{}", name, listed->pid);
    if (taken.count(name) > 0) name = fmt::format("{}.{}", name, listed->number);
    taken.insert(name);
    named.emplace(key_of(*listed), std::move(name));
  }
  executors_ = std::move(named);
}

void LiveStatistics::add_executor(const Listed &listed, redag::Time now) {
  const Frame &frame = listed.page->frame;
  const std::string &executor = executors_.at(Key(listed.pid, listed.page->process.start, listed.number));
  const std::string of_executor = prefix_of({executor});
  add_row(of_executor, frame, frame, kOfExecutors);
  add(of_executor, kPageAge, seconds(std::max<Duration>(now - frame.published, 0)));
  for (const ThreadFrame &thread : frame.threads) {
    add_row(prefix_of({executor, "threads", std::to_string(thread.index)}), thread, frame, kOfThreads);
  }
  for (const DeviceFrame &device : frame.devices) {
    add_row(prefix_of({executor, "devices", device.name}), device, frame, kOfDevices);
  }
  for (const DagFrame &dag : frame.dags) {
    const std::string prefix = prefix_of({executor, dag.name});
    add_row(prefix, dag, frame, kOfDags);
    add_row(prefix, dag.figures, frame, kFigures);
  }
  for (const TaskFrame &task : frame.tasks) {
    const auto [name, rest] = parts_of(task.name);
    const std::string prefix = prefix_of({executor, frame.dags[task.dag].name, name, rest});
    add_row(prefix, task, frame, kOfTasks);
    add_row(prefix, task.figures, frame, kFigures);
  }
}

template <class Row, class Columns>
void LiveStatistics::add_row(std::string_view prefix, const Row &row, const Frame &frame, const Columns &columns) {
  for (const auto &column : columns) add(prefix, column.name, column.value(row, frame));
}

void LiveStatistics::add(std::string_view prefix, const char *figure, double value) {
  if (std::isnan(value) || (!figures_.empty() && figures_.find(std::string_view(figure)) == figures_.end())) return;
  if (values_.size() < most_) {
    put(prefix, figure, value);
  } else {
    ++left_out_;
  }
}

void LiveStatistics::put(std::string_view prefix, const char *figure, double value) {
  scratch_.assign(prefix);
  scratch_ += figure;
  const std::size_t index = values_.size();
  values_.push_back(value);
  if (index == names_.size()) {
    names_.push_back(scratch_);
  } else if (names_[index] != scratch_) {
    names_[index] = scratch_;
  } else {
    return;
  }
  has_changed_ = true;
}

std::string LiveStatistics::prefix_of(std::initializer_list<std::string_view> parts) {
  std::string path;
  for (const std::string_view part : parts) {
    const std::string_view text = without_slashes(part);
    if (text.empty()) continue;
    path += text;
    path += '/';
  }
  std::string unique = path;
  for (int number = 2; !prefixes_.insert(unique).second; ++number) {
    unique = fmt::format("{} ({})/", std::string_view(path).substr(0, path.size() - 1), number);
  }
  return unique;
}

}  // namespace redag_rclcpp::lab
