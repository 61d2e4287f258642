// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The text of --help, within 80 columns or those of the terminal, and its parts, which manual pages share. Owns
// nothing; used by one thread.

#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace redag::cli {

/// The values that an option takes. Its type name in CLI11 is `name`, with the choices in braces behind it:
/// "NAME{none,os}" takes one of them, "LIST{redag,mte}" several, separated by commas. --help shows the name alone.
struct ValueType {
  std::string name;
  std::vector<std::string> choices;
};
[[nodiscard]] std::string type_name(const ValueType &type);
[[nodiscard]] ValueType value_type(const CLI::Option &option);

/// Returns all names of an option and its value as --help shows them: "-o, --output FILE".
[[nodiscard]] std::string label_of(const CLI::Option &option);

/// Returns what an option does, with remarks: "Number of workers (default: 4; not with --affinity)".
[[nodiscard]] std::string description_of(const CLI::Option &option);

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
