// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/page.hpp"

#include <utility>

#include "redag/base/check.hpp"
#include "redag_lab/report/page_assets.hpp"

namespace redag::report {

std::string script_safe(std::string_view json) {
  std::string safe;
  safe.reserve(json.size());
  for (const char c : json) {
    if (c == '<') {
      safe += "\\u003c";  // prevents "</script>" and "<!--", which would end or change the element
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string page(std::string_view document, PageKind kind) {
  // The parts are in the order of the template: an inserted text is never searched for placeholders.
  const std::string safe_document = script_safe(document);
  const std::pair<std::string_view, std::string_view> parts[] = {
      {"{{style}}", assets::kStyle},
      {"{{document}}", safe_document},
      {"{{echarts}}", assets::kEcharts},
      {"{{script}}", kind == PageKind::Runs ? assets::kScript : assets::kExperimentScript},
  };
  std::string html;
  std::string_view rest = assets::kTemplate;
  for (const auto &[place, text] : parts) {
    const std::size_t at = rest.find(place);
    REDAG_CHECK(at != std::string_view::npos, "the page's template lacks a place");
    html += rest.substr(0, at);
    html += text;
    rest.remove_prefix(at + place.size());
  }
  html += rest;
  return html;
}

}  // namespace redag::report
