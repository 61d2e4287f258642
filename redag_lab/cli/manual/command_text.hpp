// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the program's commands and options are, as values: read from CLI11's definitions, which alone state them. Manual
// pages and completions are written from it. Pure functions.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace redag::cli {

/// What a shell can offer for a value.
enum class Completion {
  Nothing,  // a flag, which has no value
  Text,     // a number, a duration, a name
  Name,     // one of `choices`
  Names,    // several of `choices`, separated by commas
  File,     // any file
  Yaml,     // a workload or a plan
  Result,   // a folder of results, or a trace in one
  Folder,
};

struct OptionText {
  std::vector<std::string> names;  // "-o", "--output"; of an argument: its name
  std::string label;               // "-o, --output FILE"
  std::string value;               // "FILE"; empty for a flag
  std::string description;         // with remarks
  std::string summary;             // without remarks, up to the first list
  std::string group;               // heading in --help
  Completion completion = Completion::Text;
  std::vector<std::string> choices;
  bool may_repeat = false;
};

struct CommandText {
  std::string name;  // "experiment acceptance"; empty for the program
  std::string summary;
  std::string usage;  // "redag experiment acceptance [OPTIONS] [PLAN]"
  std::string footer;
  std::vector<std::string> examples;  // lines
  std::vector<OptionText> arguments;
  std::vector<OptionText> options;
  std::vector<CommandText> commands;
};

/// Reads the definitions of the program, or of one of its commands. Hidden options are left out.
[[nodiscard]] CommandText describe(const CLI::App &app);

/// Returns the command, and all below it, in the order of --help.
[[nodiscard]] std::vector<const CommandText *> all_commands(const CommandText &program);

}  // namespace redag::cli
