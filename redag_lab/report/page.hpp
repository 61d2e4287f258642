// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The report as one HTML file: a template, the page's own styles and scripts, ECharts, and the document, all in one.
// Opens without a network and lets none be used. Pure function.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace redag::report {

enum class PageKind : std::uint8_t { Runs, Experiment };

/// `document`: of to_json(), or of experiment_document(). `title` is plain text. Whatever names the document holds, no
/// text of it becomes markup.
[[nodiscard]] std::string page(std::string_view document, std::string_view title, PageKind kind = PageKind::Runs);

/// A JSON text that can stand in a <script> element: "<" only as an escape. Requires JSON, where "<" is only in
/// strings.
[[nodiscard]] std::string script_safe(std::string_view json);

/// Text that can stand in HTML, also between quotes.
[[nodiscard]] std::string html_escaped(std::string_view text);

}  // namespace redag::report
