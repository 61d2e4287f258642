// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/kernel_recorder.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "redag/runtime/clock.hpp"
#include "redag/runtime/threads.hpp"

namespace redag::lab {
namespace {

namespace fs = std::filesystem;

constexpr const char *kPrefix = "redag-";
constexpr Duration kSettled = 20 * kMillisecond;  // by then the kernel has written what it stamped
constexpr const char *kBufferKib = "8192";        // for each processor: about 100,000 events between two collect()

// The folder where tracefs is mounted, by the kernel's own list.
std::optional<std::string> tracefs() {
  std::ifstream mounts("/proc/self/mounts");
  std::string device;
  std::string place;
  std::string type;
  for (std::string line; mounts >> device >> place >> type && std::getline(mounts, line);) {
    if (type == "tracefs") return place;
  }
  return std::nullopt;
}

bool write_file(const std::string &path, std::string_view text) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool written = ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = errno;
  ::close(file);
  errno = error;
  return written;
}

std::string first_line(const std::string &path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

// A mask such as "3" or "1,00000000".
std::string mask_of(const std::vector<int> &cpus) {
  std::vector<std::uint32_t> words(1, 0);
  for (const int cpu : cpus) {
    const auto word = static_cast<std::size_t>(cpu) / 32;
    if (words.size() <= word) words.resize(word + 1, 0);
    words[word] |= 1U << (static_cast<unsigned>(cpu) % 32);
  }
  std::string mask = fmt::format("{:x}", words.back());
  for (std::size_t i = words.size() - 1; i > 0; --i) mask += fmt::format(",{:08x}", words[i - 1]);
  return mask;
}

// Removes the buffers of processes that were killed.
void remove_stale(const std::string &instances) {
  std::error_code error;
  for (fs::directory_iterator entry(instances, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.rfind(kPrefix, 0) != 0) continue;
    int process = 0;
    const char *const begin = name.data() + std::strlen(kPrefix);
    const auto [rest, bad] = std::from_chars(begin, name.data() + name.size(), process);
    const bool is_ours = bad == std::errc{} && rest == name.data() + name.size();
    if (is_ours && ::kill(process, 0) != 0 && errno == ESRCH) ::rmdir(entry->path().c_str());
  }
}

tl::unexpected<Diagnostics> refused(const std::string &path) {
  return make_error(fmt::format("the kernel does not record for this process: {}: {}", path, std::strerror(errno)),
                    "run as root, or leave --kernel out");
}

}  // namespace

Result<std::unique_ptr<KernelRecorder>> KernelRecorder::start(const std::vector<int> &cpus) {
  const std::optional<std::string> root = tracefs();
  if (!root) {
    return make_error("there is no tracefs, by which the kernel records its switches",
                      "as root: mount -t tracefs tracefs /sys/kernel/tracing; or leave --kernel out");
  }
  remove_stale(*root + "/instances");
  const std::string instance = fmt::format("{}/instances/{}{}", *root, kPrefix, ::getpid());
  if (::mkdir(instance.c_str(), 0700) != 0) return refused(instance);
  std::unique_ptr<KernelRecorder> recorder(new KernelRecorder(instance));  // removes the instance from now on
  const std::array<std::pair<const char *, std::string>, 8> settings = {{{"trace_clock", "mono"},
                                                                         {"buffer_size_kb", kBufferKib},
                                                                         {"tracing_cpumask", mask_of(cpus)},
                                                                         {"events/sched/sched_switch/enable", "1"},
                                                                         {"events/irq/irq_handler_entry/enable", "1"},
                                                                         {"events/irq/irq_handler_exit/enable", "1"},
                                                                         {"events/irq/softirq_entry/enable", "1"},
                                                                         {"events/irq/softirq_exit/enable", "1"}}};
  for (const auto &[file, value] : settings) {
    if (!write_file(instance + "/" + file, value)) return refused(instance + "/" + file);
  }
  recorder->pipe_ = ::open((instance + "/trace_pipe").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (recorder->pipe_ < 0) return refused(instance + "/trace_pipe");
  return recorder;
}

KernelRecorder::KernelRecorder(std::string instance) : instance_(std::move(instance)) {}

KernelRecorder::~KernelRecorder() {
  if (pipe_ >= 0) ::close(pipe_);
  ::rmdir(instance_.c_str());
}

int KernelRecorder::this_thread() noexcept {
  static thread_local const int thread = static_cast<int>(::syscall(SYS_gettid));
  return thread;
}

Result<void> KernelRecorder::write_to(const std::string &path, const trace::RunInfo &run, Time origin) {
  Result<metrics::KernelWriter> writer = metrics::KernelWriter::create(path, run.provenance);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  writer_.emplace(*std::move(writer));
  origin_ = origin;
  writer_->add(metrics::KernelProcess{::getpid(), run.workload.name});
  return {};
}

void KernelRecorder::collect() {
  const Time until = runtime::monotonic_now() - kSettled;
  read_pipe();
  write(text_.take(until));
}

metrics::KernelWriter KernelRecorder::stop() {
  write_file(instance_ + "/tracing_on", "0");
  read_pipe();
  write(text_.take(kNever));
  return *std::move(writer_);
}

void KernelRecorder::read_pipe() {
  std::array<char, 65536> block{};
  for (ssize_t got = 1; got > 0;) {
    got = ::read(pipe_, block.data(), block.size());
    if (got > 0) text_.add({block.data(), static_cast<std::size_t>(got)});
  }
}

// Threads and jobs stand before what the kernel recorded of them.
void KernelRecorder::write(std::vector<metrics::KernelRow> rows) {
  write_threads();
  jobs_.drain([this](const metrics::JobThread &job) { write(job); });
  for (metrics::KernelRow &row : rows) {
    if (auto *thread = std::get_if<metrics::KernelThread>(&row)) {
      if (own_.contains(thread->thread)) continue;
      thread->name += fmt::format("-{}", thread->thread);
    } else if (auto *event = std::get_if<metrics::KernelSwitch>(&row)) {
      event->time -= origin_;
    } else if (auto *interrupt = std::get_if<metrics::KernelInterrupt>(&row)) {
      interrupt->begin -= origin_;
      interrupt->end -= origin_;
    }
    writer_->add(row);
  }
}

void KernelRecorder::write_threads() {
  std::error_code error;
  for (fs::directory_iterator entry("/proc/self/task", error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    int thread = 0;
    std::from_chars(name.data(), name.data() + name.size(), thread);
    std::string comm = first_line(entry->path().string() + "/comm");
    if (comm.empty() || own_[thread] == comm) continue;
    own_[thread] = comm;
    writer_->add(metrics::KernelThread{thread, std::move(comm), ::getpid()});
  }
}

void KernelRecorder::write(const metrics::JobThread &job) {
  // A thread that ended before its name was read is the process' all the same.
  if (own_.try_emplace(job.thread).second) {
    writer_->add(metrics::KernelThread{job.thread, fmt::format("thread {}", job.thread), ::getpid()});
  }
  writer_->add(job);
}

}  // namespace redag::lab
