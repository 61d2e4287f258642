// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Keeps a live page up to date: a thread of normal priority samples figures at an interval and writes them. The sampler
// must not keep real-time threads waiting. The page exists from start() until the destructor.
//
// Threads: the sampler is called on the publisher's thread, and not after the destructor.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "redag/base/futex.hpp"
#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/live/frame_builder.hpp"
#include "redag/live/writer.hpp"

namespace redag::live {

struct PublisherOptions {
  std::string folder = kFolder;
  std::string name;        // of the executor
  std::string driver;      // "threads", "ros"
  std::string preemption;  // "os", ...
  std::string policy;
  std::uint32_t workers = 0;
  Duration interval = 500 * kMillisecond;
  Duration window = 2 * kSecond;  // see FrameBuilder
};

/// Fills an empty sample.
using Sampler = std::function<void(Sample &sample)>;

class Publisher {
 public:
  /// Error: the system refused the page or the thread; the executor is not affected.
  [[nodiscard]] static Result<std::unique_ptr<Publisher>> start(const PublisherOptions &options, Sampler sampler);
  ~Publisher();
  Publisher(const Publisher &) = delete;
  Publisher &operator=(const Publisher &) = delete;

  [[nodiscard]] const std::string &path() const { return writer_->path(); }

 private:
  Publisher(const PublisherOptions &options, Sampler sampler, std::unique_ptr<PageWriter> writer);

  void main();
  void publish(Time now);

  const Duration interval_;
  const Sampler sampler_;
  const std::unique_ptr<PageWriter> writer_;
  FrameBuilder builder_;
  Frame frame_;
  Sample sample_;
  FutexWord stop_{0};  // 1: the thread ends
  std::thread thread_;
};

}  // namespace redag::live
