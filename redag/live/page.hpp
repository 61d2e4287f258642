// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The live page: the figures of a running executor for `redag top`, as bytes in shared memory. Owns the layout and its
// version; writer.hpp and reader.hpp write and read it. docs/live_page.md explains its use. All values are
// native-endian; times and durations are int64 nanoseconds. A change of meaning needs a new version. Fields appended to
// a row or a header do not, because their sizes are in the page. Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace redag::live::page {

inline constexpr char kMagic[8] = {'r', 'e', 'd', 'a', 'g', 't', 'o', 'p'};
inline constexpr std::uint32_t kVersion = 1;
inline constexpr std::size_t kNameSize = 96;  // UTF-8, cut to this size, padded with zeros
inline constexpr std::size_t kAlertSize = 256;

/// At offset 0. Written once, magic last; only `sequence` changes later.
struct Header {
  char magic[8];
  std::uint32_t version;
  std::uint32_t header_size;  // in bytes, as all sizes and offsets
  std::uint32_t frame_header_size;
  std::uint32_t dag_row_size;
  std::uint32_t task_row_size;
  std::uint32_t reserved;
  std::uint64_t page_size;
  std::uint64_t slot_offset;  // of the first of two slots; each holds one frame
  std::uint64_t slot_size;
  std::int64_t pid;             // of the writer, in its namespace
  std::uint64_t process_start;  // clock ticks after boot (field 22 of /proc/PID/stat)
  std::uint64_t pid_namespace;  // inode of /proc/PID/ns/pid
  // Number of the latest complete frame, from 1; 0: none. The frame is in slot `sequence % 2`. Written after the frame,
  // with release order.
  std::uint64_t sequence;
};

/// Figures of a DAG or a task. Counters start with the executor; those of a DAG are the sums of its tasks. `recent`
/// covers the last FrameHeader::window.
struct Figures {
  std::uint64_t released;
  std::uint64_t finished;
  std::uint64_t skipped;
  std::uint64_t aborted;
  std::uint64_t misses;  // finished late, skipped, or aborted although they had data
  std::uint64_t deferred;
  std::uint64_t preemptions;
  std::int64_t cpu;  // processor time of ended jobs
  std::int64_t response_p50;
  std::int64_t response_p99;
  std::int64_t response_max;
  std::uint64_t recent_jobs;  // finished jobs
  std::uint64_t recent_misses;
  std::uint64_t recent_preemptions;
  std::int64_t recent_cpu;
  std::int64_t recent_p50;
  std::int64_t recent_p99;
  std::int64_t recent_max;
  std::uint32_t active;   // jobs that have started and not ended
  std::uint32_t ready;    // jobs that could start
  std::uint32_t waiting;  // released jobs whose predecessors are incomplete
  std::uint32_t away;     // active jobs that wait without a worker: for a device, an event, a time, a call that blocks
};

/// How often response times occurred since the start: counts of classes of time. There are two classes an octave (see
/// least_in()). The first class takes shorter times as well, and the last one longer times.
inline constexpr std::size_t kClasses = 48;
struct Spread {
  std::uint32_t reserved[kClasses];
  std::uint32_t all[kClasses];
};

/// Returns the least response time of a class, in nanoseconds: 1024, 1536, 2048, 3072, ...
[[nodiscard]] constexpr std::int64_t least_in(std::size_t index) noexcept {
  return (index % 2 == 0 ? std::int64_t{1024} : std::int64_t{1536}) << (index / 2);
}

struct DagRow {
  char name[kNameSize];
  std::uint32_t max_active;  // 0: no bound
  std::uint32_t reserved;
  Figures figures;  // its response times are end to end
  // Appended; see kLeastDagRow.
  std::int64_t deadline;  // end to end; 0: none
  std::uint64_t late;     // answers of sinks beyond it
  std::uint64_t recent_late;
  Spread spread;
};

struct TaskRow {
  char name[kNameSize];
  std::uint32_t dag;  // index among the DAG rows
  std::uint32_t reserved;
  std::int64_t period;    // 0: none
  std::int64_t deadline;  // relative; 0: none
  std::int64_t bound;     // proven bound on the response time; 0: not known
  Figures figures;
  // Appended; see kLeastTaskRow.
  Spread spread;
  std::int64_t priority;  // SCHED_FIFO priority of its jobs that have inherited nothing; 0: none of its own
};

/// A worker thread. Those with the most recent work, ordered by number, if there are more than kThreads.
struct ThreadRow {
  std::int64_t used;  // processor time of the jobs that ended on it
  std::int64_t recent_used;
  std::uint32_t index;
  std::uint32_t task;  // index among the task rows of the job it runs; kNoTask: none
};
inline constexpr std::size_t kThreads = 64;
inline constexpr std::uint32_t kNoTask = 0xffffffff;

