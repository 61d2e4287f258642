// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/merged_kernel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <queue>
#include <utility>
#include <variant>
#include <vector>

#include "redag/trace/output_file.hpp"

namespace redag::hosts {
namespace {

using metrics::KernelRow;

constexpr int kMostThreads = 1 << 22;  // the kernel's largest number of a thread on a 64-bit machine, and one more
constexpr int kMostCpus = 1 << 13;     // as many as it has at most

// The last processor that a record names, and one more.
Result<int> count_cpus(const metrics::KernelRecord &record) {
  Result<metrics::KernelReader> reader = record.read();
  if (!reader) return tl::unexpected<Diagnostics>(std::move(reader.error()));
  int count = 0;
  for (;;) {
    const Result<std::optional<KernelRow>> row = reader->next();
    if (!row) return tl::unexpected<Diagnostics>(row.error());
    if (!*row) return count;
    int cpu = 0;
    if (const auto *event = std::get_if<metrics::KernelSwitch>(&**row)) cpu = event->cpu;
    if (const auto *interrupt = std::get_if<metrics::KernelInterrupt>(&**row)) cpu = interrupt->cpu;
    if (cpu < 0 || cpu >= kMostCpus) {
      return trace::file_error(record.path(), 0, fmt::format("no machine has a processor {}", cpu));
    }
    count = std::max(count, cpu + 1);
  }
}

// The rows of one host: those without a time, then one with a time.
class RowStream {
 public:
  RowStream(const HostKernel &kernel, metrics::KernelReader reader) : kernel_(kernel), reader_(std::move(reader)) {}

  /// When the next rows are due; kNever after the last ones with a time.
  [[nodiscard]] Time time() const { return time_; }
  [[nodiscard]] bool is_over() const { return rows_.empty(); }

  Result<void> load() {
    rows_.clear();
    time_ = kNever;
    while (time_ == kNever) {
      Result<std::optional<KernelRow>> row = reader_.next();
      if (!row) return tl::unexpected<Diagnostics>(std::move(row.error()));
      if (!*row) break;
      rows_.push_back(kernel_.merged(**std::move(row)));
      time_ = metrics::time_of(rows_.back()).value_or(kNever);
    }
    return {};
  }

  void write(metrics::KernelWriter &writer) const {
    for (const KernelRow &row : rows_) writer.add(row);
  }

 private:
  const HostKernel &kernel_;
  metrics::KernelReader reader_;
  std::vector<KernelRow> rows_;
  Time time_ = kNever;
};

}  // namespace

KernelRow HostKernel::merged(KernelRow row) const {
  const auto thread = [this](int number) { return number == 0 ? 0 : number % kMostThreads + first_thread; };
  const auto name = [this](const std::string &own) { return host->name + "/" + own; };
  if (auto *event = std::get_if<metrics::KernelSwitch>(&row)) {
    event->time += host->shift;
    event->cpu += first_cpu;
    event->from = thread(event->from);
    event->to = thread(event->to);
  } else if (auto *interrupt = std::get_if<metrics::KernelInterrupt>(&row)) {
    interrupt->begin += host->shift;
    interrupt->end += host->shift;
    interrupt->cpu += first_cpu;
    interrupt->name = name(interrupt->name);
  } else if (auto *process = std::get_if<metrics::KernelProcess>(&row)) {
    process->process = thread(process->process);
    process->name = name(process->name);
  } else if (auto *its = std::get_if<metrics::KernelThread>(&row)) {
    its->thread = thread(its->thread);
    its->process = thread(its->process);
    if (its->process == 0) its->name = name(its->name);
  } else if (auto *job = std::get_if<metrics::JobThread>(&row)) {
    job->task.value += host->first_task;
    job->thread = thread(job->thread);
  }
  return row;
}

Result<std::vector<HostKernel>> open_kernel_records(const MergedRun &merged) {
  std::vector<HostKernel> kernels;
  int cpus = 0;
  for (std::size_t h = 0; h < merged.hosts.size(); ++h) {
    const Host &host = merged.hosts[h];
    Result<std::optional<metrics::KernelRecord>> record = metrics::KernelRecord::beside(host.path, host.info);
    if (!record) return tl::unexpected<Diagnostics>(std::move(record.error()));
    if (!*record) continue;
    const Result<int> count = count_cpus(**record);
    if (!count) return tl::unexpected<Diagnostics>(count.error());
    kernels.push_back({&host, **std::move(record), cpus, static_cast<int>(h) * kMostThreads});
    cpus += *count;
  }
  return kernels;
}

Result<void> merge_kernel_records(const MergedRun &merged, const std::vector<HostKernel> &kernels,
                                  const std::function<bool()> &is_stopped, metrics::KernelWriter &writer) {
  constexpr std::uint64_t kAskEvery = 4096;
  std::vector<RowStream> streams;
  for (const HostKernel &kernel : kernels) {
    Result<metrics::KernelReader> reader = kernel.record.read();
    if (!reader) return tl::unexpected<Diagnostics>(std::move(reader.error()));
    streams.emplace_back(kernel, *std::move(reader));
  }
  using Head = std::pair<Time, std::size_t>;
  std::priority_queue<Head, std::vector<Head>, std::greater<>> heads;
  const auto load = [&](std::size_t h) -> Result<void> {
    if (Result<void> loaded = streams[h].load(); !loaded) return loaded;
    if (!streams[h].is_over()) heads.emplace(streams[h].time(), h);
    return {};
  };
  for (std::size_t h = 0; h < streams.size(); ++h) {
    if (Result<void> loaded = load(h); !loaded) return loaded;
  }
  for (std::uint64_t count = 1; !heads.empty() && heads.top().first < merged.info.end; ++count) {
    const std::size_t h = heads.top().second;
    heads.pop();
    streams[h].write(writer);
    if (Result<void> loaded = load(h); !loaded) return loaded;
    if (count % kAskEvery == 0 && is_stopped()) return make_error("interrupted: the runs were not merged");
  }
  return {};
}

}  // namespace redag::hosts
