// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The kernel's record of a run, as Perfetto draws it: a track for each processor with its threads and interrupts, and
// the states of threads. Writes the kernel's own events (ftrace), on the clock of the jobs. Holds some of them.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_analysis/metrics/kernel_threads.hpp"
#include "redag_analysis/metrics/perfetto_packets.hpp"

namespace redag::metrics::perfetto {

class KernelDrawing {
 public:
  /// Draws from `start` on, which is time 0 of the file. `writer` must outlive this object.
  KernelDrawing(PacketWriter &writer, KernelReader reader, Time start)
      : writer_(writer), reader_(std::move(reader)), start_(start) {}

  /// Reads the record up to `time`, and writes most of it. Error: a damaged file.
  [[nodiscard]] Result<void> read_until(Time time);
  /// Reads and writes the rest.
  [[nodiscard]] Result<void> finish();

  /// What was read of the threads.
  [[nodiscard]] const KernelThreads &threads() const { return threads_; }

 private:
  /// An event of a processor.
  struct Event {
    enum class Kind : std::uint8_t { Exit, Switch, Entry };

    Time time = 0;
    int order = 0;  // of those of one time
    Kind kind = Kind::Switch;
    std::variant<KernelSwitch, std::string> what;  // an interrupt has a name
  };
  static constexpr int kOrdinary = 120;  // the kernel's priority of a thread with nice value 0, and of the idle one
  struct Running {
    int thread = 0;
    int priority = kOrdinary;
  };

  void add(const KernelRow &row);
  void add(const KernelSwitch &event);
  void add(const KernelInterrupt &event);
  void push(int cpu, Event event);
  void begin();
  void write(int cpu, std::vector<Event> &events, std::size_t most);
  void write_process(const KernelProcess &process);
  void write_thread(const KernelThread &thread);
  void write_switch(Builder<FtraceEvent> &event, const KernelSwitch &one);
  void write_interrupt(Builder<FtraceEvent> &event, const std::string &name, bool begins);
  [[nodiscard]] std::string comm(int thread, int cpu) const;

  PacketWriter &writer_;
  KernelReader reader_;
  Time start_;
  KernelThreads threads_;
  bool has_begun_ = false;                        // the first event from `start_` on was read
  std::map<int, KernelSwitch> earlier_;           // by processor: the last one before `start_`
  std::map<int, std::vector<Event>> events_;      // by processor: not yet written
  std::map<int, Running> running_;                // by processor
  std::map<std::string, int> interrupt_numbers_;  // the record has names only
  Time last_ = std::numeric_limits<Time>::min();  // of the last row with a time
  bool is_over_ = false;
};

}  // namespace redag::metrics::perfetto
