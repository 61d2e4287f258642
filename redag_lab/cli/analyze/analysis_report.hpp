// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents a report of redag_analysis: the standing of every task and DAG as a table, in words, and as JSON. Computes
// no bounds. Pure functions.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/analyze/executors.hpp"
#include "redag_analysis/explore/exploration.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"

namespace redag::cli {

/// A workload with the executor and the platform of its analysis, and the results of the methods.
struct Analysed {
  Workload workload;
  const sched::ExecutorKind *executor = nullptr;
  analysis::System system;
  analysis::Report report;
  std::shared_ptr<const analysis::Exploration> exploration;  // null: not requested, or not applicable
};

/// With at most this many tasks, every bound has its terms. With more, terms_of() computes those of one bound.
inline constexpr std::size_t kMostItemised = 128;

/// Analyses the workload. With `explore`, exploration() is one of the methods (only for our executor). `limits.itemise`
/// is ignored. `only` selects methods; empty: all. Error: of analysis::compile(), an executor that sched::executors()
/// does not list, or a method that is not one of the executor's.
[[nodiscard]] Result<Analysed> analyse(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                       const analysis::ExplorationOptions *explore = nullptr,
                                       const std::string &executor = "redag",
                                       const analysis::AnalyzeOptions &limits = {},
                                       const std::vector<std::string> &only = {});

enum class Standing : std::uint8_t {
  Ok,          // a sound method shows that the deadline is met
  MayMiss,     // the tightest sound bound is above the deadline; bounds are safe, not always exact
  NoBound,     // no sound method bounds the response time
  NoDeadline,  // of a DAG without an end-to-end deadline: bounded, with no deadline to compare
};

[[nodiscard]] const char *to_string(Standing standing);

/// The standing of a task or a DAG.
struct Row {
  std::string name;                        // "dag.task", or the DAG's name
  TaskId task;                             // invalid in a DAG's row
  DagId dag;                               // invalid in a task's row
  Duration deadline = 0;                   // 0: none
  std::optional<Duration> due;             // limit for the bound: the deadline, or sooner where jobs are skipped
  analysis::Tightest tightest;             // the bound, if any
  const analysis::Method *says = nullptr;  // the method that gave the bound or accepts without one; null: none
  std::optional<Duration> slack;           // due - bound
  Standing standing = Standing::NoBound;
  std::string reason;  // why there is no bound; can be empty
};

/// Lists the methods that do not apply, grouped by reason: two indented lines for each. Without `tests`, only those
/// that bound responses.
[[nodiscard]] std::string methods_that_do_not_apply(const analysis::Report &report, bool tests);

/// Lists the methods that were ended at a limit or by the user: a line for each, with a suggestion. Empty if there are
/// none.
[[nodiscard]] std::string describe_gave_up(const analysis::Report &report);

/// Returns the terms of the row's bound, even if analyse() left them out. Requires a bound.
[[nodiscard]] std::vector<analysis::Term> terms_of(const Analysed &analysed, const Row &row);

[[nodiscard]] std::vector<Row> task_rows(const Analysed &analysed);  // by TaskId
[[nodiscard]] std::vector<Row> dag_rows(const Analysed &analysed);   // by DagId

/// Returns "dag.task".
[[nodiscard]] std::string task_name(const Analysed &analysed, TaskId task);

/// The analysed mode ("none", "cooperative", "os") and, if it is not the workload's, the reason.
[[nodiscard]] const char *mode_name(const Analysed &analysed);
[[nodiscard]] std::string mode_reason(const Analysed &analysed);

/// Returns one sentence: schedulable and by which method, or the missing part.
[[nodiscard]] std::string verdict_in_words(const Analysed &analysed);

/// Returns the row with the least slack for its deadline, or without a bound. Returns nothing if a test accepts all
/// tasks without numbers.
[[nodiscard]] std::optional<Row> weakest_row(const Analysed &analysed);
/// Returns one change with which every deadline is shown to be met, verified by the analysis (find_remedy()). Requires
/// a workload that is not shown schedulable.
[[nodiscard]] std::optional<std::string> suggested_change(const Analysed &analysed, const Row &weakest);
/// Returns the verdict, the weakest task or DAG, a suggested change where some deadline is not shown, and a pointer to
/// further options. With an exploration, adds its table.
[[nodiscard]] std::string summarise(const Analysed &analysed, const StreamTraits &terminal);

/// Returns a headline, tables, the verdict, and a line for each method. `all`: a row for every task, regardless of
/// number.
[[nodiscard]] std::string describe(const Analysed &analysed, const StreamTraits &terminal, bool all);

/// Lists every method with its assumptions, citation and complexity.
[[nodiscard]] std::string describe_methods();

/// Returns `redag.analysis/1`. `each` adds every method's bound of every task and DAG.
[[nodiscard]] Json to_json(const Analysed &analysed, bool each = false);

}  // namespace redag::cli
