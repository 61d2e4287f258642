// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "common_start.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <utility>

#include "phased_timer.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::Duration;
using redag::Time;

constexpr int kLookEvery = 1000;  // ms, for an interrupt that came just before the wait

// A descriptor, closed at the end.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  Descriptor(Descriptor &&other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor &operator=(Descriptor &&other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { close(); }
  void close() {
    if (number_ >= 0) ::close(std::exchange(number_, -1));
  }
  [[nodiscard]] int get() const { return number_; }

 private:
  int number_;
};

struct Pipe {
  Descriptor read;
  Descriptor write;
};

redag::Result<Pipe> make_pipe() {
  std::array<int, 2> ends{};
  // The flag keeps a process from holding the pipes of its siblings, whose ends it would hide.
  if (pipe2(ends.data(), O_CLOEXEC) != 0) {
    return redag::make_error(fmt::format("cannot make a pipe: {}", std::strerror(errno)));
  }
  return Pipe{Descriptor(ends[0]), Descriptor(ends[1])};
}

class Process {
 public:
  static redag::Result<Process> start(const std::vector<std::string> &command) {
    redag::Result<Pipe> in = make_pipe();
    redag::Result<Pipe> out = make_pipe();
    if (!in) return tl::unexpected(in.error());
    if (!out) return tl::unexpected(out.error());
    std::vector<char *> arguments;
    for (const std::string &word : command) arguments.push_back(const_cast<char *>(word.c_str()));
    arguments.push_back(nullptr);
    const pid_t id = fork();
    if (id < 0) return redag::make_error(fmt::format("cannot start a process: {}", std::strerror(errno)));
    if (id == 0) {
      constexpr int kCannotRun = 127;  // as a shell says it
      dup2(in->read.get(), STDIN_FILENO);
      dup2(out->write.get(), STDOUT_FILENO);
      execv(arguments[0], arguments.data());
      _exit(kCannotRun);
    }
    Process process;
    process.id_ = id;
    process.in_ = std::move(in->write);
    process.out_ = std::move(out->read);
    return process;
  }

  Process(Process &&other) noexcept
      : id_(std::exchange(other.id_, -1)),
        in_(std::move(other.in_)),
        out_(std::move(other.out_)),
        ready_(other.ready_),
        said_(std::move(other.said_)) {}
  Process &operator=(Process &&) = delete;
  ~Process() { (void)end(); }

  [[nodiscard]] int output() const { return out_.get(); }
  [[nodiscard]] bool ready() const { return ready_; }
  void interrupt() const { kill(id_, SIGINT); }

  void begin(Time start) {
    const std::string line = fmt::format("start {}\n", start);
    // A process that has just ended does not read. Its end shows as the end of its output.
    [[maybe_unused]] const ssize_t written = write(in_.get(), line.data(), line.size());
    in_.close();
  }
  void call_off() { in_.close(); }

  /// Takes what the process printed. False: its output is over.
  bool read_output() {
    std::array<char, 512> text{};
    const ssize_t size = read(out_.get(), text.data(), text.size());
    if (size < 0) return errno == EINTR;
    if (!ready_) said_.append(text.data(), static_cast<std::size_t>(size));
    ready_ = ready_ || said_.rfind("ready\n", 0) == 0;
    if (size == 0) out_.close();
    return size > 0;
  }

  /// Waits for the end of the process.
  int end() {
    if (id_ <= 0) return -1;
    in_.close();
    int status = 0;
    while (waitpid(id_, &status, 0) < 0 && errno == EINTR) {
    }
    id_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  Process() = default;

  pid_t id_ = -1;
  Descriptor in_;
  Descriptor out_;
  bool ready_ = false;
  std::string said_;
};

// Ignores SIGPIPE while it lives: a process can end between its "ready" and its start.
class IgnoredPipeSignal {
 public:
  IgnoredPipeSignal() {
    struct sigaction ignore {};
    ignore.sa_handler = SIG_IGN;
    sigaction(SIGPIPE, &ignore, &before_);
  }
  ~IgnoredPipeSignal() { sigaction(SIGPIPE, &before_, nullptr); }
  IgnoredPipeSignal(const IgnoredPipeSignal &) = delete;
  IgnoredPipeSignal &operator=(const IgnoredPipeSignal &) = delete;

 private:
  struct sigaction before_ {};
};

}  // namespace

redag::Result<std::vector<int>> run_together(const std::vector<std::vector<std::string>> &commands, Duration margin,
                                             bool (*interrupted)()) {
  std::vector<Process> processes;
  processes.reserve(commands.size());
  for (const std::vector<std::string> &command : commands) {
    redag::Result<Process> process = Process::start(command);
    if (!process) return tl::unexpected(process.error());  // the others read the end of their input
    processes.push_back(std::move(*process));
  }
  const IgnoredPipeSignal ignored;
  std::vector<bool> alive(processes.size(), true);
  bool begun = false;
  bool called_off = false;
  bool told = false;
  while (std::find(alive.begin(), alive.end(), true) != alive.end()) {
    std::vector<pollfd> watched;
    for (const Process &process : processes) watched.push_back({process.output(), POLLIN, 0});
    const int found = poll(watched.data(), watched.size(), kLookEvery);
    if (!told && interrupted()) {
      told = true;
      called_off = !begun;
      for (std::size_t i = 0; i < processes.size(); ++i) {
        if (alive[i]) processes[i].interrupt();
      }
    }
    for (std::size_t i = 0; found > 0 && i < processes.size(); ++i) {
      if (alive[i] && watched[i].revents != 0) alive[i] = processes[i].read_output();
      if (!alive[i] && !begun) called_off = true;
    }
    if (called_off) {
      for (Process &process : processes) process.call_off();
    } else if (!begun && std::all_of(processes.begin(), processes.end(), [](const Process &p) { return p.ready(); })) {
      begun = true;
      const Time start = timer_clock_now() + margin;
      for (Process &process : processes) process.begin(start);
    }
  }
  std::vector<int> statuses;
  for (Process &process : processes) statuses.push_back(process.end());
  return statuses;
}

redag::Result<Time> await_start() {
  const auto failed = [](const std::string &why) {
    return redag::make_error(fmt::format("there is no common start: {}", why),
                             "another process of this run ended before the start");
  };
  constexpr std::string_view kReady = "ready\n";
  if (write(STDOUT_FILENO, kReady.data(), kReady.size()) != static_cast<ssize_t>(kReady.size())) {
    return failed("nothing reads the standard output");
  }
  std::string line;
  for (char c = 0; line.empty() || line.back() != '\n'; line += c) {
    const ssize_t size = read(STDIN_FILENO, &c, 1);
    if (size < 0 && errno == EINTR) return failed("it was interrupted");
    if (size != 1) return failed("the standard input ended");
  }
  constexpr std::string_view kStart = "start ";
  Time start = 0;
  const char *const last = line.data() + line.size() - 1;
  if (line.rfind(kStart, 0) == 0) {
    const auto [end, error] = std::from_chars(line.data() + kStart.size(), last, start);
    if (error == std::errc() && end == last) return start;
  }
  return failed(fmt::format("'{}' is not 'start TIME'", line.substr(0, line.size() - 1)));
}

}  // namespace redag_rclcpp::lab
