// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <string_view>

#include "redag_lab/cli/manual/completion.hpp"

namespace redag::cli {
namespace {

// Returns text for a part of a specification of _arguments, where these characters end a part.
std::string escaped(const std::string &text) {
  std::string result;
  for (const char c : text) {
    if (std::string_view("[]:\\").find(c) != std::string_view::npos) result += '\\';
    result += c;
  }
  return result;
}

std::string action_of(const OptionText &option) {
  switch (option.completion) {
    case Completion::Nothing:
    case Completion::Text: return " ";
    case Completion::Name: return fmt::format("({})", fmt::join(option.choices, " "));
    case Completion::Names: return fmt::format("_sequence compadd - {}", fmt::join(option.choices, " "));
    case Completion::File: return "_files";
    case Completion::Yaml: return "_files -g \"*.(yaml|yml)(-.)\"";
    case Completion::Result: return "_files -g \"*events.jsonl(-.)\"";
    case Completion::Folder: return "_files -/";
  }
  return " ";
}

// Returns the arguments of _arguments for one option, each in quotes.
std::string specification(const OptionText &option) {
  std::string exclusion = option.may_repeat ? "*" : fmt::format("({})", fmt::join(option.names, " "));
  std::string text;
  for (const std::string &name : option.names) {
    const bool has_value = option.completion != Completion::Nothing;
    std::string spec = exclusion + name;
    if (has_value && name.size() > 2) spec += '=';
    spec += "[" + escaped(option.summary) + "]";
    if (has_value) spec += ":" + escaped(option.value) + ":" + action_of(option);
    text += " \\\n        " + shell_quoted(spec);
  }
  return text;
}

std::string function_of(const CommandText &command);

// Returns the name of the function of a command: "_redag_experiment_merge".
std::string function_name(const CommandText &command) {
  std::string name = command.name;
  for (char &c : name) c = c == ' ' || c == '-' ? '_' : c;
  return name.empty() ? "_redag" : "_redag_" + name;
}

// Returns the body of a command that only has commands: it offers their names, and calls their functions.
std::string selection(const CommandText &command) {
  std::string names;
  std::string branches;
  for (const CommandText &inner : command.commands) {
    const std::string name = inner.name.substr(inner.name.rfind(' ') + 1);
    names += fmt::format("        {}\n", shell_quoted(name + ":" + escaped(inner.summary)));
    branches += fmt::format("        {}) {} ;;\n", name, function_name(inner));
  }
  std::string options;
  for (const OptionText &option : command.options) options += specification(option);
  return fmt::format(
      "  local curcontext=$curcontext state line\n"
      "  typeset -A opt_args\n"
      "  _arguments -C{} \\\n        ': :->command' '*:: :->arguments'\n"
      "  case $state in\n"
      "    command)\n"
      "      local -a commands=(\n{}      )\n"
      "      _describe command commands\n"
      "      ;;\n"
      "    arguments)\n"
      "      case $words[1] in\n{}      esac\n"
      "      ;;\n"
      "  esac\n",
      options, names, branches);
}

std::string function_of(const CommandText &command) {
  std::string body;
  if (!command.commands.empty()) {
    body = selection(command);
  } else {
    body = "  _arguments";
    for (const OptionText &option : command.options) body += specification(option);
    for (const OptionText &argument : command.arguments) {
      const std::string spec = (argument.may_repeat ? "*:" : ":") + escaped(argument.value) + ":" + action_of(argument);
      body += " \\\n        " + shell_quoted(spec);
    }
    body += "\n";
  }
  return fmt::format("{}() {{\n{}}}\n\n", function_name(command), body);
}

}  // namespace

std::string zsh_completion(const CommandText &program) {
  std::string text = "#compdef redag\n# Completion of redag in zsh, written by 'redag completion zsh'.\n\n";
  for (const CommandText *command : all_commands(program)) text += function_of(*command);
  // The file is the function when zsh loads it, and defines it when it is sourced.
  return text + "if [ \"$funcstack[1]\" = _redag ]; then\n  _redag \"$@\"\nelse\n  compdef _redag redag\nfi\n";
}

}  // namespace redag::cli
