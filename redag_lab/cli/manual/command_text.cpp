// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/manual/command_text.hpp"

#include <algorithm>
#include <string_view>

#include "redag_lab/cli/terminal/help.hpp"

namespace redag::cli {
namespace {

Completion completion_of(const CLI::Option &option, const ValueType &type) {
  if (option.get_type_size() == 0) return Completion::Nothing;
  if (!type.choices.empty()) return type.name == "LIST" ? Completion::Names : Completion::Name;
  if (type.name == "FILE" || type.name == "PROGRAM") return Completion::File;
  if (type.name == "WORKLOAD" || type.name == "ROBOT" || type.name == "PLAN") return Completion::Yaml;
  if (type.name == "RESULT") return Completion::Result;
  if (type.name == "DIR") return Completion::Folder;
  return Completion::Text;
}

OptionText describe(const CLI::Option &option) {
  const ValueType type = value_type(option);
  OptionText text;
  if (option.get_positional()) {
    text.names = {option.get_name(true, false)};
  } else {
    for (const std::string &name : option.get_snames()) text.names.push_back("-" + name);
    for (const std::string &name : option.get_lnames()) text.names.push_back("--" + name);
  }
  text.label = label_of(option);
  text.completion = completion_of(option, type);
  text.value = text.completion == Completion::Nothing ? "" : option.get_positional() ? text.names.front() : type.name;
  text.description = description_of(option);
  // A shell shows one line: choices are offered, and need no list.
  text.summary = option.get_description();
  for (const std::string_view end : {": ", "; "}) text.summary = text.summary.substr(0, text.summary.find(end));
  text.group = option.get_group();
  text.choices = type.choices;
  text.may_repeat =
      option.get_expected_max() > 1 || option.get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll;
  return text;
}

std::string command_path(const CLI::App &app) {
  if (app.get_parent() == nullptr) return {};
  const std::string outer = command_path(*app.get_parent());
  return outer.empty() ? app.get_name() : outer + " " + app.get_name();
}

std::vector<std::string> trimmed_lines(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
    if (!line.empty()) lines.emplace_back(line);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

}  // namespace

CommandText describe(const CLI::App &app) {
  constexpr std::string_view kExamples = "Examples:\n";
  constexpr std::string_view kUsage = "Usage: ";
  CommandText text;
  text.name = command_path(app);
  text.summary = app.get_description();
  const std::string program = text.name.empty() ? "redag" : "redag " + text.name;
  const std::string usage = HelpFormatter().make_usage(&app, program);
  const std::size_t begin = usage.find(kUsage);
  text.usage =
      trimmed_lines(std::string_view(usage).substr(begin == std::string::npos ? 0 : begin + kUsage.size())).front();
  const std::string footer = app.get_footer();
  const std::size_t examples = footer.find(kExamples);
  text.footer = footer.substr(0, examples);
  if (examples != std::string::npos) {
    text.examples = trimmed_lines(std::string_view(footer).substr(examples + kExamples.size()));
  }
  for (const CLI::Option *option : app.get_options()) {
    if (option->get_group().empty()) continue;
    (option->get_positional() ? text.arguments : text.options).push_back(describe(*option));
  }
  for (const CLI::App *command : app.get_subcommands({})) text.commands.push_back(describe(*command));
  return text;
}

std::vector<const CommandText *> all_commands(const CommandText &program) {
  std::vector<const CommandText *> all = {&program};
  for (const CommandText &command : program.commands) {
    const std::vector<const CommandText *> below = all_commands(command);
    all.insert(all.end(), below.begin(), below.end());
  }
  return all;
}

}  // namespace redag::cli
