// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/help.hpp"

#include <gtest/gtest.h>

namespace redag::cli {
namespace {

TEST(Help, WrapsDescriptionsAndNamesDefaultsAndConditions) {
  CLI::App app("Does something.", "prog");
  app.formatter(std::make_shared<HelpFormatter>());
  std::string file;
  std::string folder;
  bool force = false;
  app.add_option("FILE", file, "Input file")->required();
  CLI::Option *out = app.add_option("-o,--output", folder, "A folder, described in so many words that they wrap");
  out->type_name("DIR")->default_str("out");
  CLI::Option *quiet = app.add_flag("--quiet", force, "Say nothing");
  app.add_flag("--overwrite-everything-there", force, "Overwrite")->needs(out)->excludes(quiet);
  app.add_flag("--explore{3}", file, "Look around")->type_name("[=STEPS]");
  app.add_flag("--secret", force, "Not shown")->group("");
  app.footer("Examples:\n  prog x");
  EXPECT_EQ(app.help(), R"(Does something.

Usage: prog [OPTIONS] FILE

Arguments:
  FILE                      Input file

Options:
  -h, --help                Print this help message and exit
  -o, --output DIR          A folder, described in so many words that they wrap
                            (default: out)
  --quiet                   Say nothing (not with --overwrite-everything-there)
  --overwrite-everything-there
                            Overwrite (needs --output; not with --quiet)
  --explore[=STEPS]         Look around

Examples:
  prog x
)");
}

TEST(Help, ListsCommands) {
  CLI::App app("Does things.", "prog");
  app.formatter(std::make_shared<HelpFormatter>());
  app.add_subcommand("one", "The first");
  EXPECT_NE(app.help().find("\nCommands:\n  one                       The first\n"), std::string::npos);
}

TEST(Help, FitsANarrowTerminal) {
  CLI::App app("Does something that takes more words than a narrow terminal has room for.", "prog");
  app.formatter(std::make_shared<HelpFormatter>(40));
  std::string file;
  app.add_option("--file", file, "A file, described in so many words that they wrap")->type_name("FILE");
  app.footer("Exit status: 0 success; 1 negative result, such as a missed deadline.");
  EXPECT_EQ(app.help(), R"(Does something that takes more words
than a narrow terminal has room for.

Usage: prog [OPTIONS]

Options:
  -h, --help
      Print this help message and exit
  --file FILE
      A file, described in so many words
      that they wrap

Exit status: 0 success; 1 negative
  result, such as a missed deadline.
)");
}

TEST(Help, LeavesLongWordsWhole) {
  CLI::App app(std::string(100, 'x') + " y", "prog");
  app.formatter(std::make_shared<HelpFormatter>());
  EXPECT_EQ(app.help().substr(0, 103), std::string(100, 'x') + "\ny\n");
}

}  // namespace
}  // namespace redag::cli
