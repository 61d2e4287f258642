// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Serves the live pages of this machine to Prometheus. Needs a build with REDAG_PROMETHEUS; without it, the functions
// return the error that says so.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::cli {

/// Where to listen.
struct Endpoint {
  std::string host = "127.0.0.1";  // a numeric address
  std::uint16_t port = 9464;       // 0: any that is free

  [[nodiscard]] bool is_loopback() const;
  /// "127.0.0.1:9464", "[::1]:9464"
  [[nodiscard]] std::string text() const;
  friend bool operator==(const Endpoint &, const Endpoint &) = default;
};

/// Reads "HOST:PORT", "HOST", "PORT" or "[IPV6]:PORT". HOST is a numeric address or localhost.
[[nodiscard]] Result<Endpoint> parse_endpoint(std::string_view text);

/// Returns the metrics of the pages in `folder` once, in Prometheus's text format.
[[nodiscard]] Result<std::string> prometheus_text(const std::string &folder);

/// Answers http://HOST:PORT/metrics until `stop`. Calls `ready` with the endpoint once it listens.
[[nodiscard]] Result<void> serve_prometheus(const std::string &folder, const Endpoint &endpoint,
                                            const std::atomic<bool> &stop,
                                            const std::function<void(const Endpoint &)> &ready);

}  // namespace redag::cli
