// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "redag/base/nearest.hpp"
#include "redag/base/provenance.hpp"
#include "redag/base/text.hpp"
#include "redag_lab/cli/manual/manual.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"

namespace redag::cli {
namespace {

struct ManualOptions {
  std::vector<std::string> command;
  std::string folder;
  bool markdown = false;
};

// Returns today, or the day of SOURCE_DATE_EPOCH.
std::string date_of_pages() {
  const Result<std::optional<std::time_t>> given = source_date_epoch();  // checked when the program began
  const std::time_t time = given && *given ? **given : std::time(nullptr);
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(time));
}

int write_pages(const CommandText &program, const std::string &folder, Console &console) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    console.error(fmt::format("{}: {}", folder, error.message()));
    return kExitBad;
  }
  for (const CommandText *command : all_commands(program)) {
    const std::string file = fmt::format("{}/{}.1", folder, page_name(*command));
    if (const Result<void> written = write_text(file, manual_page(*command, program, date_of_pages())); !written) {
      console.note(written.error());
      return kExitBad;
    }
  }
  return kExitOk;
}

int print_page(const CommandText &program, const std::vector<std::string> &words, Console &console) {
  const std::string name = fmt::format("{}", fmt::join(words, " "));
  std::vector<std::string> names;
  for (const CommandText *command : all_commands(program)) {
    if (command->name == name) {
      console.print(manual_page(*command, program, date_of_pages()));
      return kExitOk;
    }
    if (!command->name.empty()) names.push_back(command->name);
  }
  console.error("unknown command " + in_quotes(name), suggestion(name, names));
  return kExitBad;
}

}  // namespace

Action add_man(CLI::App &app) {
  auto options = std::make_shared<ManualOptions>();
  CLI::Option *command = app.add_option("COMMAND", options->command,
                                        "Command, such as simulate or experiment merge; "
                                        "by default the program's own page");
  CLI::Option *folder =
      app.add_option("--out", options->folder, "Folder for the pages of all commands; created if missing")
          ->type_name("DIR")
          ->excludes(command);
  app.add_flag("--markdown", options->markdown, "Print one page of Markdown with all commands")
      ->excludes(command)
      ->excludes(folder);
  return [options, &app](Console &console) {
    const CommandText program = describe(*app.get_parent());
    if (!options->folder.empty()) return write_pages(program, options->folder, console);
    if (options->markdown) {
      console.print(markdown_manual(program));
      return kExitOk;
    }
    return print_page(program, options->command, console);
  };
}

}  // namespace redag::cli
