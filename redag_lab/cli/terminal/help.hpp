// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The text of --help, within 80 columns. Owns nothing; used by one thread.

#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace redag::cli {

/// Wraps descriptions. Each ends with the option's default value and the options that it needs or excludes.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App *app, std::string name, CLI::AppFormatMode mode) const override;
};

}  // namespace redag::cli
