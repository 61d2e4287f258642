// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/reader.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>
#include <thread>

#include "redag/base/text.hpp"
#include "redag/base/time.hpp"
#include "redag/live/page.hpp"
#include "redag/live/pages.hpp"

namespace redag::live {
namespace {

using page::DagRow;
using page::FrameHeader;
using page::Header;
using page::TaskRow;

constexpr auto kPause = std::chrono::milliseconds(2);

/// Names come from others, and stand in tables.
template <std::size_t Size>
std::string get_name(const char (&name)[Size]) {
  return printable({name, static_cast<std::size_t>(std::find(name, name + Size, '\0') - name)}, {});
}

bool is_duration(std::int64_t value) { return value >= 0 && value <= kMaxDuration; }

bool is_plausible(const page::Figures &figures) {
  return is_duration(figures.cpu) && is_duration(figures.response_p50) && is_duration(figures.response_p99) &&
         is_duration(figures.response_max) && is_duration(figures.recent_cpu) && is_duration(figures.recent_p50) &&
         is_duration(figures.recent_p99) && is_duration(figures.recent_max);
}

/// Returns false if the row is not plausible. `tasks`: how many rows of tasks there are.
bool decode(const page::DeviceRow &row, std::uint32_t tasks, DeviceFrame &device) {
  device.name = get_name(row.name);
  device.slots = row.slots;
  device.used = row.used;
  device.queued = row.queued;
  device.served = row.served;
  device.recent_served = row.recent_served;
  device.busy = row.busy;
  device.recent_busy = row.recent_busy;
  bool plausible = row.slots > 0 && row.used <= row.slots && is_duration(row.busy) && is_duration(row.recent_busy);
  for (const std::uint32_t task : row.task) {
    if (task == page::kNoTask) continue;
    plausible = plausible && task < tasks;
    device.tasks.push_back(task);
  }
  return plausible;
}

/// Returns the frame's bytes, checked; empty while it is being overwritten, or if it is damaged.
std::vector<std::byte> read_slot(const PageFile &file, const Header &header, FrameHeader &frame) {
  const std::uint64_t offset = header.slot_offset + header.sequence % 2 * header.slot_size;
  const std::size_t known = std::min<std::size_t>(sizeof(frame), header.frame_header_size);
  if (!file.read(&frame, known, offset)) return {};
  const std::uint64_t size = header.frame_header_size + std::uint64_t{frame.dags} * header.dag_row_size +
                             std::uint64_t{frame.tasks} * header.task_row_size;
  if (size > header.slot_size) return {};
  std::vector<std::byte> bytes(size);
  if (!file.read(bytes.data(), size, offset)) return {};
  std::memcpy(&frame, bytes.data(), known);
  const std::uint64_t again = header.frame_header_size + std::uint64_t{frame.dags} * header.dag_row_size +
                              std::uint64_t{frame.tasks} * header.task_row_size;
  if (again != size) return {};
  const std::span<const std::byte> checked = std::span(bytes).subspan(sizeof(frame.checksum));
  if (page::checksum(checked) != frame.checksum || frame.sequence != header.sequence) return {};
  return bytes;
}

Result<Frame> decode(const PageFile &file, const Header &header, const FrameHeader &head,
                     const std::vector<std::byte> &bytes) {
  Frame frame;
  frame.name = get_name(head.name);
  frame.program = get_name(head.program);
  frame.driver = get_name(head.driver);
  frame.preemption = get_name(head.preemption);
  frame.policy = get_name(head.policy);
  frame.workers = head.workers;
  frame.sequence = head.sequence;
  frame.began = head.began;
  frame.published = head.published;
  frame.interval = head.interval;
  frame.window = head.window;
  frame.publisher_cpu = head.publisher_cpu;
  frame.left_out = head.left_out;
  frame.alert = get_name(head.alert);
  frame.threads_in_all = head.threads_in_all;
  frame.devices_in_all = head.devices_in_all;
  bool plausible = head.threads <= page::kThreads && head.devices <= page::kDevices && is_duration(head.began) &&
                   is_duration(head.published) && is_duration(head.interval) && is_duration(head.window) &&
                   is_duration(head.publisher_cpu);
  for (std::uint32_t i = 0; plausible && i < head.threads; ++i) {
    const page::ThreadRow &row = head.thread[i];
    plausible =
        is_duration(row.used) && is_duration(row.recent_used) && (row.task < head.tasks || row.task == page::kNoTask);
    const auto task = row.task == page::kNoTask ? std::nullopt : std::optional(row.task);
    frame.threads.push_back({.index = row.index, .used = row.used, .recent_used = row.recent_used, .task = task});
  }
  for (std::uint32_t i = 0; plausible && i < head.devices; ++i) {
    plausible = decode(head.device[i], head.tasks, frame.devices.emplace_back());
  }
  const std::byte *at = bytes.data() + header.frame_header_size;
  for (std::uint32_t d = 0; d < head.dags; ++d, at += header.dag_row_size) {
    DagRow row{};
    std::memcpy(&row, at, std::min<std::size_t>(sizeof(row), header.dag_row_size));
    plausible = plausible && is_plausible(row.figures) && is_duration(row.deadline);
    frame.dags.push_back(DagFrame{.name = get_name(row.name),
                                  .max_active = row.max_active,
                                  .figures = row.figures,
                                  .deadline = row.deadline,
                                  .late = row.late,
                                  .recent_late = row.recent_late,
                                  .spread = row.spread});
  }
  for (std::uint32_t t = 0; t < head.tasks; ++t, at += header.task_row_size) {
    TaskRow row{};
    std::memcpy(&row, at, std::min<std::size_t>(sizeof(row), header.task_row_size));
    plausible = plausible && row.dag < head.dags && is_duration(row.period) && is_duration(row.deadline) &&
                is_duration(row.bound) && is_plausible(row.figures) && row.priority >= 0 && row.priority <= 99;
    frame.tasks.push_back(TaskFrame{.name = get_name(row.name),
                                    .dag = row.dag,
                                    .period = row.period,
                                    .deadline = row.deadline,
                                    .bound = row.bound,
                                    .figures = row.figures,
                                    .spread = row.spread,
                                    .priority = static_cast<int>(row.priority)});
  }
  if (!plausible) return file.damaged("its figures are out of range");
  return frame;
}

}  // namespace

Result<Page> read_page(const std::string &path, int tries) {
  const Result<PageFile> file = PageFile::open(path);
  if (!file) return tl::unexpected<Diagnostics>(file.error());
  for (int i = 0; i < tries; ++i) {
    if (i > 0) std::this_thread::sleep_for(kPause);
    const Result<Header> header = file->header();
    if (!header) return tl::unexpected<Diagnostics>(header.error());
    if (header->sequence == 0) continue;  // the first frame is being written
    FrameHeader head{};
    const std::vector<std::byte> bytes = read_slot(*file, *header, head);
    if (bytes.empty()) continue;
    Result<Frame> frame = decode(*file, *header, head, bytes);
    if (!frame) return tl::unexpected<Diagnostics>(std::move(frame.error()));
    return Page{{header->pid, header->process_start, header->pid_namespace}, *std::move(frame)};
  }
  return file->damaged("it has no complete frame");
}

std::vector<Listed> list_pages(const std::string &folder) {
  (void)remove_stale_pages(folder);
  std::vector<Listed> listed;
  for (const PageName &named : named_pages(folder)) {
    const std::string path = page_path(folder, named.pid, named.number);
    listed.push_back(Listed{path, named.pid, named.number, read_page(path)});
  }
  return listed;
}

}  // namespace redag::live
