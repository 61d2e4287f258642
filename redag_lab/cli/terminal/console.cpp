// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/console.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>

#include "redag/base/text.hpp"
#include "redag/base/write_all.hpp"
#include "redag_analysis/text/tint.hpp"
#include "redag_analysis/text/wrap.hpp"

namespace redag::cli {
namespace {

constexpr std::size_t kBufferSize = std::size_t{1} << 20U;

// The value of COLUMNS, as POSIX defines it: a positive number, or else it counts as unset.
std::size_t columns_asked_for() {
  const char *columns = std::getenv("COLUMNS");
  if (columns == nullptr) return 0;
  const std::string_view text = columns;
  std::uint16_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? number : 0;
}

StreamTraits traits_of(int descriptor) {
  StreamTraits traits;
  traits.terminal = isatty(descriptor) == 1;
  traits.width = columns_asked_for();
  if (!traits.terminal) return traits;
  const char *no_color = std::getenv("NO_COLOR");  // https://no-color.org: set and not empty
  const char *term = std::getenv("TERM");
  traits.colour = (no_color == nullptr || *no_color == '\0') && term != nullptr && std::strcmp(term, "dumb") != 0;
  if (traits.width > 0) return traits;
  winsize size{};
  traits.width = ioctl(descriptor, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
  return traits;
}

// Returns the length of one of our own control sequences at `at`, or 0. They are colours, and return to the start of
// the line with clearing.
std::size_t own_sequence(std::string_view text, std::size_t at) {
  constexpr std::string_view kClearLine = "\r\033[K";
  const std::string_view rest = text.substr(at);
  if (rest.starts_with(kClearLine)) return kClearLine.size();
  if (!rest.starts_with("\033[")) return 0;
  const std::size_t end = rest.find_first_not_of("0123456789;", 2);
  return end != std::string_view::npos && rest[end] == 'm' ? end + 1 : 0;
}

// Escapes a text for the terminal. Names of files and other external texts must not control the terminal.
std::string for_terminal(std::string_view text) {
  std::string shown;
  for (std::size_t at = 0; at < text.size();) {
    if (const std::size_t length = own_sequence(text, at); length > 0) {
      shown += text.substr(at, length);
      at += length;
      continue;
    }
    const std::size_t end = std::min(text.find_first_of("\r\033", at + 1), text.size());
    shown += printable(text.substr(at, end - at));
    at = end;
  }
  return shown;
}

}  // namespace

Console::Console(int out, StreamTraits out_traits, int err, StreamTraits err_traits)
    : out_(out), err_(err), out_traits_(out_traits), err_traits_(err_traits) {}

Console::Console() : Console(STDOUT_FILENO, traits_of(STDOUT_FILENO), STDERR_FILENO, traits_of(STDERR_FILENO)) {}

void Console::say(std::string_view text) { print(fitted(text, out_traits_.width)); }

void Console::print(std::string_view text) {
  if (out_traits_.terminal) {
    buffer_ += for_terminal(text);
  } else {
    buffer_.append(text);
  }
  if (buffer_.size() < kBufferSize) return;
  write_out(buffer_);
  buffer_.clear();
}

void Console::note(std::string_view text) {
  if (err_traits_.terminal) {
    write_all(err_, for_terminal(text));
  } else {
    write_all(err_, text);
  }
}

void Console::note(const Diagnostic &diagnostic) {
  const bool is_error = diagnostic.severity == Severity::Error;
  std::string text = diagnostic.to_string();
  // Only the severity is coloured: the place must stay clickable.
  const std::string_view word = is_error ? "error:" : "warning:";
  const std::size_t at = text.find(word, diagnostic.file.size());
  if (err_traits_.colour && at != std::string::npos) {
    text.replace(at, word.size(), tinted(word, is_error ? Tint::Bad : Tint::Caution, true));
  }
  note(text + "\n");
}

void Console::note(const Diagnostics &diagnostics) {
  for (const Diagnostic &diagnostic : diagnostics) note(diagnostic);
}

void Console::warn(std::string_view message, std::string_view hint) {
  note(Diagnostic{Severity::Warning, {}, 0, 0, std::string(message), std::string(hint)});
}

void Console::error(std::string_view message, std::string_view hint) {
  note(Diagnostic{Severity::Error, {}, 0, 0, std::string(message), std::string(hint)});
}

void Console::write_out(std::string_view text) {
  if (error_ == 0) error_ = write_all(out_, text);
}

bool Console::flush() {
  write_out(buffer_);
  buffer_.clear();
  if (error_ == 0 || error_ == EPIPE) return true;
  error(fmt::format("standard output: {}", std::strerror(error_)));
  return false;
}

}  // namespace redag::cli
