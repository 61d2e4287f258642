// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/json.hpp"

#include "redag/loader/provenance.hpp"

namespace redag::cli {

std::string to_text(Json document) {
  const bool lacks_provenance = document.is_object() && document.contains("format") && !document.contains("provenance");
  if (lacks_provenance) {
    Json with{{"format", document["format"]}, {"provenance", Json::parse(provenance_to_json(current_provenance()))}};
    for (auto &[key, value] : document.items()) with[key] = std::move(value);
    document = std::move(with);
  }
  return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

Json diagnostics_json(const Diagnostics &diagnostics) {
  Json list = Json::array();
  for (const Diagnostic &diagnostic : diagnostics) {
    list.push_back(Json{{"severity", diagnostic.severity == Severity::Error ? "error" : "warning"},
                        {"file", diagnostic.file},
                        {"line", diagnostic.line},
                        {"column", diagnostic.column},
                        {"message", diagnostic.message},
                        {"hint", diagnostic.hint}});
  }
  return list;
}

}  // namespace redag::cli
