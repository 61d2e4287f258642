// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/screen.hpp"

#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string_view>

namespace redag::cli {
namespace {

constexpr std::string_view kEnter = "\033[?1049h\033[?25l\033[?7l";  // alternate screen, no cursor, no line wrap
constexpr std::string_view kLeave = "\033[?7h\033[?25h\033[0m\033[?1049l";
constexpr std::array kFatal{SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT, SIGHUP, SIGQUIT, SIGPIPE};

// The terminal's previous state, for the handlers. Written before the handlers are installed.
termios old_terminal{};
volatile std::sig_atomic_t is_taken = 0;
volatile std::sig_atomic_t was_resized = 0;
std::array<struct sigaction, kFatal.size()> old_fatal{};
struct sigaction old_resize {};

bool write_all(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(STDOUT_FILENO, text.data(), text.size());
    if (written < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

// Restores the terminal. Async-signal-safe: write and tcsetattr.
void give_back() {
  if (is_taken == 0) return;
  is_taken = 0;
  (void)write_all(kLeave);
  (void)tcsetattr(STDIN_FILENO, TCSANOW, &old_terminal);
}

// Restores the terminal and raises the signal again. SA_RESETHAND has removed this handler, and the previous action
// follows.
void on_fatal(int number) {
  give_back();
  ::raise(number);
}

void on_resize(int) { was_resized = 1; }

}  // namespace

bool Screen::is_possible() {
  const char *term = std::getenv("TERM");
  return isatty(STDIN_FILENO) == 1 && isatty(STDOUT_FILENO) == 1 && term != nullptr && std::strcmp(term, "dumb") != 0;
}

Screen::Screen() {
  (void)tcgetattr(STDIN_FILENO, &old_terminal);
  is_taken = 1;
  struct sigaction fatal {};
  fatal.sa_handler = on_fatal;
  fatal.sa_flags = static_cast<int>(SA_RESETHAND);
  sigemptyset(&fatal.sa_mask);
  for (std::size_t i = 0; i < kFatal.size(); ++i) sigaction(kFatal[i], &fatal, &old_fatal[i]);
  struct sigaction resize {};
  resize.sa_handler = on_resize;
  sigemptyset(&resize.sa_mask);
  sigaction(SIGWINCH, &resize, &old_resize);

  termios raw = old_terminal;
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  raw.c_cc[VMIN] = 0;
  raw.c_cc[VTIME] = 0;
  raw.c_cc[VSUSP] = _POSIX_VDISABLE;  // a stopped program would leave the terminal in our mode
  (void)tcsetattr(STDIN_FILENO, TCSANOW, &raw);
  (void)write_all(kEnter);
}

Screen::~Screen() {
  give_back();
  for (std::size_t i = 0; i < kFatal.size(); ++i) sigaction(kFatal[i], &old_fatal[i], nullptr);
  sigaction(SIGWINCH, &old_resize, nullptr);
}

Screen::Size Screen::size() const {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) return {};
  return {size.ws_col, size.ws_row};
}

bool Screen::draw(const std::vector<std::string> &lines) {
  const std::size_t room = std::min(lines.size(), size().lines);
  std::string text = "\033[H";
  for (std::size_t i = 0; i < room; ++i) {
    // Erases before writing: after a line as wide as the terminal the cursor is still on its last character.
    const bool last = i + 1 == room;
    text += (last ? "\033[J" : "\033[K") + lines[i] + (last ? "" : "\r\n");
  }
  return write_all(text);
}

KeyPress Screen::wait(Duration timeout) {
  if (was_resized != 0) {
    was_resized = 0;
    return {Key::Resize};
  }
  if (!pending_.empty()) return take_key(pending_);
  pollfd input{STDIN_FILENO, POLLIN, 0};
  const auto milliseconds = static_cast<int>(std::clamp<Duration>(timeout / kMillisecond, 0, 60'000));
  const int ready = ::poll(&input, 1, milliseconds);
  if (ready <= 0) return {was_resized != 0 ? Key::Resize : Key::None};
  std::array<char, 256> bytes{};
  const ssize_t got = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  if (got < 0 && (errno == EINTR || errno == EAGAIN)) return {};
  if (got <= 0) return {Key::Closed};
  pending_.assign(bytes.data(), static_cast<std::size_t>(got));
  return take_key(pending_);
}

KeyPress take_key(std::string &bytes) {
  struct Sequence {
    std::string_view bytes;
    Key key;
  };
  static constexpr std::array<Sequence, 12> kSequences{{{"\033[A", Key::Up},
                                                        {"\033[B", Key::Down},
                                                        {"\033OA", Key::Up},
                                                        {"\033OB", Key::Down},
                                                        {"\033[5~", Key::PageUp},
                                                        {"\033[6~", Key::PageDown},
                                                        {"\033[H", Key::Home},
                                                        {"\033[F", Key::End},
                                                        {"\033[1~", Key::Home},
                                                        {"\033[4~", Key::End},
                                                        {"\r", Key::Enter},
                                                        {"\n", Key::Enter}}};
  for (const Sequence &sequence : kSequences) {
    if (bytes.compare(0, sequence.bytes.size(), sequence.bytes) != 0) continue;
    bytes.erase(0, sequence.bytes.size());
    return {sequence.key};
  }
  if (bytes.empty()) return {};
  if (bytes[0] == '\033') {
    const bool alone = bytes.size() == 1;
    bytes.clear();  // an unknown sequence must not be read as letters
    return {alone ? Key::Escape : Key::None};
  }
  const char text = bytes[0];
  bytes.erase(0, 1);
  const auto code = static_cast<unsigned char>(text);
  if (code < 0x20 || code >= 0x7f) return {};
  return {Key::Text, text};
}

}  // namespace redag::cli
