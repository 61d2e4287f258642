// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "redag/live/owned_file.hpp"
#include "redag/live/pages.hpp"
#include "redag/live/process.hpp"

namespace redag::live {
namespace {

using page::DagRow;
using page::FrameHeader;
using page::Header;
using page::TaskRow;

constexpr std::size_t kFirstSlot = 4096;
constexpr std::size_t kLeastSlot = sizeof(FrameHeader);
constexpr unsigned kMostPages = 1000;  // of one process

static_assert(sizeof(Header) <= kFirstSlot);
static_assert(std::atomic_ref<std::uint64_t>::is_always_lock_free);

/// Copies a name, cut between two characters, and fills the rest with zeros.
template <std::size_t Size>
void put_name(char (&target)[Size], const std::string &name) {
  std::size_t length = std::min(name.size(), Size);
  const auto continues = [&](std::size_t at) { return (static_cast<unsigned char>(name[at]) & 0xc0U) == 0x80U; };
  if (length < name.size()) {
    while (length > 0 && continues(length)) --length;
  }
  std::memset(target, 0, Size);
  std::memcpy(target, name.data(), length);
}

/// `tasks`: how many rows of tasks there are.
page::DeviceRow row_of(const DeviceFrame &device, std::size_t tasks) {
  page::DeviceRow row{};
  put_name(row.name, device.name);
  row.busy = device.busy;
  row.recent_busy = device.recent_busy;
  row.served = device.served;
  row.recent_served = device.recent_served;
  row.slots = device.slots;
  row.used = device.used;
  row.queued = device.queued;
  std::fill(std::begin(row.task), std::end(row.task), page::kNoTask);
  std::size_t named = 0;
  for (const std::uint32_t task : device.tasks) {
    if (task < tasks && named < page::kServices) row.task[named++] = task;
  }
  return row;
}

tl::unexpected<Diagnostics> refused(const std::string &what) {
  return make_error(fmt::format("no live page is published: {}: {}", what, std::generic_category().message(errno)),
                    "'redag top' cannot show this executor; everything else works");
}

}  // namespace

Result<std::unique_ptr<PageWriter>> PageWriter::create(const std::string &folder, std::size_t slot_size) {
  (void)remove_stale_pages(folder);
  const Process self = this_process();
  slot_size = std::max(slot_size, kLeastSlot) / 8 * 8;
  std::string path;
  int descriptor = -1;
  for (unsigned number = 0; descriptor < 0; ++number) {
    path = page_path(folder, self.pid, number);
    descriptor = create_owned_file(path);
    if (descriptor < 0 && (errno != EEXIST || number == kMostPages)) return refused(path);
  }
  const std::size_t size = kFirstSlot + 2 * slot_size;
  const auto give_up = [&](int error) {
    ::close(descriptor);
    ::unlink(path.c_str());
    errno = error;
    return refused(path);
  };
  if (::ftruncate(descriptor, static_cast<off_t>(size)) != 0) return give_up(errno);
  // Writing to missing memory kills the process (SIGBUS). The memory is therefore reserved first.
  if (const int error = ::posix_fallocate(descriptor, 0, kFirstSlot); error != 0) return give_up(error);
  void *memory = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  if (memory == MAP_FAILED) return give_up(errno);

  auto writer = std::unique_ptr<PageWriter>(
      new PageWriter(std::move(path), descriptor, static_cast<std::byte *>(memory), slot_size));
  Header header{};
  header.version = page::kVersion;
  header.header_size = sizeof(Header);
  header.frame_header_size = sizeof(FrameHeader);
  header.dag_row_size = sizeof(DagRow);
  header.task_row_size = sizeof(TaskRow);
  header.page_size = size;
  header.slot_offset = kFirstSlot;
  header.slot_size = slot_size;
  header.pid = self.pid;
  header.process_start = self.start;
  header.pid_namespace = self.pid_namespace;
  std::memcpy(memory, &header, sizeof(header));
  std::uint64_t magic = 0;
  std::memcpy(&magic, page::kMagic, sizeof(magic));
  writer->store_word(offsetof(Header, magic), magic);
  return writer;
}

PageWriter::PageWriter(std::string path, int descriptor, std::byte *memory, std::size_t slot_size)
    : path_(std::move(path)), descriptor_(descriptor), memory_(memory), slot_size_(slot_size) {}

PageWriter::~PageWriter() {
  ::unlink(path_.c_str());
  ::munmap(memory_, kFirstSlot + 2 * slot_size_);
  ::close(descriptor_);
}

bool PageWriter::reserve(std::size_t slot, std::size_t size) {
  if (size > slot_size_) return false;
  if (size <= reserved_[slot]) return true;
  constexpr std::size_t kStep = 65536;
  const std::size_t wanted = std::min(slot_size_, (size + kStep - 1) / kStep * kStep);
  const auto offset = static_cast<off_t>(kFirstSlot + slot * slot_size_);
  if (::posix_fallocate(descriptor_, offset, static_cast<off_t>(wanted)) != 0) return false;
  reserved_[slot] = wanted;
  return true;
}

void PageWriter::publish(const Frame &frame) {
  const std::uint64_t sequence = sequence_ + 1;
  const std::size_t slot = sequence % 2;
  std::size_t dags = frame.dags.size();
  std::size_t tasks = frame.tasks.size();
  const auto size_of = [](std::size_t d, std::size_t t) {
    return sizeof(FrameHeader) + d * sizeof(DagRow) + t * sizeof(TaskRow);
  };
  while (!reserve(slot, size_of(dags, tasks))) {
    if (dags == 0 && tasks == 0) return;
    // A task's row refers to its DAG's row, which must be kept.
    tasks /= 2;
    if (tasks == 0) dags /= 2;
  }
  std::byte *const begin = memory_ + kFirstSlot + slot * slot_size_;
  std::byte *at = begin;
  const auto put = [&at](const auto &row) {
    std::memcpy(at, &row, sizeof(row));
    at += sizeof(row);
  };

  FrameHeader header{};
  header.sequence = sequence;
  header.dags = static_cast<std::uint32_t>(dags);
  header.tasks = static_cast<std::uint32_t>(tasks);
  header.left_out = frame.left_out + (frame.dags.size() - dags) + (frame.tasks.size() - tasks);
  header.began = frame.began;
  header.published = frame.published;
  header.interval = frame.interval;
  header.window = frame.window;
  header.publisher_cpu = frame.publisher_cpu;
  header.workers = frame.workers;
  put_name(header.name, frame.name);
  put_name(header.program, frame.program);
  put_name(header.driver, frame.driver);
  put_name(header.preemption, frame.preemption);
  put_name(header.policy, frame.policy);
  put_name(header.alert, frame.alert);
  header.threads = static_cast<std::uint32_t>(std::min(frame.threads.size(), page::kThreads));
  header.threads_in_all = frame.threads_in_all;
  for (std::size_t i = 0; i < header.threads; ++i) {
    const ThreadFrame &thread = frame.threads[i];
    const bool is_kept = thread.task && *thread.task < tasks;
    header.thread[i] = {thread.used, thread.recent_used, thread.index, is_kept ? *thread.task : page::kNoTask};
  }
  header.devices = static_cast<std::uint32_t>(std::min(frame.devices.size(), page::kDevices));
  header.devices_in_all = frame.devices_in_all;
  for (std::size_t i = 0; i < header.devices; ++i) header.device[i] = row_of(frame.devices[i], tasks);
  put(header);
  for (std::size_t d = 0; d < dags; ++d) {
    const DagFrame &dag = frame.dags[d];
    DagRow row{};
    put_name(row.name, dag.name);
    row.max_active = dag.max_active;
    row.figures = dag.figures;
    row.deadline = dag.deadline;
    row.late = dag.late;
    row.recent_late = dag.recent_late;
    row.spread = dag.spread;
    put(row);
  }
  for (std::size_t t = 0; t < tasks; ++t) {
    const TaskFrame &task = frame.tasks[t];
    TaskRow row{};
    put_name(row.name, task.name);
    row.dag = task.dag;
    row.period = task.period;
    row.deadline = task.deadline;
    row.bound = task.bound;
    row.priority = task.priority;
    row.figures = task.figures;
    row.spread = task.spread;
    put(row);
  }
  const std::span<const std::byte> checked(begin + sizeof(header.checksum), at);
  const std::uint64_t checksum = page::checksum(checked);
  std::memcpy(begin, &checksum, sizeof(checksum));

  sequence_ = sequence;
  store_word(offsetof(Header, sequence), sequence);
}

void PageWriter::store_word(std::size_t offset, std::uint64_t word) {
  std::atomic_ref<std::uint64_t>(*reinterpret_cast<std::uint64_t *>(memory_ + offset))
      .store(word, std::memory_order_release);
}

}  // namespace redag::live
