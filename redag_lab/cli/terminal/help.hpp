// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The text of --help, within 80 columns or those of the terminal. Owns nothing; used by one thread.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace redag::cli {

/// Wraps descriptions. Each ends with the option's default value and the options that it needs or excludes.
class HelpFormatter : public CLI::Formatter {
 public:
  /// `width`: columns of the terminal, of which at most 80 are used; 0: 80.
  explicit HelpFormatter(std::size_t width = 0);
  std::string make_help(const CLI::App *app, std::string name, CLI::AppFormatMode mode) const override;

 private:
  std::size_t width_;
};

}  // namespace redag::cli
