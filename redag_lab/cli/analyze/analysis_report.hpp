// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents a report of redag_analysis: the standing of every task and DAG as a table, in words, and as JSON. Computes
// no bounds. Pure functions.
#pragma once

#include <optional>
#include <string>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/search/analysed.hpp"

namespace redag::cli {

[[nodiscard]] const char *to_string(lab::Standing standing);

/// Lists the methods that do not apply, grouped by reason: two indented lines for each. Without `tests`, only those
/// that bound responses.
[[nodiscard]] std::string methods_that_do_not_apply(const analysis::Report &report, bool tests);

/// Lists the methods that were ended at a limit or by the user: a line for each, with a suggestion. Empty if there are
/// none.
[[nodiscard]] std::string describe_gave_up(const analysis::Report &report);

/// The analysed mode ("none", "cooperative", "os") and, if it is not the workload's, the reason.
[[nodiscard]] const char *mode_name(const lab::Analysed &analysed);
[[nodiscard]] std::string mode_reason(const lab::Analysed &analysed);

/// Returns one sentence: schedulable and by which method, or the missing part.
[[nodiscard]] std::string verdict_in_words(const lab::Analysed &analysed);

/// Returns one change with which every deadline is shown to be met, verified by the analysis (find_remedy()). Requires
/// a workload that is not shown schedulable.
[[nodiscard]] std::optional<std::string> suggested_change(const lab::Analysed &analysed, const lab::Row &weakest);
/// Returns the verdict, the weakest task or DAG, a suggested change where some deadline is not shown, and a pointer to
/// further options.
[[nodiscard]] std::string summarise(const lab::Analysed &analysed, const StreamTraits &terminal);

/// Returns a headline, tables, the verdict, and a line for each method. `all`: a row for every task, regardless of
/// number.
[[nodiscard]] std::string describe(const lab::Analysed &analysed, const StreamTraits &terminal, bool all);

/// Lists every method with its assumptions, citation and complexity.
[[nodiscard]] std::string describe_methods();

/// The same as `redag.methods/1`.
[[nodiscard]] Json methods_json();

/// Returns `redag.analysis/1`. `each` adds every method's bound of every task and DAG.
[[nodiscard]] Json to_json(const lab::Analysed &analysed, bool each = false);

}  // namespace redag::cli
