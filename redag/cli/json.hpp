// JSON as the commands write it. Pure functions.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "redag/base/result.hpp"

namespace redag::cli {

using Json = nlohmann::ordered_json;

/// Indented, with a newline at the end. Bytes that are not UTF-8 (file names can hold any) become U+FFFD.
[[nodiscard]] inline std::string to_text(const Json &document) {
  return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

[[nodiscard]] inline Json diagnostics_json(const Diagnostics &diagnostics) {
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
