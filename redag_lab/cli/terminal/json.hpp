// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// JSON as the commands write it: every document says where it comes from (redag/base/provenance.hpp).
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "redag/base/result.hpp"

namespace redag::cli {

using Json = nlohmann::ordered_json;

/// Indented, with a newline at the end. A document (it has a `format`) gets the provenance of this process, unless it
/// has that of the run that it is about. Bytes that are not UTF-8 (file names can hold any) become U+FFFD.
[[nodiscard]] std::string to_text(Json document);

[[nodiscard]] Json diagnostics_json(const Diagnostics &diagnostics);

}  // namespace redag::cli
