// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include "redag_lab/cli/manual/completion.hpp"

namespace redag::cli {
namespace {

constexpr const char *kFishFunctions = R"(
# True behind this command: "experiment merge". With --end: and before any other word.
function __redag_behind
  set -l words (commandline -opc)[2..-1]
  set -l command (string split --no-empty ' ' -- $argv[1])
  if test "$argv[2]" = --end
    test "$words" = "$command"
  else
    set -l count (count $command)
    test (count $words) -ge $count -a "$words[1..$count]" = "$command"
  end
end

# The word that is completed, without the option that it belongs to.
function __redag_word
  commandline -ct | string replace --regex '^--?[a-z-]+=' ''
end

# Folders, and files whose names end so.
function __redag_files --argument-names ending
  set -l word (__redag_word)
  __fish_complete_path "$word" | string match --regex --entire -- '^[^\t]*(?:/|'$ending')(?:\t|$)'
end

# Names, separated by commas, that are not there yet.
function __redag_list
  set -l given (__redag_word | string replace --regex '[^,]*$' '')
  for name in $argv
    string match --quiet -- "*,$name,*" ",$given" || echo $given$name
  end
end

complete --command redag --no-files
)";

// In single quotes of fish, a backslash escapes a quote and a backslash.
std::string fish_quoted(const std::string &text) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') result += '\\';
    result += c;
  }
  return result + "'";
}

// Returns what complete(1) gets for a value. `exclusive`: of an option, whose value is then required.
std::string value_of(const OptionText &option, const char *exclusive) {
  const std::string choices = fmt::format("{}", fmt::join(option.choices, " "));
  const auto offer = [&](const std::string &words) {
    return fmt::format(" {} --arguments {}", exclusive, fish_quoted(words));
  };
  switch (option.completion) {
    case Completion::Nothing: return "";
    case Completion::Text: return fmt::format(" {}", exclusive);
    case Completion::Name: return offer(choices);
    case Completion::Names: return offer("(__redag_list " + choices + ")");
    case Completion::File: return *exclusive != '\0' ? " --require-parameter --force-files" : " --force-files";
    case Completion::Yaml: return offer("(__redag_files '\\.ya?ml')");
    case Completion::Result: return offer("(__redag_files events\\.jsonl)");
    case Completion::Folder: return offer("(__fish_complete_directories (commandline -ct))");
  }
  return "";
}

std::string rules(const CommandText &command) {
  const std::string complete = fmt::format("complete --command redag --condition {}",
                                           fish_quoted(fmt::format("__redag_behind {}", fish_quoted(command.name))));
  std::string text;
  for (const CommandText &inner : command.commands) {
    text += fmt::format("complete --command redag --condition {} --arguments {} --description {}\n",
                        fish_quoted(fmt::format("__redag_behind {} --end", fish_quoted(command.name))),
                        fish_quoted(inner.name.substr(inner.name.rfind(' ') + 1)), fish_quoted(inner.summary));
  }
  for (const OptionText &option : command.options) {
    text += command.name.empty() ? "complete --command redag --condition '__redag_behind \"\" --end'" : complete;
    for (const std::string &name : option.names) {
      text += name.size() == 2 ? " --short-option " + name.substr(1) : " --long-option " + name.substr(2);
    }
    text += value_of(option, "--exclusive") + fmt::format(" --description {}\n", fish_quoted(option.summary));
  }
  for (const OptionText &argument : command.arguments) {
    const std::string value = value_of(argument, "");
    if (argument.completion != Completion::Text) text += complete + value + "\n";
  }
  return text;
}

}  // namespace

std::string fish_completion(const CommandText &program) {
  std::string text = "# Completion of redag in fish, written by 'redag completion fish'.\n";
  text += kFishFunctions;
  for (const CommandText *command : all_commands(program)) text += rules(*command);
  return text;
}

}  // namespace redag::cli
