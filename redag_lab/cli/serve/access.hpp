// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Who may see what `redag serve` serves: who knows the token, and asks for it by the server's own name. Values and pure
// functions, except make_token() and read_token().
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::cli {

/// Returns 256 random bits of the kernel as hexadecimal digits. Error: the kernel gives none.
[[nodiscard]] Result<std::string> make_token();

/// Reads a token that programs share with the server. Error: the file cannot be read, others than its owner and group
/// may open it, or the token is easy to guess.
[[nodiscard]] Result<std::string> read_token(const std::string &path);

/// Compares in a time that depends on the lengths only.
[[nodiscard]] bool is_same_secret(std::string_view given, std::string_view secret) noexcept;

/// Returns the value of a cookie in the header Cookie; "" if it is not there.
[[nodiscard]] std::string cookie_value(std::string_view header, std::string_view name);

/// What a request says about itself.
struct Credentials {
  std::string method = {};
  std::string path = {};
  std::size_t hosts = 0;  // how many Host headers there are
  std::string host = {};
  std::string token = {};          // the query's
  std::string cookie = {};         // the header Cookie
  std::string authorization = {};  // the header Authorization
};

enum class Access : std::uint8_t {
  Granted,
  Introduced,   // the page's address with the right token: the browser gets a cookie, and the address without it
  WrongHost,    // another name of this machine, as after DNS rebinding
  WrongMethod,  // there is nothing to change
  Denied,
};

/// Decides about requests to a server on a port of the loopback device.
class Gate {
 public:
  Gate(std::string token, int port) : token_(std::move(token)), port_(port) {}

  [[nodiscard]] Access judge(const Credentials &request) const;

  /// Cookies of one host are shared by its ports. The name has the port, so that two servers do not fight.
  [[nodiscard]] std::string cookie_name() const { return "redag-" + std::to_string(port_); }
  /// Returns the header Set-Cookie.
  [[nodiscard]] std::string cookie() const;

 private:
  [[nodiscard]] bool is_own_name(std::string_view host) const;

  std::string token_;
  int port_;
};

}  // namespace redag::cli
