// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The HTTP server of `redag serve`: the page, its files, the stream of states, and metrics. It listens on the loopback
// device, changes nothing, and answers only who knows the token.
//
// Threads: a fixed number answers requests; the object is used by one thread.
#pragma once

#include <memory>
#include <string>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag::cli {

struct ServeOptions {
  std::string folder;  // of the live pages
  Duration interval = kSecond;
  int port = 0;  // 0: a free one
  std::string token;
};

class LiveServer {
 public:
  /// How many can watch at a time.
  static constexpr unsigned kWatchers = 8;

  /// Error: the port cannot be had.
  [[nodiscard]] static Result<std::unique_ptr<LiveServer>> start(const ServeOptions &options);
  virtual ~LiveServer() = default;
  LiveServer(const LiveServer &) = delete;
  LiveServer &operator=(const LiveServer &) = delete;

  /// Returns the address that opens the page.
  [[nodiscard]] virtual std::string address() const = 0;
  /// Returns false once the server has stopped by itself, because the system takes its socket away.
  [[nodiscard]] virtual bool is_running() const = 0;

 protected:
  LiveServer() = default;
};

}  // namespace redag::cli
