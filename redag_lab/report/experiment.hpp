// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The page of a factorial experiment: of its factorial.json (docs/experiments.md), what the page draws. Pure functions.
#pragma once

#include <string>
#include <string_view>

#include "redag/base/provenance.hpp"
#include "redag/base/result.hpp"

namespace redag::report {

struct ExperimentDocument {
  std::string title;
  std::string json;     // for page(); some megabytes at most
  std::string summary;  // one line for the terminal
};

/// `text`: of a factorial.json, which `file` names in messages; `provenance`: of the page. Errors: not such a document.
[[nodiscard]] Result<ExperimentDocument> experiment_document(std::string_view text, const std::string &file,
                                                             const Provenance &provenance = {});

}  // namespace redag::report
