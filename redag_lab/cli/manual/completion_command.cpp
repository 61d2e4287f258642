// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <memory>
#include <string>

#include "redag_lab/cli/manual/completion.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"

namespace redag::cli {
namespace {

using Writer = std::string (*)(const CommandText &);

struct CompletionOptions {
  Writer write = nullptr;
  std::string output;
};

}  // namespace

Action add_completion(CLI::App &app) {
  auto options = std::make_shared<CompletionOptions>();
  add_choice(app, "SHELL", options->write,
             Choices<Writer>{{"bash", bash_completion}, {"zsh", zsh_completion}, {"fish", fish_completion}}, "Shell")
      ->required();
  app.add_option("-o,--output", options->output, "File to write (default: standard output)")->type_name("FILE");
  return [options, &app](Console &console) {
    const std::string script = options->write(describe(*app.get_parent()));
    if (options->output.empty()) {
      console.print(script);
      return kExitOk;
    }
    if (const Result<void> written = write_text(options->output, script); !written) {
      console.note(written.error());
      return kExitBad;
    }
    return kExitOk;
  };
}

}  // namespace redag::cli
