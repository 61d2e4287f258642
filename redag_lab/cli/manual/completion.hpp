// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Completions of shells, from the definitions of options. Each function returns a script of its shell. Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/manual/command_text.hpp"

namespace redag::cli {

[[nodiscard]] std::string bash_completion(const CommandText &program);
[[nodiscard]] std::string zsh_completion(const CommandText &program);
[[nodiscard]] std::string fish_completion(const CommandText &program);

/// Returns text in single quotes of bash and zsh, for any text.
[[nodiscard]] std::string shell_quoted(const std::string &text);

}  // namespace redag::cli
