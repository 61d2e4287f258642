// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Extracts the data of an experiment's page from its factorial.json (docs/experiments.md). Pure functions.
#pragma once

#include <string>
#include <string_view>

#include "redag/base/provenance.hpp"
#include "redag/base/result.hpp"

namespace redag::report {

struct ExperimentDocument {
  std::string title;
  std::string json;     // for page(); at most a few megabytes
  std::string summary;  // one line for the terminal
};

/// Converts the `text` of a factorial.json. Messages call it `file`, and `provenance` is that of the page. Errors: not
/// such a document.
[[nodiscard]] Result<ExperimentDocument> experiment_document(std::string_view text, const std::string &file,
                                                             const Provenance &provenance = {});

}  // namespace redag::report
