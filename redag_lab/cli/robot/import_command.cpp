// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>
#include <string>

#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/workload_input.hpp"
#include "redag_lab/robot/cie.hpp"

namespace redag::cli {
namespace {

struct ImportOptions {
  std::string file;
  std::string output;
};

int import_configuration(const ImportOptions &options, Console &console) {
  if (!options.output.empty()) {
    if (const Result<void> writable = check_output(options.output); !writable) {
      console.note(writable.error());
      return kExitBad;
    }
  }
  const Result<std::string> text = read_input_text(options.file, "a configuration");
  if (!text) {
    console.note(text.error());
    return kExitBad;
  }
  const Result<robot::cie::Imported> imported =
      robot::cie::import_robot(*text, options.file == "-" ? "<stdin>" : options.file);
  if (!imported) {
    console.note(imported.error());
    return kExitBad;
  }
  if (options.output.empty()) {
    console.print(imported->text);
  } else if (const Result<void> written = write_text(options.output, imported->text); !written) {
    console.note(written.error());
    return kExitBad;
  }
  for (const std::string &remark : imported->remarks) console.note("note: " + remark + "\n");
  if (!options.output.empty()) console.note(fmt::format("wrote {}\n", options.output));
  console.note(fmt::format("to be filled in: {} values, each written as TODO\n", imported->to_fill_in));
  return kExitOk;
}

}  // namespace

Action add_import(CLI::App &app) {
  auto options = std::make_shared<ImportOptions>();
  app.add_option("FILE", options->file,
                 "Configuration of callback_isolated_executor (YAML): its template, or an edited one; - reads standard "
                 "input")
      ->type_name("FILE")
      ->required();
  app.add_option("-o,--output", options->output, "File to write (default: standard output)")->type_name("FILE");
  return [options](Console &console) { return import_configuration(*options, console); };
}

}  // namespace redag::cli
