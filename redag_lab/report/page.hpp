// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The report as one HTML file with a template, the page's styles and scripts, ECharts, and the document. The file opens
// without a network and permits no network access. Pure function.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace redag::report {

enum class PageKind : std::uint8_t { Runs, Experiment };

/// Returns the page of a document: to_json() or results.json of an experiment. No text of it can become markup.
[[nodiscard]] std::string page(std::string_view document, PageKind kind = PageKind::Runs);

/// Returns the JSON for a <script> element, with every "<" escaped. Requires JSON, in which "<" occurs only in strings.
[[nodiscard]] std::string script_safe(std::string_view json);

}  // namespace redag::report
