// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/live_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

using live::DagFrame;
using live::Frame;
using live::TaskFrame;
using live::page::Figures;

constexpr double kNear = 0.9;      // share of the limit that counts as near
constexpr int kMissedUpdates = 4;  // after which a page is stale
constexpr Duration kPatience = kSecond;

double rate_of(const Figures &figures, const Frame &frame, bool since_start) {
  const Duration time = since_start ? frame.published - frame.began : frame.window;
  const std::uint64_t jobs = since_start ? figures.finished : figures.recent_jobs;
  return time > 0 ? static_cast<double>(jobs) * 1e9 / static_cast<double>(time) : 0;
}

double cpu_of(const Figures &figures, const Frame &frame, bool since_start) {
  const Duration time = since_start ? frame.published - frame.began : frame.window;
  const Duration cpu = since_start ? figures.cpu : figures.recent_cpu;
  return time > 0 ? static_cast<double>(cpu) / static_cast<double>(time) : 0;
}

struct Response {
  Duration p50;
  Duration p99;
  Duration longest;
};

Response response_of(const Figures &figures, bool since_start) {
  if (since_start) return {figures.response_p50, figures.response_p99, figures.response_max};
  return {figures.recent_p50, figures.recent_p99, figures.recent_max};
}

std::string rate_text(double rate) {
  if (rate <= 0) return "-";
  if (rate < 10) return fmt::format("{:.2f}", rate);
  return fmt::format("{:.{}f}", rate, rate < 1000 ? 1 : 0);
}

Cell time_cell(Duration time, Tint tint = Tint::Plain) {
  if (time <= 0) return {"-", Tint::Faint};
  return {humanize_duration(time), tint};
}

Cell count_cell(std::uint64_t count, Tint tint = Tint::Plain) {
  return {format_count(count), count > 0 ? tint : Tint::Faint};
}

/// Returns the cells common to the rows of DAGs and tasks.
std::vector<Cell> row_of(Cell name, const Figures &figures, const Frame &frame, const LiveView &view, Duration deadline,
                         Duration bound, std::uint32_t cap) {
  const Response response = response_of(figures, view.since_start);
  const bool misses_now = figures.recent_misses > 0;
  const auto tint = [&](Duration time) { return response_tint(time, deadline, bound); };
  if (misses_now) name.tint = Tint::Bad;
  const std::string active = cap > 0 ? fmt::format("{}/{}", figures.active, cap) : fmt::format("{}", figures.active);
  const bool at_cap = cap > 0 && figures.active >= cap;
  const Tint queued = figures.ready > 0 && at_cap ? Tint::Caution : Tint::Plain;
  return {std::move(name),
          {rate_text(rate_of(figures, frame, view.since_start))},
          time_cell(response.p50, tint(response.p50)),
          time_cell(response.p99, tint(response.p99)),
          time_cell(response.longest, tint(response.longest)),
          time_cell(deadline),
          time_cell(bound),
          count_cell(figures.misses, misses_now ? Tint::Bad : Tint::Caution),
          count_cell(figures.recent_misses, Tint::Bad),
          {active, figures.active == 0 ? Tint::Faint
                   : at_cap            ? Tint::Caution
                                       : Tint::Plain},
          count_cell(figures.ready, queued),
          count_cell(figures.waiting),
          count_cell(view.since_start ? figures.preemptions : figures.recent_preemptions),
          {format_percent(cpu_of(figures, frame, view.since_start))}};
}

double key_of(const TaskFrame &task, const Frame &frame, const LiveView &view) {
  const Response response = response_of(task.figures, view.since_start);
  switch (view.order) {
    case LiveOrder::Rate: return rate_of(task.figures, frame, view.since_start);
    case LiveOrder::P99: return static_cast<double>(response.p99);
    case LiveOrder::Longest: return static_cast<double>(response.longest);
    // Recent misses outrank earlier ones.
    case LiveOrder::Misses:
      return static_cast<double>(task.figures.recent_misses) * 1e12 + static_cast<double>(task.figures.misses);
    case LiveOrder::Cpu: return cpu_of(task.figures, frame, view.since_start);
    case LiveOrder::Dag:
    case LiveOrder::Name: break;
  }
  return 0;
}