inline constexpr std::size_t kServices = 4;
/// A device. Those with the most recent work, in their order, if there are more than kDevices.
struct DeviceRow {
  char name[kNameSize];
  std::int64_t busy;  // time of its services, of all slots together
  std::int64_t recent_busy;
  std::uint64_t served;  // services that have ended
  std::uint64_t recent_served;
  std::uint32_t slots;
  std::uint32_t used;             // slots
  std::uint32_t queued;           // jobs that asked it and are not served yet
  std::uint32_t task[kServices];  // indices of the task rows of jobs that it serves; kNoTask: no more, or not known
  std::uint32_t reserved;
};
inline constexpr std::size_t kDevices = 12;

/// At the start of a slot. `dags` rows of DAGs follow, then `tasks` rows of tasks.
struct FrameHeader {
  std::uint64_t checksum;  // of all later bytes in the frame
  std::uint64_t sequence;  // as Header::sequence
  std::uint32_t dags;
  std::uint32_t tasks;
  std::uint64_t left_out;      // DAGs and tasks for which there was no room
  std::int64_t began;          // CLOCK_MONOTONIC
  std::int64_t published;      // CLOCK_MONOTONIC
  std::int64_t interval;       // until the next frame
  std::int64_t window;         // the time that `recent` covers
  std::int64_t publisher_cpu;  // processor time that the page has used
  std::uint32_t workers;
  std::uint32_t reserved;
  char name[kNameSize];  // of the executor: the workload's, or the user's
  char program[32];      // name of the process
  char driver[16];       // "threads", "ros"
  char preemption[16];   // "os", ...
  char policy[32];
  // Appended; see kLeastFrameHeader.
  char alert[kAlertSize];        // what stops the executor now, such as a deadlock; empty: nothing
  std::uint32_t threads;         // rows below that are used
  std::uint32_t threads_in_all;  // of the executor
  ThreadRow thread[kThreads];
  std::uint32_t devices;         // rows below that are used
  std::uint32_t devices_in_all;  // of the executor
  DeviceRow device[kDevices];
};

/// Sizes without the fields that were appended to version 1. A reader takes those as zero where a page lacks them.
inline constexpr std::size_t kLeastFrameHeader = 272;
inline constexpr std::size_t kLeastDagRow = 264;
inline constexpr std::size_t kLeastTaskRow = 288;

template <class Row>
inline constexpr bool kIsPlain = std::is_trivially_copyable_v<Row>&& std::is_standard_layout_v<Row> &&
                                 sizeof(Row) % 8 == 0;
static_assert(kIsPlain<Header> && kIsPlain<Figures> && kIsPlain<DagRow> && kIsPlain<TaskRow> && kIsPlain<FrameHeader>);
static_assert(kIsPlain<Spread> && kIsPlain<ThreadRow> && kIsPlain<DeviceRow>);

// Sizes and offsets of version 1, which readers of other programs rely on.
static_assert(sizeof(Header) == 88 && offsetof(Header, page_size) == 32 && offsetof(Header, pid) == 56);
static_assert(offsetof(Header, sequence) == 80);
static_assert(sizeof(Figures) == 160 && offsetof(Figures, response_p50) == 64 && offsetof(Figures, active) == 144);
static_assert(sizeof(Spread) == 384 && sizeof(ThreadRow) == 24 && sizeof(DeviceRow) == 160);
static_assert(sizeof(DagRow) == 672 && offsetof(DagRow, figures) == 104 && offsetof(DagRow, deadline) == kLeastDagRow);
static_assert(sizeof(TaskRow) == 680 && offsetof(TaskRow, period) == 104 && offsetof(TaskRow, figures) == 128);
static_assert(offsetof(TaskRow, spread) == kLeastTaskRow && offsetof(TaskRow, priority) == 672);
static_assert(sizeof(FrameHeader) == 4000 && offsetof(FrameHeader, name) == 80);
static_assert(offsetof(FrameHeader, devices) == 2072 && offsetof(DeviceRow, slots) == 128);
static_assert(offsetof(FrameHeader, alert) == kLeastFrameHeader && offsetof(FrameHeader, thread) == 536);

/// FNV-1a over the 8-byte words of `bytes`, whose size is a multiple of 8.
[[nodiscard]] inline std::uint64_t checksum(std::span<const std::byte> bytes) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (std::size_t at = 0; at + 8 <= bytes.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, sizeof(word));
    hash = (hash ^ word) * 0x100000001b3;
  }
  return hash;
}

}  // namespace redag::live::page
