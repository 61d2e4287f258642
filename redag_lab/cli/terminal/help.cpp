// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/help.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string_view>
#include <vector>

#include "redag_analysis/text/wrap.hpp"

namespace redag::cli {
namespace {

constexpr std::size_t kMostWidth = 80;
constexpr std::size_t kNarrow = 60;  // descriptions of options stand below them

// Returns a row: a name, and its description beside or below it.
std::string row(const std::string &name, const std::string &description, std::size_t width) {
  const std::size_t column = width < kNarrow ? 6 : 28;  // where descriptions begin
  std::string text = "  " + name;
  if (text.size() + 2 > column) text += "\n";
  const std::size_t begin = text.back() == '\n' ? 0 : text.size();
  return text + std::string(column - begin, ' ') + wrapped(description, column, width);
}

std::string names_of(const CLI::Option &option) {
  if (option.get_positional()) return option.get_name(true, false);
  std::string names;
  for (const std::string &name : option.get_snames()) names += (names.empty() ? "-" : ", -") + name;
  for (const std::string &name : option.get_lnames()) names += (names.empty() ? "--" : ", --") + name;
  return names;
}

std::string names_of(const std::set<CLI::Option *> &options) {
  std::vector<std::string> names;
  for (const CLI::Option *option : options) names.push_back(option->get_name());
  std::sort(names.begin(), names.end());
  return fmt::format("{}", fmt::join(names, ", "));
}

// Returns " (default: 3; needs --out)" or an empty text.
std::string remarks_on(const CLI::Option &option) {
  std::vector<std::string> remarks;
  if (!option.get_positional() && option.get_required()) remarks.emplace_back("required");
  if (option.get_type_size() != 0 && !option.get_default_str().empty()) {
    remarks.push_back("default: " + option.get_default_str());
  }
  if (!option.get_needs().empty()) remarks.push_back("needs " + names_of(option.get_needs()));
  if (!option.get_excludes().empty()) remarks.push_back("not with " + names_of(option.get_excludes()));
  return remarks.empty() ? std::string() : fmt::format(" ({})", fmt::join(remarks, "; "));
}

// Returns all names of an option and its value: "-o, --output FILE".
std::string label_of(const CLI::Option &option) {
  const std::string name = names_of(option);
  const std::string type = option.get_type_name();
  if (option.get_positional() || type.empty()) return name;
  if (type.rfind("[=", 0) == 0) return name + type;  // a flag that may have a value
  return option.get_type_size() == 0 ? name : name + " " + type;
}

std::string section(const std::string &title, const std::vector<const CLI::Option *> &options, std::size_t width) {
  std::string text;
  for (const CLI::Option *option : options)
    text += row(label_of(*option), option->get_description() + remarks_on(*option), width);
  return text.empty() ? text : "\n" + title + ":\n" + text;
}

}  // namespace

HelpFormatter::HelpFormatter(std::size_t width) : width_(width == 0 ? kMostWidth : std::min(width, kMostWidth)) {
  label("SUBCOMMAND", "COMMAND");
}

std::string HelpFormatter::make_help(const CLI::App *app, std::string name, CLI::AppFormatMode /*mode*/) const {
  std::string text = wrapped(app->get_description(), 0, width_) + "\n" + make_usage(app, name);
  text += section("Arguments", app->get_options([](const CLI::Option *option) { return option->get_positional(); }),
                  width_);
  for (const std::string &group : app->get_groups()) {
    if (group.empty()) continue;  // hidden options
    const auto belongs = [&](const CLI::Option *option) {
      return option->get_group() == group && option->nonpositional();
    };
    text += section(group, app->get_options(belongs), width_);
  }
  std::string commands;
  for (const CLI::App *command : app->get_subcommands({}))
    commands += row(command->get_name(), command->get_description(), width_);
  if (!commands.empty()) text += "\nCommands:\n" + commands;
  // Commands of examples are copied, and stay on their lines.
  const std::string footer = app->get_footer();
  const bool is_prose = footer.rfind("Examples:", 0) != 0;
  return text + "\n" + (is_prose ? fitted(footer, width_) : footer) +
         (footer.empty() || footer.back() == '\n' ? "" : "\n");
}

}  // namespace redag::cli
