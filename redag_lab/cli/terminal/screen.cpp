// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/screen.hpp"

#define NCURSES_NOMACROS  // its functions, not macros of common names
#include <curses.h>
#include <langinfo.h>
#include <poll.h>
#include <term.h>
#include <termios.h>
#include <unistd.h>
// <term.h> has macros for the capabilities of terminals.
#undef columns
#undef lines

#include <algorithm>
#include <array>
#include <cerrno>
#include <clocale>
#include <csignal>
#include <cstring>
#include <string>
#include <string_view>

#include "redag/base/check.hpp"

namespace redag::cli {
namespace {

constexpr std::array kFatal{SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT, SIGHUP, SIGQUIT, SIGPIPE};
constexpr int kEscapeDelay = 50;  // ms that the rest of a key's sequence may take

// How the terminal was, for the handlers. Written before the handlers are installed.
termios old_terminal{};
std::string leaving;  // what the terminal is sent
volatile std::sig_atomic_t is_taken = 0;
std::array<struct sigaction, kFatal.size()> old_fatal{};

// Restores the terminal and raises the signal again. SA_RESETHAND has removed this handler, and the previous action
// follows. Async-signal-safe: write and tcsetattr.
void on_fatal(int number) {
  if (is_taken != 0) {
    is_taken = 0;
    (void)!::write(STDOUT_FILENO, leaving.data(), leaving.size());
    (void)tcsetattr(STDIN_FILENO, TCSANOW, &old_terminal);
  }
  ::raise(number);
}

// The program writes UTF-8. The C library has to know, for which the "C" locale of a container is not enough.
void expect_utf8() {
  (void)std::setlocale(LC_CTYPE, "");
  if (std::strcmp(::nl_langinfo(CODESET), "UTF-8") != 0) (void)std::setlocale(LC_CTYPE, "C.UTF-8");
}

/// Returns what a terminal is sent for a capability, or "" if it has none.
std::string sequence_of(const char *capability) {
  const char *const text = ::tigetstr(capability);
  const auto *const absent =
      reinterpret_cast<const char *>(std::intptr_t{-1});  // NOLINT(performance-no-int-to-ptr): as ncurses says
  return text == nullptr || text == absent ? std::string() : std::string(text);
}

// Returns what a code of tinted() means, such as "31" of "\033[31m".
attr_t attributes_of(std::string_view code) {
  if (code == "1") return A_BOLD;
  if (code == "2") return A_DIM;
  const bool is_colour = code.size() == 2 && code[0] == '3' && code[1] >= '1' && code[1] <= '3';
  return is_colour && ::has_colors() ? static_cast<attr_t>(COLOR_PAIR(code[1] - '0')) : attr_t{A_NORMAL};
}

KeyPress press_of(int code) {
  constexpr int kEscape = 27;
  switch (code) {
    case KEY_UP: return {Key::Up};
    case KEY_DOWN: return {Key::Down};
    case KEY_PPAGE: return {Key::PageUp};
    case KEY_NPAGE: return {Key::PageDown};
    case KEY_HOME: return {Key::Home};
    case KEY_END: return {Key::End};
    case '\t': return {Key::Tab};
    case KEY_ENTER:
    case '\r':
    case '\n': return {Key::Enter};
    case kEscape: return {Key::Escape};
    default: break;
  }
  if (code >= 0x20 && code < 0x7f) return {Key::Text, static_cast<char>(code)};
  return {};
}

}  // namespace

bool Screen::is_possible() {
  if (isatty(STDIN_FILENO) != 1 || isatty(STDOUT_FILENO) != 1) return false;
  int found = 0;
  if (::setupterm(nullptr, STDOUT_FILENO, &found) != OK) return false;
  const bool can_move = !sequence_of("cup").empty();
  (void)::del_curterm(cur_term);
  return can_move;
}

Screen::Screen(bool colour) {
  (void)tcgetattr(STDIN_FILENO, &old_terminal);
  expect_utf8();
  (void)::set_escdelay(kEscapeDelay);
  REDAG_CHECK(::initscr() != nullptr, "a terminal that was possible is not");
  leaving = sequence_of("sgr0") + sequence_of("cnorm") + sequence_of("rmcup");
  is_taken = 1;
  struct sigaction fatal {};
  fatal.sa_handler = on_fatal;
  fatal.sa_flags = static_cast<int>(SA_RESETHAND);
  sigemptyset(&fatal.sa_mask);
  for (std::size_t i = 0; i < kFatal.size(); ++i) sigaction(kFatal[i], &fatal, &old_fatal[i]);

  (void)::cbreak();
  (void)::noecho();
  (void)::nonl();
  (void)::curs_set(0);
  (void)::keypad(stdscr, TRUE);
  (void)::nodelay(stdscr, TRUE);
  if (colour && ::has_colors() && ::start_color() == OK) {
    const short background = ::use_default_colors() == OK ? short{-1} : short{COLOR_BLACK};
    // The number of a pair is that of the colour in tinted()'s codes.
    for (const short hue : {short{COLOR_RED}, short{COLOR_GREEN}, short{COLOR_YELLOW}})
      (void)::init_pair(hue, hue, background);
  }
}

Screen::~Screen() {
  is_taken = 0;
  (void)::endwin();
  for (std::size_t i = 0; i < kFatal.size(); ++i) sigaction(kFatal[i], &old_fatal[i], nullptr);
}

Screen::Size Screen::size() const {
  return {static_cast<std::size_t>(std::max(::getmaxx(stdscr), 1)),
          static_cast<std::size_t>(std::max(::getmaxy(stdscr), 1))};
}

void Screen::draw(const std::vector<std::string> &lines) {
  (void)::erase();
  const std::size_t room = std::min(lines.size(), size().lines);
  for (std::size_t i = 0; i < room; ++i) {
    (void)::move(static_cast<int>(i), 0);
    (void)::attrset(A_NORMAL);
    std::string_view rest = lines[i];
    while (!rest.empty()) {
      if (rest.starts_with("\033[")) {
        const std::size_t end = std::min(rest.find('m'), rest.size() - 1);
        (void)::attrset(static_cast<int>(attributes_of(rest.substr(2, end - 2))));
        rest.remove_prefix(end + 1);
      }
      const std::size_t text = std::min(rest.find("\033["), rest.size());
      // Fails at the last column of the last line, after having written it.
      (void)::addnstr(rest.data(), static_cast<int>(text));
      rest.remove_prefix(text);
    }
  }
  (void)::refresh();
}

KeyPress Screen::wait(Duration timeout) {
  // Keys that came together are in ncurses' buffer, of which poll() does not know.
  if (const int code = ::getch(); code != ERR) return press_of(code);
  pollfd input{STDIN_FILENO, POLLIN, 0};
  const auto milliseconds = static_cast<int>(std::clamp<Duration>(timeout / kMillisecond, 0, 60'000));
  const int ready = ::poll(&input, 1, milliseconds);
  const int code = ::getch();  // also after a signal, which can be a change of the size
  if (code != ERR) return press_of(code);
  // Readable without a byte to read: hung up.
  if (ready > 0) return {(input.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0 ? Key::Closed : Key::None};
  return {};
}

}  // namespace redag::cli
