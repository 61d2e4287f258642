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

/// Returns the page. `document` is from to_json() or experiment_document(); `title` is plain text. No text of the
/// document can become markup.
[[nodiscard]] std::string page(std::string_view document, std::string_view title, PageKind kind = PageKind::Runs);

/// Returns the JSON for a <script> element, with every "<" escaped. Requires JSON, in which "<" occurs only in strings.
[[nodiscard]] std::string script_safe(std::string_view json);

/// Escapes a text for HTML, including attribute values in quotes.
[[nodiscard]] std::string html_escaped(std::string_view text);

}  // namespace redag::report
