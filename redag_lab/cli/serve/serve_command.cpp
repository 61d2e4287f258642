// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <thread>

#include "redag/live/writer.hpp"
#include "redag_lab/cli/serve/access.hpp"
#include "redag_lab/cli/serve/live_server.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

constexpr std::uint32_t kPort = 8642;

struct ServeArguments {
  std::uint32_t port = kPort;
  Duration interval = kSecond;
  std::string folder = live::kFolder;
  std::string token_file;
};

int serve(const ServeArguments &options, Console &console) {
  const InterruptGuard guard;
  const Result<std::string> token = options.token_file.empty() ? make_token() : read_token(options.token_file);
  if (!token) {
    console.note(token.error());
    return kExitBad;
  }
  const auto server = LiveServer::start({.folder = options.folder,
                                         .interval = options.interval,
                                         .port = static_cast<int>(options.port),
                                         .token = *token});
  if (!server) {
    console.note(server.error());
    return kExitBad;
  }
  console.print((*server)->address() + "\n");
  if (!console.flush()) return kExitBad;
  console.note("open this address in a browser of this machine; Ctrl-C ends\n");
  while (!InterruptGuard::interrupted()) {
    if (!(*server)->is_running()) {
      console.error("the server has lost its socket");
      return kExitBad;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return kExitOk;
}

}  // namespace

Action add_serve(CLI::App &app) {
  auto options = std::make_shared<ServeArguments>();
  add_count(app, "--port", options->port, Range<std::uint32_t>{0, 65535}, "Port on 127.0.0.1; 0: a free one");
  add_duration(app, "--interval", options->interval, "Time between two updates");
  add_pages_folder(app, options->folder);
  app.add_option("--token-file", options->token_file, "File with the token, instead of a new one at each start")
      ->type_name("FILE");
  return [options](Console &console) { return serve(*options, console); };
}

}  // namespace redag::cli