std::string full_name(const TaskFrame &task, const Frame &frame) {
  const std::string &dag = frame.dags[task.dag].name;
  return dag.empty() ? task.name : dag + "." + task.name;
}

std::vector<const TaskFrame *> ordered(const Frame &frame, const LiveView &view) {
  std::vector<const TaskFrame *> tasks;
  for (const TaskFrame &task : frame.tasks) tasks.push_back(&task);
  std::stable_sort(tasks.begin(), tasks.end(), [&](const TaskFrame *a, const TaskFrame *b) {
    if (view.order == LiveOrder::Name) return full_name(*a, frame) < full_name(*b, frame);
    return key_of(*a, frame, view) > key_of(*b, frame, view);
  });
  if (view.reversed) std::reverse(tasks.begin(), tasks.end());
  return tasks;
}

Table table_of(const Frame &frame, const LiveView &view) {
  Table table({{"task", false, 9},
               {"rate/s", true, 6},
               {"p50", true, 3},
               {"p99", true, 7},
               {"max", true, 8},
               {"deadline", true, 6},
               {"bound", true, 5},
               {"missed", true, 7},
               {"lately", true, 8},
               {"active", true, 4},
               {"ready", true, 2},
               {"wait", true, 1},
               {"preempted", true, 1},
               {"cpu", true, 5}});
  const auto add_task = [&](const TaskFrame &task, std::string name) {
    table.add(row_of({std::move(name)}, task.figures, frame, view, task.deadline, task.bound, 0));
  };
  if (view.order != LiveOrder::Dag && !view.dags_only) {
    for (const TaskFrame *task : ordered(frame, view)) add_task(*task, full_name(*task, frame));
    return table;
  }
  for (std::size_t i = 0; i < frame.dags.size(); ++i) {
    const std::size_t d = view.reversed ? frame.dags.size() - 1 - i : i;
    const DagFrame &dag = frame.dags[d];
    table.add(row_of({dag.name, Tint::Strong}, dag.figures, frame, view, 0, 0, dag.max_active));
    for (const TaskFrame &task : frame.tasks) {
      if (task.dag == d && !view.dags_only) add_task(task, "  " + task.name);
    }
  }
  return table;
}

Figures total_of(const Frame &frame) {
  Figures total{};
  for (const DagFrame &dag : frame.dags) {
    total.finished += dag.figures.finished;
    total.misses += dag.figures.misses;
    total.recent_jobs += dag.figures.recent_jobs;
    total.recent_misses += dag.figures.recent_misses;
  }
  return total;
}

double busy_of(const Frame &frame) {
  double cpu = 0;
  for (const DagFrame &dag : frame.dags) cpu += cpu_of(dag.figures, frame, false);
  return frame.workers > 0 ? cpu / frame.workers : 0;
}

double page_cost(const Frame &frame) {
  const Duration lived = frame.published - frame.began;
  return lived > 0 ? static_cast<double>(frame.publisher_cpu) / static_cast<double>(lived) : 0;
}

