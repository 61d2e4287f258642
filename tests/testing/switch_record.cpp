// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/switch_record.hpp"

#include <linux/perf_event.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include <fmt/format.h>

namespace redag::testing {
namespace {

constexpr std::size_t kPages = 512;  // of data, a power of two: 40,000 events

}  // namespace

// One processor's events, in the layout of perf_event_open(2).
class SwitchRecorder::Ring {
 public:
  Ring(int cpu, Duration beat) : cpu_(cpu) {
    perf_event_attr attributes{};
    attributes.size = sizeof attributes;
    attributes.type = PERF_TYPE_SOFTWARE;
    attributes.config = PERF_COUNT_SW_CPU_CLOCK;
    attributes.sample_period = static_cast<std::uint64_t>(beat);
    attributes.sample_type = PERF_SAMPLE_TID | PERF_SAMPLE_TIME | PERF_SAMPLE_CPU;
    attributes.sample_id_all = 1;
    attributes.context_switch = 1;
    attributes.use_clockid = 1;
    attributes.clockid = CLOCK_MONOTONIC;
    attributes.disabled = 1;
    file_ = static_cast<int>(::syscall(SYS_perf_event_open, &attributes, -1, cpu, -1, PERF_FLAG_FD_CLOEXEC));
    if (file_ < 0) {
      error_ = errno;
      return;
    }
    page_size_ = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    void *const memory = ::mmap(nullptr, bytes(), PROT_READ | PROT_WRITE, MAP_SHARED, file_, 0);
    if (memory == MAP_FAILED) {
      error_ = errno;
      return;
    }
    page_ = static_cast<perf_event_mmap_page *>(memory);
    if (::ioctl(file_, PERF_EVENT_IOC_ENABLE, 0) != 0) error_ = errno;
  }
  ~Ring() {
    if (page_ != nullptr) ::munmap(page_, bytes());
    if (file_ >= 0) ::close(file_);
  }
  Ring(const Ring &) = delete;
  Ring &operator=(const Ring &) = delete;

  [[nodiscard]] int error() const { return error_; }

  // Adds the events up to now. Returns false if the kernel dropped some.
  bool read(std::vector<SwitchEvent> &out) {
    ::ioctl(file_, PERF_EVENT_IOC_DISABLE, 0);
    const std::uint64_t end = __atomic_load_n(&page_->data_head, __ATOMIC_ACQUIRE);
    const auto *const data = reinterpret_cast<const char *>(page_) + page_size_;
    const std::size_t size = kPages * page_size_;
    bool complete = true;
    std::vector<char> record;
    for (std::uint64_t at = page_->data_tail; at < end;) {
      perf_event_header header{};
      copy(&header, data, size, at, sizeof header);
      if (header.size < sizeof header) return false;
      record.resize(header.size);
      copy(record.data(), data, size, at, header.size);
      at += header.size;
      complete = take(header, record, out) && complete;
    }
    __atomic_store_n(&page_->data_tail, end, __ATOMIC_RELEASE);
    return complete;
  }

 private:
  // The end of every record (sample_id_all), and the whole of a sample.
  struct Identity {
    std::uint32_t process = 0;
    std::uint32_t thread = 0;
    std::uint64_t time = 0;
    std::uint32_t cpu = 0;
    std::uint32_t reserved = 0;
  };

  [[nodiscard]] std::size_t bytes() const { return (kPages + 1) * page_size_; }

  static void copy(void *to, const char *data, std::size_t size, std::uint64_t at, std::size_t length) {
    const std::size_t from = at % size;
    const std::size_t first = std::min(length, size - from);
    std::memcpy(to, data + from, first);
    std::memcpy(static_cast<char *>(to) + first, data, length - first);
  }

  bool take(const perf_event_header &header, const std::vector<char> &record, std::vector<SwitchEvent> &out) const {
    if (header.type == PERF_RECORD_LOST) return false;
    const bool is_switch = header.type == PERF_RECORD_SWITCH_CPU_WIDE;
    if ((!is_switch && header.type != PERF_RECORD_SAMPLE) || record.size() < sizeof(Identity)) return true;
    Identity identity;
    std::memcpy(&identity, record.data() + record.size() - sizeof identity, sizeof identity);
    SwitchEvent event{static_cast<Time>(identity.time), SwitchEvent::Kind::Beat, cpu_,
                      static_cast<pid_t>(identity.thread)};
    if (is_switch) {
      const bool is_out = (header.misc & PERF_RECORD_MISC_SWITCH_OUT) != 0;
      const bool was_preempted = (header.misc & PERF_RECORD_MISC_SWITCH_OUT_PREEMPT) != 0;
      event.kind = !is_out         ? SwitchEvent::Kind::In
                   : was_preempted ? SwitchEvent::Kind::Preempted
                                   : SwitchEvent::Kind::Slept;
    }
    out.push_back(event);
    return true;
  }

  int cpu_;
  int file_ = -1;
  int error_ = 0;
  std::size_t page_size_ = 4096;
  perf_event_mmap_page *page_ = nullptr;
};

SwitchRecorder::SwitchRecorder(std::vector<std::unique_ptr<Ring>> rings) : rings_(std::move(rings)) {}
SwitchRecorder::~SwitchRecorder() = default;
SwitchRecorder::SwitchRecorder(SwitchRecorder &&) noexcept = default;
SwitchRecorder &SwitchRecorder::operator=(SwitchRecorder &&) noexcept = default;

Result<SwitchRecorder> SwitchRecorder::start(const std::vector<int> &cpus, Duration beat) {
  std::vector<std::unique_ptr<Ring>> rings;
  for (const int cpu : cpus) {
    rings.push_back(std::make_unique<Ring>(cpu, beat));
    if (const int error = rings.back()->error(); error != 0) {
      return make_error(fmt::format("the kernel does not record its switches for us: {}", std::strerror(error)),
                        "run as root or with CAP_PERFMON, or set kernel.perf_event_paranoid to 0");
    }
  }
  return SwitchRecorder(std::move(rings));
}

Result<std::vector<SwitchEvent>> SwitchRecorder::stop() {
  std::vector<SwitchEvent> events;
  bool complete = true;
  for (const auto &ring : rings_) complete = ring->read(events) && complete;
  if (!complete) return make_error("the kernel dropped some of its record");
  // Keeps the order of what one processor did at one time.
  std::stable_sort(events.begin(), events.end(),
                   [](const SwitchEvent &a, const SwitchEvent &b) { return a.time < b.time; });
  return events;
}

}  // namespace redag::testing
