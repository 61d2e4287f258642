// The report as one HTML file: a template, the page's own styles and scripts, ECharts, and the document, all in one.
// Opens without a network and lets none be used. Pure function.
#pragma once

#include <string>
#include <string_view>

namespace redag::report {

/// `document`: of to_json(). `title` is plain text. Whatever names the document holds, no text of it becomes markup.
[[nodiscard]] std::string page(std::string_view document, std::string_view title);

/// A JSON text that can stand in a <script> element: "<" only as an escape. Requires JSON, where "<" is only in
/// strings.
[[nodiscard]] std::string script_safe(std::string_view json);

/// Text that can stand in HTML, also between quotes.
[[nodiscard]] std::string html_escaped(std::string_view text);

}  // namespace redag::report