std::vector<std::string> head_of(const live::Listed &listed, const Frame &frame, const StreamTraits &terminal,
                                 Time now) {
  const auto fitting = [&](const std::string &line) { return terminal.width > 0 ? cut(line, terminal.width) : line; };
  const Figures total = total_of(frame);
  std::vector<std::string> lines;
  lines.push_back(tinted(
      fitting(fmt::format("{}  {} {}  {}, {} worker{}, preemption {}, {}", frame.name, frame.program, listed.pid,
                          frame.driver, frame.workers, frame.workers == 1 ? "" : "s", frame.preemption, frame.policy)),
      Tint::Strong, terminal.colour));
  const double rate = rate_of(total, frame, false);
  lines.push_back(
      fitting(fmt::format("up {}  jobs {} ({}/s)  workers busy {}  live page {} of a processor",
                          humanize_duration(frame.published - frame.began), format_count(total.finished),
                          rate_text(rate), format_percent(busy_of(frame)), format_percent(page_cost(frame)))));
  const std::string misses = fmt::format("misses {}, {} in the last {}", format_count(total.misses),
                                         format_count(total.recent_misses), humanize_duration(frame.window));
  lines.push_back(tinted(fitting(misses),
                         total.recent_misses > 0 ? Tint::Bad
                         : total.misses > 0      ? Tint::Caution
                                                 : Tint::Good,
                         terminal.colour));
  if (!frame.alert.empty()) lines.push_back(tinted(fitting(frame.alert), Tint::Bad, terminal.colour));
  if (const auto late = overdue(frame, now)) {
    lines.push_back(tinted(fitting(fmt::format("no update for {}: the process is stopped, or gets no processor",
                                               humanize_duration(*late))),
                           Tint::Bad, terminal.colour));
  }
  if (frame.left_out > 0) {
    lines.push_back(tinted(fitting(fmt::format("{} more tasks do not fit the live page", format_count(frame.left_out))),
                           Tint::Caution, terminal.colour));
  }
  return lines;
}

Json or_null(Duration value) { return value > 0 ? Json(value) : Json(nullptr); }

Json figures_json(const Figures &f, const Frame &frame) {
  return {{"rate", rate_of(f, frame, false)},
          {"cpu", cpu_of(f, frame, false)},
          {"released", f.released},
          {"finished", f.finished},
          {"skipped", f.skipped},
          {"aborted", f.aborted},
          {"misses", f.misses},
          {"deferred", f.deferred},
          {"preemptions", f.preemptions},
          {"cpu_ns", f.cpu},
          {"response", {{"p50_ns", f.response_p50}, {"p99_ns", f.response_p99}, {"max_ns", f.response_max}}},
          {"recent",
           {{"finished", f.recent_jobs},
            {"misses", f.recent_misses},
            {"preemptions", f.recent_preemptions},
            {"cpu_ns", f.recent_cpu},
            {"response", {{"p50_ns", f.recent_p50}, {"p99_ns", f.recent_p99}, {"max_ns", f.recent_max}}}}},
          {"active", f.active},
          {"ready", f.ready},
          {"waiting", f.waiting}};
}

std::vector<std::string> lines_of(const std::string &text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

}  // namespace

const char *to_string(LiveOrder order) {
  constexpr std::array<const char *, kLiveOrders> kNames{"dag", "name", "rate", "p99", "max", "misses", "cpu"};
  return kNames[static_cast<std::size_t>(order)];
}

Tint response_tint(Duration response, Duration deadline, Duration bound) {
  Duration limit = kNever;
  if (deadline > 0) limit = std::min(limit, deadline);
  if (bound > 0) limit = std::min(limit, bound);
  if (limit == kNever) return Tint::Plain;
  if (response > limit) return Tint::Bad;
  return static_cast<double>(response) >= kNear * static_cast<double>(limit) ? Tint::Caution : Tint::Plain;
}

std::optional<Duration> overdue(const Frame &frame, Time now) {
  const Duration age = now - frame.published;
  const Duration patience =
      std::max(kPatience, std::min(frame.interval, kMaxDuration / kMissedUpdates) * kMissedUpdates);
  if (age <= patience) return std::nullopt;
  return age;
}

LiveText describe(const live::Listed &listed, const live::Page &page, const LiveView &view,
                  const StreamTraits &terminal, Time now) {
  LiveText text;
  text.head = head_of(listed, page.frame, terminal, now);
  text.rows = lines_of(table_of(page.frame, view).render(terminal.width, terminal.colour));
  text.titles = text.rows.front();
  text.rows.erase(text.rows.begin());
  return text;
}

