// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `analyze` says about a report of redag_analysis: where every task and DAG stands, in a table, in words, as JSON.
// Decides nothing about bounds. Pure functions.
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

/// A workload, the executor and the platform on which it was looked at, and what the methods say.
struct Analysed {
  Workload workload;
  const sched::ExecutorKind *executor = nullptr;
  analysis::System system;
  analysis::Report report;
  std::shared_ptr<const analysis::Exploration> exploration;  // null: not asked for, or nothing to explore
};

/// Up to so many tasks every bound comes with its terms; of more, terms_of() finds those of one.
inline constexpr std::size_t kMostItemised = 128;

/// With `explore`, exploration() is one of the methods, of our executor only. `limits`: its `itemise` is not looked at.
/// `only`: these methods; none: all. Error: analysis::compile(), an executor that sched::executors() does not list, a
/// method that is not one of the executor's.
[[nodiscard]] Result<Analysed> analyse(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                       const analysis::ExplorationOptions *explore = nullptr,
                                       const std::string &executor = "redag",
                                       const analysis::AnalyzeOptions &limits = {},
                                       const std::vector<std::string> &only = {});

enum class Standing : std::uint8_t {
  Ok,          // a sound method shows that the deadline is met
  MayMiss,     // the tightest sound bound is above the deadline; bounds are safe, not always exact
  NoBound,     // no sound method bounds the response time
  NoDeadline,  // of a DAG without an end-to-end deadline: bounded, and nothing to hold it to
};

[[nodiscard]] const char *to_string(Standing standing);

/// Where a task or a DAG stands.
struct Row {
  std::string name;                        // "dag.task", or the DAG's
  TaskId task;                             // which; of a DAG's row invalid
  DagId dag;                               // which; of a task's row invalid
  Duration deadline = 0;                   // 0: none
  std::optional<Duration> due;             // what the bound is held to: the deadline, or sooner where jobs are skipped
  analysis::Tightest tightest;             // the bound, if any
  const analysis::Method *says = nullptr;  // which method gave the bound, or accepts without one; null: none
  std::optional<Duration> slack;           // due - bound
  Standing standing = Standing::NoBound;
  std::string reason;  // why there is no bound; can be empty
};

/// Which methods do not apply, by the reason: two lines for each, indented. Without `tests` only those that bound
/// responses.
[[nodiscard]] std::string methods_that_do_not_apply(const analysis::Report &report, bool tests);

/// Methods that were ended at a limit or by the user: a line for each, with what to change. Empty if there are none.
[[nodiscard]] std::string describe_gave_up(const analysis::Report &report);

/// Where the row's bound comes from, also where analyse() left that out. Requires a bound.
[[nodiscard]] std::vector<analysis::Term> terms_of(const Analysed &analysed, const Row &row);

[[nodiscard]] std::vector<Row> task_rows(const Analysed &analysed);  // by TaskId
[[nodiscard]] std::vector<Row> dag_rows(const Analysed &analysed);   // by DagId

/// "dag.task".
[[nodiscard]] std::string task_name(const Analysed &analysed, TaskId task);

/// The mode that was analysed ("none", "cooperative", "os") and, where it is not what the workload names, why.
[[nodiscard]] const char *mode_name(const Analysed &analysed);
[[nodiscard]] std::string mode_reason(const Analysed &analysed);

/// Schedulable or not, by whom, or what is missing: one sentence.
[[nodiscard]] std::string verdict_in_words(const Analysed &analysed);

/// The row with the least slack for its deadline, or without a bound; nothing if a test accepts all without numbers.
[[nodiscard]] std::optional<Row> weakest_row(const Analysed &analysed);
/// One change with which every deadline is shown to be met, tried by the analysis (find_remedy()). Requires a workload
/// that is not shown schedulable.
[[nodiscard]] std::optional<std::string> suggested_change(const Analysed &analysed, const Row &weakest);
/// The verdict, the weakest task or DAG, what to change where not all is shown; then where there is more. With an
/// exploration its table.
[[nodiscard]] std::string summarise(const Analysed &analysed, const StreamTraits &terminal);

/// Headline, tables, verdict, and a line for each method. `all`: a row for every task, however many.
[[nodiscard]] std::string describe(const Analysed &analysed, const StreamTraits &terminal, bool all);

/// Every method with its assumptions, citation and complexity.
[[nodiscard]] std::string describe_methods();

/// `redag.analysis/1`. `each`: with every method's bound of every task and DAG.
[[nodiscard]] Json to_json(const Analysed &analysed, bool each = false);

}  // namespace redag::cli
