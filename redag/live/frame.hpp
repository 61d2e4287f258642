// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The content of a live page as plain values: an executor with its DAGs and tasks at one moment. Shares no memory.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/live/page.hpp"

namespace redag::live {

struct DagFrame {
  std::string name;
  std::uint32_t max_active = 0;  // 0: no bound
  page::Figures figures{};       // sums; response times are end to end, each that of the sink with the worst one
  Duration deadline = 0;         // end to end; 0: none
  std::uint64_t late = 0;        // answers of sinks beyond it
  std::uint64_t recent_late = 0;
  page::Spread spread{};  // of the sink with the longest response p99
};

struct TaskFrame {
  std::string name;  // within its DAG
  std::uint32_t dag = 0;
  Duration period = 0;
  Duration deadline = 0;  // 0: none
  Duration bound = 0;     // 0: not known
  page::Figures figures{};
  page::Spread spread{};
  int priority = 0;  // SCHED_FIFO; 0: none of its own
};

/// A worker thread.
struct ThreadFrame {
  std::uint32_t index = 0;
  Duration used = 0;  // processor time of the jobs that ended on it
  Duration recent_used = 0;
  std::optional<std::uint32_t> task = {};  // index of the task whose job it runs
};

struct DeviceFrame {
  std::string name;
  std::uint32_t slots = 1;
  std::uint32_t used = 0;    // slots
  std::uint32_t queued = 0;  // jobs that asked it and are not served yet
  std::uint64_t served = 0;  // services that have ended
  std::uint64_t recent_served = 0;
  Duration busy = 0;  // time of its services, of all slots together
  Duration recent_busy = 0;
  std::vector<std::uint32_t> tasks = {};  // indices of the tasks whose jobs it serves, as far as the page has room
};

struct Frame {
  std::string name;
  std::string program;
  std::string driver;
  std::string preemption;
  std::string policy;
  std::uint32_t workers = 0;
  std::uint64_t sequence = 0;
  Time began = 0;      // CLOCK_MONOTONIC
  Time published = 0;  // CLOCK_MONOTONIC
  Duration interval = 0;
  Duration window = 0;
  Duration publisher_cpu = 0;
  std::uint64_t left_out = 0;
  std::string alert;  // what stops the executor now, such as a deadlock; empty: nothing
  std::vector<DagFrame> dags;
  std::vector<TaskFrame> tasks;      // ordered by DAG
  std::vector<ThreadFrame> threads;  // by index; the busiest ones if there are too many
  std::uint32_t threads_in_all = 0;
  std::vector<DeviceFrame> devices;  // in the executor's order; the busiest ones if there are too many
  std::uint32_t devices_in_all = 0;
};

}  // namespace redag::live
