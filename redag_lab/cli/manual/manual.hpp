// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Manual pages from the definitions of options. Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/manual/command_text.hpp"

namespace redag::cli {

/// Returns the name of a command's page without its section: "redag-experiment-merge".
[[nodiscard]] std::string page_name(const CommandText &command);

/// Returns the page of one command of `program` in the macros man(7). `date` is "2026-01-31".
[[nodiscard]] std::string manual_page(const CommandText &command, const CommandText &program, const std::string &date);

/// Returns one page of Markdown with all commands.
[[nodiscard]] std::string markdown_manual(const CommandText &program);

}  // namespace redag::cli
