// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/assigned_order.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "redag/model/clusters.hpp"
#include "redag_lab/robot/links.hpp"
#include "redag_lab/robot/order.hpp"
#include "redag_lab/robot/union.hpp"
#include "redag_lab/search/audsley.hpp"

namespace redag::robot {
namespace {

// The search compiles the units of a CPU set a number of times that can grow with the square of their number.
constexpr std::size_t kMostUnits = 200;

// Where a task of the union comes from.
struct Source {
  std::optional<std::size_t> process = {};  // position in Robot::processes; nothing: `threads`
  std::size_t threads = 0;                  // position in Robot::threads
  TaskId task = {};                         // in the process's workload
  std::optional<std::uint32_t> level = {};  // of the process's executor; nothing: threads execute the task
};

std::vector<Source> sources_of(const Robot &robot, const United &united) {
  std::vector<Source> sources(united.workload.task_count());
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    if (!robot.processes[p].workload) continue;
    const auto levels = own_levels(robot, p);
    for (std::size_t t = 0; t < levels.size(); ++t) {
      sources[united.first_task[p] + t] = Source{.process = p, .task = TaskId(t), .level = levels[t]};
    }
  }
  for (std::size_t t = 0; t < robot.threads.size(); ++t) {
    const std::optional<std::size_t> &first = united.first_of_threads[t];
    for (std::uint32_t i = 0; first && i < robot.threads[t].count; ++i) sources[*first + i] = Source{.threads = t};
  }
  return sources;
}

// A unit, and the levels of its process's executor that it has.
struct Span {
  std::uint32_t unit = 0;
  std::uint32_t first = 0;
  std::uint32_t last = 0;
};

// The order of one CPU set.
class PartSearch {
 public:
  PartSearch(const Robot &robot, const United &united, const std::vector<Source> &sources, const ClusterPart &part,
             OrderSearch &search)
      : robot_(robot), united_(united), sources_(sources), part_(part), search_(search) {}

  Result<void> run() {
    const analysis::AnalysisPlatform platform = analysis::platform_of(analysis::platform_of(united_.workload), part_);
    Result<analysis::TaskSet> compiled = analysis::compile(part_.workload, platform);
    if (!compiled) return tl::unexpected<Diagnostics>(std::move(compiled.error()));
    task_set_ = *std::move(compiled);
    if (task_set_.units.size() > kMostUnits) {
      return refuse(fmt::format("policy audsley orders at most {} tasks and DAGs{}, and there are {}", kMostUnits,
                                where(), task_set_.units.size()));
    }
    const lab::TestChoice choice = lab::order_free_test(part_.workload, platform);
    if (!choice.test) {
      return refuse(fmt::format("no bound can decide the order{}: {}", where(), choice.reason));
    }
    const auto lateness = [](Duration response, Duration due) { return static_cast<double>(response - due); };
    const auto found = lab::audsley(part_.workload, platform, *choice.test, orders(), lateness);
    std::vector<std::string> &tests = search_.order.tests;
    if (std::find(tests.begin(), tests.end(), choice.test->name) == tests.end()) tests.push_back(choice.test->name);
    const std::uint32_t levels = number(found->order);
    if (found->failure) report(*found->failure, *choice.test, levels);
    return {};
  }

 private:
  static constexpr std::size_t kNoBlock = static_cast<std::size_t>(-1);

  [[nodiscard]] std::string where() const { return part_.is_cluster() ? " of CPU set '" + part_.name + "'" : ""; }

  [[nodiscard]] Result<void> refuse(std::string message) const {
    const Place &at = robot_.policy_place;
    return tl::unexpected(Diagnostics{{Severity::Error, at.file, at.line, at.column, std::move(message),
                                       "use policy rate_monotonic or deadline_monotonic"}});
  }

  [[nodiscard]] const Source &source_of(std::uint32_t task) const { return sources_[part_.tasks[task].value]; }
  [[nodiscard]] const std::vector<std::uint32_t> &tasks_of(std::uint32_t unit) const {
    return task_set_.units[unit].tasks;
  }

  // Returns nothing if threads execute all of it.
  [[nodiscard]] std::optional<Span> span_of(std::uint32_t unit) const {
    std::optional<Span> span;
    for (const std::uint32_t t : tasks_of(unit)) {
      const std::optional<std::uint32_t> &level = source_of(t).level;
      if (!level) continue;
      if (!span) span = Span{unit, *level, *level};
      span->first = std::min(span->first, *level);
      span->last = std::max(span->last, *level);
    }
    return span;
  }

  // The levels of an executor keep their order. Units whose levels overlap form a block.
  static std::vector<lab::UnitBlock> chain_of(std::vector<Span> spans) {
    std::sort(spans.begin(), spans.end(), [](const Span &a, const Span &b) {
      return std::tie(a.first, a.last, a.unit) < std::tie(b.first, b.last, b.unit);
    });
    std::vector<lab::UnitBlock> chain;
    std::uint32_t last = 0;
    for (const Span &span : spans) {
      if (chain.empty() || span.first > last) chain.emplace_back();
      chain.back().push_back(span.unit);
      last = std::max(last, span.last);
    }
    return chain;
  }

