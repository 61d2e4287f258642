// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// JSON of the commands. Every document has its provenance (redag/loader/provenance.hpp).
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "redag/base/result.hpp"

namespace redag::cli {

using Json = nlohmann::ordered_json;

/// Returns indented text with a newline at the end. A document (with a `format`) gets the provenance of this process,
/// unless it has that of its run. Invalid UTF-8 (file names can contain any bytes) becomes U+FFFD.
[[nodiscard]] std::string to_text(Json document);

[[nodiscard]] Json diagnostics_json(const Diagnostics &diagnostics);

}  // namespace redag::cli
