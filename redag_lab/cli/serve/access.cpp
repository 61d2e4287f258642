// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/serve/access.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <fstream>
#include <system_error>

namespace redag::cli {

Result<std::string> make_token() {
  std::array<unsigned char, 32> bytes{};
  if (::getentropy(bytes.data(), bytes.size()) != 0) {
    return make_error("the kernel gives no random numbers for the token: " + std::generic_category().message(errno));
  }
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

Result<std::string> read_token(const std::string &path) {
  struct stat status {};
  std::ifstream file(path);
  std::string token;
  if (!file || ::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) {
    return make_error(fmt::format("{}: the token cannot be read", path), "make one: openssl rand -hex 32 > FILE");
  }
  if ((status.st_mode & S_IRWXO) != 0) {
    return make_error(fmt::format("{}: every user of this machine can read the token", path),
                      fmt::format("chmod 600 {0}, or 640 and the group of the program that reads it", path));
  }
  file >> token;
  const bool is_plain = std::all_of(token.begin(), token.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
  constexpr std::size_t kLeast = 32;
  constexpr std::size_t kMost = 256;  // a header has room for it
  if (token.size() < kLeast || token.size() > kMost || !is_plain) {
    return make_error(fmt::format("{}:1: a token has {} to {} letters and digits", path, kLeast, kMost),
                      "make one: openssl rand -hex 32 > FILE");
  }
  return token;
}

bool is_same_secret(std::string_view given, std::string_view secret) noexcept {
  if (given.size() != secret.size() || secret.empty()) return false;
  // Volatile: a compiler must not end the loop at the first difference.
  volatile unsigned char difference = 0;
  for (std::size_t i = 0; i < secret.size(); ++i) {
    difference = difference | static_cast<unsigned char>(given[i] ^ secret[i]);
  }
  return difference == 0;
}

std::string cookie_value(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    const std::size_t end = std::min(header.find(';'), header.size());
    std::string_view pair = header.substr(0, end);
    header.remove_prefix(std::min(end + 1, header.size()));
    pair.remove_prefix(std::min(pair.find_first_not_of(' '), pair.size()));
    if (pair.size() > name.size() && pair.substr(0, name.size()) == name && pair[name.size()] == '=') {
      return std::string(pair.substr(name.size() + 1));
    }
  }
  return {};
}

bool Gate::is_own_name(std::string_view host) const {
  const std::string port = fmt::format(":{}", port_);
  return host == "127.0.0.1" + port || host == "localhost" + port;
}

Access Gate::judge(const Credentials &request) const {
  if (request.hosts != 1 || !is_own_name(request.host)) return Access::WrongHost;
  if (request.method != "GET" && request.method != "HEAD") return Access::WrongMethod;
  if (request.path == "/" && is_same_secret(request.token, token_)) return Access::Introduced;
  if (is_same_secret(cookie_value(request.cookie, cookie_name()), token_)) return Access::Granted;
  if (is_same_secret(request.authorization, "Bearer " + token_)) return Access::Granted;
  return Access::Denied;
}

std::string Gate::cookie() const {
  return fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict", cookie_name(), token_);
}

}  // namespace redag::cli