  lab::Orders orders() {
    lab::Orders orders;
    std::map<std::size_t, std::vector<Span>> of_process;
    std::map<std::size_t, lab::UnitBlock> of_entry;
    for (const std::uint32_t unit : lab::present_order(task_set_)) {
      const std::uint32_t first = tasks_of(unit).front();
      if (united_.is_above[part_.tasks[first].value]) {
        orders.first.push_back(unit);
      } else if (const Source &source = source_of(first); !source.process) {
        of_entry[source.threads].push_back(unit);
      } else if (const std::optional<Span> span = span_of(unit)) {
        of_process[*source.process].push_back(*span);
      } else {
        orders.chains.push_back({{unit}});
      }
    }
    for (const auto &[entry, block] : of_entry) orders.chains.push_back({block});
    for (const auto &[process, spans] : of_process) orders.chains.push_back(chain_of(spans));
    block_of_.assign(task_set_.units.size(), kNoBlock);
    std::size_t count = 0;
    for (const std::vector<lab::UnitBlock> &chain : orders.chains) {
      for (const lab::UnitBlock &block : chain) {
        for (const std::uint32_t unit : block) block_of_[unit] = count;
        ++count;
      }
    }
    return orders;
  }

  // Gives each block a place for each level of its executor. Returns their number. Blocks are neighbours in `order`.
  std::uint32_t number(const lab::UnitOrder &order) {
    std::uint32_t place = 0;
    for (auto begin = order.begin(); begin != order.end();) {
      const std::size_t block = block_of_[*begin];
      const auto end = std::find_if(begin, order.end(), [&](std::uint32_t unit) { return block_of_[unit] != block; });
      std::set<std::uint32_t> levels;
      for (auto unit = begin; unit != end; ++unit) {
        for (const std::uint32_t t : tasks_of(*unit)) {
          if (const Source &source = source_of(t); source.level) levels.insert(*source.level);
        }
      }
      for (auto unit = begin; unit != end && block != kNoBlock; ++unit) {
        for (const std::uint32_t t : tasks_of(*unit)) set_place(source_of(t), place, levels);
      }
      if (block != kNoBlock) place += std::max<std::uint32_t>(1, static_cast<std::uint32_t>(levels.size()));
      begin = end;
    }
    return place;
  }

  void set_place(const Source &source, std::uint32_t place, const std::set<std::uint32_t> &levels) {
    if (!source.process) {
      search_.order.of_threads[source.threads] = place;
      return;
    }
    if (source.level) place += static_cast<std::uint32_t>(std::distance(levels.begin(), levels.find(*source.level)));
    search_.order.of_task[*source.process][source.task.value] = place;
  }

  void report(const lab::Unplaced &failure, const lab::OrderFreeTest &test, std::uint32_t levels) {
    const analysis::Unit &unit = task_set_.units[failure.unit];
    const std::string &name =
        unit.tasks.size() == 1 ? task_set_.tasks[unit.tasks.front()].name : task_set_.dags[unit.dag.value].name;
    const Source &source = source_of(unit.tasks.front());
    const Place &at = source.process ? robot_.processes[*source.process].place : robot_.threads[source.threads].place;
    std::string where = "before all levels";
    if (block_of_[failure.unit] != kNoBlock) {
      const AssignedOrder &order = search_.order;
      const std::uint32_t place =
          source.process ? order.of_task[*source.process][source.task.value] : order.of_threads[source.threads].value();
      where = fmt::format("at level {} of {}, which {} could have", place + 1, levels,
                          failure.rivals == 1 ? "only it" : fmt::format("{} candidates", failure.rivals));
    }
    const std::string response =
        failure.response ? fmt::format("responds within {}", format_duration(*failure.response)) : "has no bound";
    search_.order.found = false;
    search_.warnings.push_back(
        Diagnostic{Severity::Warning, at.file, at.line, at.column,
                   fmt::format("{} all deadlines by {}: '{}' is {}; it {}, and its deadline is {}",
                               test.optimal ? "no order keeps" : "no order was found that keeps", test.name, name,
                               where, response, format_duration(failure.due)),
                   "lower the load, or lengthen the deadline; each level has the candidate that is least late there"});
  }

  const Robot &robot_;
  const United &united_;
  const std::vector<Source> &sources_;
  const ClusterPart &part_;
  OrderSearch &search_;
  analysis::TaskSet task_set_;
  std::vector<std::size_t> block_of_;  // by unit; kNoBlock: it is before all
};

}  // namespace

Result<OrderSearch> search_order(const Robot &robot) {
  Result<United> united = unite(robot, 0);
  if (!united) return tl::unexpected<Diagnostics>(std::move(united.error()));
  const Result<void> linked =
      set_jitter_by_deadlines(robot, united->first_task, analysis::platform_of(united->workload), united->workload);
  if (!linked) return tl::unexpected<Diagnostics>(linked.error());
  OrderSearch search;
  search.order.found = true;
  for (const Process &process : robot.processes) {
    search.order.of_task.emplace_back(process.workload ? process.workload->task_count() : 0);
  }
  Diagnostics mistakes;
  for (std::size_t t = 0; t < robot.threads.size(); ++t) {
    const Threads &threads = robot.threads[t];
    search.order.of_threads.emplace_back();
    if (!threads.level || threads.level->kind != Level::Kind::Rate || united->first_of_threads[t]) continue;
    mistakes.push_back(Diagnostic{
        Severity::Error, threads.place.file, threads.place.line, threads.place.column,
        fmt::format("threads '{}' have a rate, and run where no task does: no bound gives them a place", threads.name),
        "give them a priority: {fifo: PRIORITY}"});
  }
  if (!mistakes.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes));
  const std::vector<Source> sources = sources_of(robot, *united);
  for (const ClusterPart &part : parts_of(united->workload)) {
    if (part.workload.dags.empty()) continue;
    if (Result<void> done = PartSearch(robot, *united, sources, part, search).run(); !done) {
      return tl::unexpected<Diagnostics>(std::move(done.error()));
    }
  }
  return search;
}

}  // namespace redag::robot
