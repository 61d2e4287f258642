// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes trace.json for ui.perfetto.dev and chrome://tracing. Each worker has a track with the jobs' slices; each DAG
// is a process with every job from release to end, misses and skips. Events are written as they are read, and memory
// does not grow with the run. Format: "Trace Event Format", Chromium project.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"

namespace redag::metrics {

struct PerfettoOptions {
  bool flows = true;  // arrows from a job to those that use its data
};

class PerfettoWriter {
 public:
  /// Opens the file. `run` must outlive this object; its `end` is not used.
  [[nodiscard]] static Result<PerfettoWriter> create(const std::string &path, const trace::RunInfo &run,
                                                     const PerfettoOptions &options = {});
  PerfettoWriter(PerfettoWriter &&) noexcept;
  PerfettoWriter &operator=(PerfettoWriter &&) = delete;
  PerfettoWriter(const PerfettoWriter &) = delete;
  PerfettoWriter &operator=(const PerfettoWriter &) = delete;
  ~PerfettoWriter();

  void add(std::span<const JobEvent> events);

  /// Closes the jobs in flight at `end` and completes the file.
  [[nodiscard]] Result<void> commit(Time end);

 private:
  class Impl;
  explicit PerfettoWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

[[nodiscard]] Result<void> write_perfetto(const std::string &path, const trace::Trace &trace,
                                          const PerfettoOptions &options = {});

}  // namespace redag::metrics
