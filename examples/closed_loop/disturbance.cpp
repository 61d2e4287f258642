// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "disturbance.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <sstream>
#include <stdexcept>

namespace closed_loop {
namespace {

constexpr int kPollEvery = 10'000;  // us
constexpr int kPatience = 300;      // polls before SIGKILL
constexpr int kFirstLook = 30;      // polls; a program that rejects its arguments ends within them

}  // namespace

std::vector<std::string> stress_ng(const std::string &arguments) {
  std::vector<std::string> words = {"stress-ng", "--quiet", "--timeout", "0"};  // timeout 0: runs without end
  std::istringstream rest(arguments);
  for (std::string word; rest >> word;) words.push_back(word);
  return words;
}

Disturbance::Disturbance(std::vector<std::string> words) : name_(words.at(0)) {
  std::vector<char *> argv;
  argv.reserve(words.size() + 1);
  for (std::string &word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  int failure[2] = {-1, -1};  // carries errno of a failed exec; a successful exec closes it
  if (::pipe2(failure, O_CLOEXEC) != 0)
    throw std::runtime_error(std::string("cannot create a pipe: ") + std::strerror(errno));
  const pid_t parent = ::getpid();
  child_ = ::fork();
  if (child_ == 0) {
    // Between fork and exec in a program with threads, only async-signal-safe calls are allowed.
    ::setpgid(0, 0);  // Ctrl-C in a terminal then reaches this program only, which ends its child
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != parent) ::_exit(1);
    ::execvp(argv[0], argv.data());
    const int error = errno;
    static_cast<void>(!::write(failure[1], &error, sizeof error));
    ::_exit(1);
  }
  const int fork_error = errno;
  ::close(failure[1]);
  int error = 0;
  ssize_t got = 0;
  if (child_ > 0) {
    do got = ::read(failure[0], &error, sizeof error);
    while (got < 0 && errno == EINTR);
  }
  ::close(failure[0]);
  if (child_ < 0) {
    throw std::runtime_error("cannot start " + name_ + ": " + std::strerror(fork_error));
  }
  if (got > 0) {
    ::waitpid(child_, nullptr, 0);
    throw std::runtime_error("cannot start " + name_ + ": " + std::strerror(error) +
                             (error == ENOENT ? " (Debian and Ubuntu: apt-get install " + name_ + ")" : ""));
  }
  for (int i = 0; i < kFirstLook; ++i) {
    expect_running();
    ::usleep(kPollEvery);
  }
}

Disturbance::~Disturbance() {
  if (child_ == 0) return;
  ::kill(-child_, SIGTERM);
  for (int i = 0; i < kPatience && !has_ended(); ++i) ::usleep(kPollEvery);
  if (child_ == 0) return;
  ::kill(-child_, SIGKILL);
  while (::waitpid(child_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

bool Disturbance::has_ended() {
  if (child_ == 0) return true;
  if (::waitpid(child_, nullptr, WNOHANG) != child_) return false;
  ::kill(-child_, SIGKILL);  // kills the remaining members of the group
  child_ = 0;
  return true;
}

void Disturbance::expect_running() {
  if (has_ended()) throw std::runtime_error(name_ + " has ended before the experiment was over");
}

}  // namespace closed_loop
