// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The first accelerator of this machine, with a kernel that takes a chosen time: an OpenCL device (opencl.cpp) or a
// CUDA device (cuda.cu). Members throw std::runtime_error with the call that failed.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

class Accelerator {
 public:
  /// A kernel of `groups` groups of threads, each of which goes round its loop `rounds` times.
  struct Work {
    std::uint32_t rounds = 0;
    std::uint32_t groups = 1;
  };

  Accelerator();
  ~Accelerator();
  Accelerator(const Accelerator &) = delete;
  Accelerator &operator=(const Accelerator &) = delete;

  [[nodiscard]] const std::string &name() const;
  /// Finds out, by trying, how much work takes about that time.
  [[nodiscard]] Work work_of(std::chrono::nanoseconds time);
  /// Submits the kernel, and returns when it is done. For one thread at a time.
  void run(Work work);

  class Stream;
  /// A queue of the driver, which works beside the others. The kernels of an urgent one go first where the driver knows
  /// priorities: CUDA does, between groups of threads. It must not outlive the accelerator.
  [[nodiscard]] std::shared_ptr<Stream> stream(bool urgent);
  /// Submits the kernel and returns. A thread of the driver calls done() at the end, also after the stream is gone. For
  /// one thread at a time for each stream.
  void submit(Stream &stream, Work work, std::function<void()> done);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};
