// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include "redag_lab/cli/manual/completion.hpp"

namespace redag::cli {
namespace {

// bash splits "--policy=edf" at the sign, as COMP_WORDBREAKS says. The functions need no other package.
constexpr const char *kBashFunctions = R"(
_redag_names() { mapfile -t COMPREPLY < <(compgen -W "$1" -- "$current"); }

_redag_list() {
  local last=${current##*,}
  compopt -o nospace
  mapfile -t COMPREPLY < <(compgen -P "${current%"$last"}" -W "$1" -- "$last")
}

_redag_files() {
  compopt -o filenames
  mapfile -t COMPREPLY < <(compgen -d -- "$current"; [ -z "$1" ] || compgen -f -X "$1" -- "$current" | while IFS= read -r file; do
    [ -d "$file" ] || printf '%s\n' "$file"
  done)
}

_redag_value() {
  case $1 in
    File) _redag_files '!*' ;;
    Yaml) _redag_files '!*.y*ml' ;;
    Result) _redag_files '!*events.jsonl' ;;
    Folder) _redag_files '' ;;
    Name) _redag_names "$2" ;;
    Names) _redag_list "$2" ;;
  esac
}

_redag() {
  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command='' index=1 word
  COMPREPLY=()
  if [ "$current" = = ]; then
    current=''
  elif [ "$before" = = ]; then
    before=${COMP_WORDS[COMP_CWORD - 2]}
  fi
  while [ "$index" -lt "$COMP_CWORD" ]; do
    word=${command:+$command }${COMP_WORDS[index]}
    [[ " $_redag_commands " == *" ${word// /.} "* ]] || break
    command=$word
    index=$((index + 1))
  done
  local options='' valued='' arguments=() choices=()
  _redag_command "$command" "$before" || return 0
  case $current in
    -*) _redag_names "$options"; return ;;
  esac
  local argument=0
  while [ "$index" -lt "$COMP_CWORD" ]; do
    word=${COMP_WORDS[index]}
    if [ "$word" = = ]; then
      index=$((index + 1))
    elif [[ " $valued " == *" $word "* ]]; then
      [ "${COMP_WORDS[index + 1]}" = = ] || index=$((index + 1))
    elif [[ $word != -* ]]; then
      argument=$((argument + 1))
    fi
    index=$((index + 1))
  done
  [ "$argument" -lt "${#arguments[@]}" ] || argument=$((${#arguments[@]} - 1))
  [ "$argument" -lt 0 ] || _redag_value "${arguments[argument]}" "${choices[argument]}"
}

complete -F _redag redag
)";

const char *kind_name(Completion completion) {
  switch (completion) {
    case Completion::Nothing: return "Nothing";
    case Completion::Text: return "Text";
    case Completion::Name: return "Name";
    case Completion::Names: return "Names";
    case Completion::File: return "File";
    case Completion::Yaml: return "Yaml";
    case Completion::Result: return "Result";
    case Completion::Folder: return "Folder";
  }
  return "Text";
}

std::string values_of(const OptionText &option) {
  return fmt::format("{} {}", kind_name(option.completion),
                     shell_quoted(fmt::format("{}", fmt::join(option.choices, " "))));
}

// Returns the branch of a command: sets its options and arguments, or completes the value of the option `$2`.
std::string branch(const CommandText &command) {
  std::string values;
  std::vector<std::string> names;
  std::vector<std::string> valued;
  for (const OptionText &option : command.options) {
    names.insert(names.end(), option.names.begin(), option.names.end());
    if (option.completion == Completion::Nothing) continue;
    valued.insert(valued.end(), option.names.begin(), option.names.end());
    values +=
        fmt::format("        {}) _redag_value {}; return 1 ;;\n", fmt::join(option.names, " | "), values_of(option));
  }
  std::string text = fmt::format("    {})\n", shell_quoted(command.name));
  if (!values.empty()) text += "      case $2 in\n" + values + "      esac\n";
  text += fmt::format("      options='{}' valued='{}'\n", fmt::join(names, " "), fmt::join(valued, " "));
  if (!command.commands.empty()) {
    std::vector<std::string> below;
    for (const CommandText &inner : command.commands) below.push_back(inner.name.substr(inner.name.rfind(' ') + 1));
    text += fmt::format("      arguments=(Name Nothing) choices=('{}' '')\n", fmt::join(below, " "));
  } else if (!command.arguments.empty()) {
    std::vector<std::string> kinds;
    std::vector<std::string> choices;
    for (const OptionText &argument : command.arguments) {
      kinds.emplace_back(kind_name(argument.completion));
      choices.push_back(shell_quoted(fmt::format("{}", fmt::join(argument.choices, " "))));
    }
    if (!command.arguments.back().may_repeat) {
      kinds.emplace_back("Nothing");
      choices.emplace_back("''");
    }
    text += fmt::format("      arguments=({}) choices=({})\n", fmt::join(kinds, " "), fmt::join(choices, " "));
  }
  return text + "      ;;\n";
}

}  // namespace

std::string shell_quoted(const std::string &text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string bash_completion(const CommandText &program) {
  std::vector<std::string> names;
  std::string branches;
  for (const CommandText *command : all_commands(program)) {
    branches += branch(*command);
    std::string name = command->name;
    if (name.empty()) continue;
    for (char &c : name) c = c == ' ' ? '.' : c;
    names.push_back(name);
  }
  return fmt::format(
      "# Completion of redag in bash, written by 'redag completion bash'.\n\n_redag_commands='{}'\n\n"
      "_redag_command() {{\n  case $1 in\n{}  esac\n}}\n{}",
      fmt::join(names, " "), branches, kBashFunctions);
}

}  // namespace redag::cli
