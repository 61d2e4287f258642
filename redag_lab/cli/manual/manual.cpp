// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/manual/manual.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string_view>

#include "redag/version.hpp"

namespace redag::cli {
namespace {

// Returns text for troff on one line: no character of it is a request, and a hyphen stays the one of ASCII.
std::string roff(const std::string &text) {
  std::string result;
  for (const char c : text) {
    if (c == '\\') {
      result += "\\e";
    } else if (c == '-') {
      result += "\\-";
    } else if (c == '\n') {
      result += ' ';
    } else {
      result += c;
    }
  }
  const bool is_request = !result.empty() && (result.front() == '.' || result.front() == '\'');
  return is_request ? "\\&" + result : result;
}

std::string option_entries(const std::vector<OptionText> &options) {
  std::string text;
  for (const OptionText &option : options) {
    text += fmt::format(".TP\n.B {}\n{}\n", roff(option.label), roff(option.description));
  }
  return text;
}

std::vector<std::string> option_groups(const CommandText &command) {
  std::vector<std::string> groups;
  for (const OptionText &option : command.options) {
    if (std::find(groups.begin(), groups.end(), option.group) == groups.end()) groups.push_back(option.group);
  }
  return groups;
}

std::vector<OptionText> options_of(const CommandText &command, const std::string &group) {
  std::vector<OptionText> options;
  std::copy_if(command.options.begin(), command.options.end(), std::back_inserter(options),
               [&](const OptionText &option) { return option.group == group; });
  return options;
}

std::string options_section(const CommandText &command) {
  std::string text = ".SH OPTIONS\n";
  for (const std::string &group : option_groups(command)) {
    if (group != "Options") text += fmt::format(".SS {}\n", roff(group));
    text += option_entries(options_of(command, group));
  }
  return text;
}

std::string see_also(const CommandText &command, const CommandText &program) {
  std::vector<std::string> pages;
  for (const CommandText *other : all_commands(program)) {
    if (other != &command) pages.push_back(fmt::format(".BR {} (1)", roff(page_name(*other))));
  }
  return fmt::format(".SH SEE ALSO\n{}\n", fmt::join(pages, ",\n"));
}

}  // namespace

std::string page_name(const CommandText &command) {
  std::string name = command.name.empty() ? "redag" : "redag-" + command.name;
  for (char &c : name) c = c == ' ' ? '-' : c;
  return name;
}

std::string manual_page(const CommandText &command, const CommandText &program, const std::string &date) {
  std::string upper = page_name(command);
  for (char &c : upper) c = static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
  const bool is_program = command.name.empty();
  const std::string purpose =
      is_program ? "schedule many DAGs of callbacks by priority in one process" : command.summary;
  std::string text = fmt::format(".TH {} 1 {} \"redag {}\" \"ReDAG-RT\"\n", roff(upper), date, kVersion);
  text += fmt::format(".SH NAME\n{} \\- {}\n", roff(page_name(command)), roff(purpose));
  text += fmt::format(".SH SYNOPSIS\n.B {}\n", roff(command.usage));
  text += fmt::format(".SH DESCRIPTION\n{}\n", roff(is_program ? command.summary : command.summary + "."));
  if (!command.commands.empty()) {
    text += ".SH COMMANDS\n";
    for (const CommandText &inner : command.commands) {
      text += fmt::format(".TP\n.BR {} (1)\n{}\n", roff(page_name(inner)), roff(inner.summary));
    }
  }
  if (!command.arguments.empty()) text += ".SH ARGUMENTS\n" + option_entries(command.arguments);
  text += options_section(command);
  text +=
      ".SH EXIT STATUS\n.TP\n.B 0\nSuccess.\n.TP\n.B 1\nThe command worked, and the answer is no, such as a missed "
      "deadline with \\-\\-check.\n.TP\n.B 2\nBad input or usage, or a result that could not be written.\n";
  text +=
      ".SH ENVIRONMENT\n.TP\n.B NO_COLOR\nTurns colour off.\n.TP\n.B SOURCE_DATE_EPOCH\nReplaces the time that "
      "results state, in seconds since 1970.\n";
  if (!command.examples.empty()) {
    text += ".SH EXAMPLES\n.EX\n";
    for (const std::string &line : command.examples) text += roff(line) + "\n";
    text += ".EE\n";
  }
  return text + see_also(command, program);
}

std::string markdown_manual(const CommandText &program) {
  std::string text;
  for (const CommandText *command : all_commands(program)) {
    const bool is_program = command->name.empty();
    text += is_program ? "# Commands and options\n\n" : fmt::format("## `redag {}`\n\n", command->name);
    text += fmt::format("{}{}\n\n```text\n{}\n```\n\n", command->summary, is_program ? "" : ".", command->usage);
    const auto list = [&](const std::string &title, const std::vector<OptionText> &options) {
      if (options.empty()) return;
      text += fmt::format("**{}**\n\n", title);
      for (const OptionText &option : options) {
        std::string description;
        for (const char c : option.description) {
          // The characters that Markdown would take for its own.
          if (std::string_view("\\`*_{}[]<>#|").find(c) != std::string_view::npos) description += '\\';
          description += c;
        }
        text += fmt::format("- `{}`: {}\n", option.label, description);
      }
      text += "\n";
    };
    list("Arguments", command->arguments);
    for (const std::string &group : option_groups(*command)) list(group, options_of(*command, group));
    if (!command->examples.empty()) {
      text += "**Examples**\n\n```sh\n";
      for (const std::string &line : command->examples) text += line + "\n";
      text += "```\n\n";
    }
  }
  text.pop_back();
  return text;
}

}  // namespace redag::cli
