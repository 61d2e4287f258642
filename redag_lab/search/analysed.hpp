// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An analysis of one workload as values: the standing of every task and DAG, and the weakest of them. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/derived/clusters.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/analyze/executors.hpp"

namespace redag::lab {

/// A workload with the executor and the platform of its analysis, and the results of the methods.
struct Analysed {
  Workload workload;
  const executors::ExecutorKind *executor = nullptr;
  analysis::TaskSet task_set;
  analysis::Report report;
};

/// With at most this many tasks, every bound has its terms. With more, terms_of() computes those of one bound.
inline constexpr std::size_t kMostItemised = 128;

/// Analyses the workload. `limits.itemise` is ignored. `only` selects methods; empty: all. Error: of
/// analysis::compile(), an executor that executors::all() does not list, or a method that is not one of the executor's.
[[nodiscard]] Result<Analysed> analyse(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                       const std::string &executor = "redag",
                                       const analysis::AnalyzeOptions &limits = {},
                                       const std::vector<std::string> &only = {});

struct AnalysedPart {
  ClusterPart part;
  Analysed analysed;  // of part.workload
};

/// Analyses each cluster that serves a DAG on its own workers, with the arguments of analyse(). A workload without
/// clusters is one part. `platform` is that of all clusters together.
[[nodiscard]] Result<std::vector<AnalysedPart>> analyse_parts(const Workload &workload,
                                                              const analysis::AnalysisPlatform &platform,
                                                              const std::string &executor = "redag",
                                                              const analysis::AnalyzeOptions &limits = {},
                                                              const std::vector<std::string> &only = {});

/// True if every deadline of every part is shown to be met.
[[nodiscard]] bool is_schedulable(const std::vector<AnalysedPart> &parts);

enum class Standing : std::uint8_t {
  Ok,          // a sound method shows that the deadline is met
  MayMiss,     // the tightest sound bound is above the deadline; bounds are safe, not always exact
  MayLose,     // jobs that end answer within the bound; others can be skipped or cut off, whatever their deadline
  NoBound,     // no sound method bounds the response time
  NoDeadline,  // of a DAG without an end-to-end deadline: bounded, with no deadline to compare
};

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

/// Returns the terms of the row's bound, even if analyse() left them out. Requires a bound.
[[nodiscard]] std::vector<analysis::Term> terms_of(const Analysed &analysed, const Row &row);

[[nodiscard]] std::vector<Row> task_rows(const Analysed &analysed);  // by TaskId

[[nodiscard]] std::vector<Row> dag_rows(const Analysed &analysed);  // by DagId

/// Returns "dag.task".
[[nodiscard]] std::string task_name(const Analysed &analysed, TaskId task);
[[nodiscard]] std::string device_name(const Analysed &analysed, DeviceId device);

/// Returns the row with the least slack for its deadline, or without a bound. Foreign threads that meet theirs are left
/// out. Returns nothing if a test accepts all tasks without numbers.
[[nodiscard]] std::optional<Row> weakest_row(const Analysed &analysed);

/// Returns all tasks in the order in which a change of them is likely to help the row: those of its bound's largest
/// terms, those of its DAG, and the others by utilization. Tasks that cannot delay the row are left out: those after
/// it, and less urgent ones that block it with nothing.
[[nodiscard]] std::vector<TaskId> suspects_of(const Analysed &analysed, const Row &row);

}  // namespace redag::lab