Json to_json(const live::Listed &listed, const live::Page &page, Time now) {
  const Frame &frame = page.frame;
  Json document = {{"format", "redag.live/1"},
                   {"pid", listed.pid},
                   {"number", listed.number},
                   {"path", listed.path},
                   {"name", frame.name},
                   {"program", frame.program},
                   {"driver", frame.driver},
                   {"workers", frame.workers},
                   {"preemption", frame.preemption},
                   {"policy", frame.policy},
                   {"sequence", frame.sequence},
                   {"age_ns", std::max<Duration>(0, now - frame.published)},
                   {"up_ns", frame.published - frame.began},
                   {"interval_ns", frame.interval},
                   {"window_ns", frame.window},
                   {"page_cpu_ns", frame.publisher_cpu},
                   {"left_out", frame.left_out},
                   {"alert", frame.alert.empty() ? Json(nullptr) : Json(frame.alert)},
                   {"dags", Json::array()},
                   {"tasks", Json::array()}};
  for (const DagFrame &dag : frame.dags) {
    Json row = {{"name", dag.name}, {"max_active", dag.max_active}};
    row.update(figures_json(dag.figures, frame));
    document["dags"].push_back(std::move(row));
  }
  for (const TaskFrame &task : frame.tasks) {
    Json row = {{"dag", frame.dags[task.dag].name},
                {"name", task.name},
                {"period_ns", or_null(task.period)},
                {"deadline_ns", or_null(task.deadline)},
                {"bound_ns", or_null(task.bound)}};
    row.update(figures_json(task.figures, frame));
    document["tasks"].push_back(std::move(row));
  }
  return document;
}

Json to_json(const std::vector<live::Listed> &pages, Time now) {
  Json list = Json::array();
  for (const live::Listed &listed : pages) {
    Json row = {{"pid", listed.pid}, {"number", listed.number}, {"path", listed.path}};
    if (listed.page) {
      const Frame &frame = listed.page->frame;
      row.update(Json{{"name", frame.name},
                      {"program", frame.program},
                      {"driver", frame.driver},
                      {"tasks", frame.tasks.size()},
                      {"up_ns", frame.published - frame.began},
                      {"age_ns", std::max<Duration>(0, now - frame.published)}});
    } else {
      row["diagnostics"] = diagnostics_json(listed.page.error());
    }
    list.push_back(std::move(row));
  }
  return {{"format", "redag.live-list/1"}, {"executors", std::move(list)}};
}

std::string describe(const std::vector<live::Listed> &pages, const StreamTraits &terminal, Time now) {
  Table table({{"pid", true, 9},
               {"executor", false, 8},
               {"program", false, 6},
               {"driver", false, 4},
               {"tasks", true, 3},
               {"jobs", true, 2},
               {"misses", true, 5},
               {"up", true, 1},
               {"state", false, 7}});
  for (const live::Listed &listed : pages) {
    const std::string pid =
        listed.number == 0 ? fmt::format("{}", listed.pid) : fmt::format("{}.{}", listed.pid, listed.number);
    if (!listed.page) {
      table.add({{pid}, {"?"}, {}, {}, {}, {}, {}, {}, {listed.page.error().front().message, Tint::Bad}});
      continue;
    }
    const Frame &frame = listed.page->frame;
    const Figures total = total_of(frame);
    const auto late = overdue(frame, now);
    table.add({{pid},
               {frame.name},
               {frame.program},
               {frame.driver},
               {format_count(frame.tasks.size())},
               {format_count(total.finished)},
               count_cell(total.misses, Tint::Bad),
               {humanize_duration(frame.published - frame.began)},
               late ? Cell{"no update for " + humanize_duration(*late), Tint::Bad} : Cell{"running", Tint::Good}});
  }
  return table.render(terminal.width, terminal.colour);
}

}  // namespace redag::cli
