// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <csignal>
#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/program.hpp"

int main(int argc, char **argv) {
  // A reader that leaves early (`| head`) must not end a run before its files are written; the write reports an error
  // instead. The same holds for a file at its size limit (ulimit -f).
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  redag::cli::Console console;
  return redag::cli::run_program(std::vector<std::string>(argv + (argc > 0 ? 1 : 0), argv + argc), console);
}
