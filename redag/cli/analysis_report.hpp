// What `analyze` says about a report of redag/analysis: where every task and DAG stands, in a table, in words, as JSON.
// Decides nothing about bounds. Pure functions.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/analysis/analyze.hpp"
#include "redag/analysis/executors.hpp"
#include "redag/analysis/exploration.hpp"
#include "redag/cli/console.hpp"
#include "redag/cli/json.hpp"
#include "redag/model/workload.hpp"

namespace redag::cli {

/// A workload, the executor and the platform on which it was looked at, and what the methods say.
struct Analysed {
  Workload workload;
  const sched::ExecutorKind *executor = nullptr;
  analysis::System system;
  analysis::Report report;
  std::shared_ptr<const analysis::Exploration> exploration;  // null: not asked for, or nothing to explore
};

/// With `explore`, exploration() is one of the methods, of our executor only. Error: analysis::compile(), an executor
/// that sched::executors() does not list.
[[nodiscard]] Result<Analysed> analyse(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                       const analysis::ExplorationOptions *explore = nullptr,
                                       const std::string &executor = "redag");

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

[[nodiscard]] std::vector<Row> task_rows(const Analysed &analysed);  // by TaskId
[[nodiscard]] std::vector<Row> dag_rows(const Analysed &analysed);   // by DagId

/// "dag.task".
[[nodiscard]] std::string task_name(const Analysed &analysed, TaskId task);

/// The mode that was analysed ("none", "cooperative", "full") and, where it is not what the workload names, why.
[[nodiscard]] const char *mode_name(const Analysed &analysed);
[[nodiscard]] std::string mode_reason(const Analysed &analysed);

/// Schedulable or not, by whom, or what is missing: one sentence.
[[nodiscard]] std::string verdict_in_words(const Analysed &analysed);

/// Headline, tables, verdict, and a line for each method. `all`: a row for every task, however many.
[[nodiscard]] std::string describe(const Analysed &analysed, const StreamTraits &terminal, bool all);

/// Every method with its assumptions, citation and complexity.
[[nodiscard]] std::string describe_methods();

/// `redag.analysis/1`.
[[nodiscard]] Json to_json(const Analysed &analysed);

}  // namespace redag::cli
