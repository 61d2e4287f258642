#include "redag/live/publisher.hpp"

#include <pthread.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <system_error>
#include <utility>

namespace redag::live {
namespace {

Time read_clock(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<Time>(now.tv_sec) * kSecond + now.tv_nsec;
}

}  // namespace

Result<std::unique_ptr<Publisher>> Publisher::start(PublisherOptions options, Sampler sampler) {
  Result<std::unique_ptr<PageWriter>> writer = PageWriter::create(options.folder);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  std::unique_ptr<Publisher> publisher(new Publisher(options, std::move(sampler), *std::move(writer)));
  try {
    publisher->thread_ = std::thread([self = publisher.get()] { self->main(); });
  } catch (const std::system_error &error) {
    return make_error(std::string("no live page: its thread was refused: ") + error.what());
  }
  return publisher;
}

Publisher::Publisher(const PublisherOptions &options, Sampler sampler, std::unique_ptr<PageWriter> writer)
    : interval_(options.interval),
      sampler_(std::move(sampler)),
      writer_(std::move(writer)),
      builder_(read_clock(CLOCK_MONOTONIC), options.window) {
  frame_.name = options.name;
  frame_.program = program_invocation_short_name;
  frame_.driver = options.driver;
  frame_.preemption = options.preemption;
  frame_.policy = options.policy;
  frame_.workers = options.workers;
  frame_.interval = interval_;
}

Publisher::~Publisher() {
  {
    const std::lock_guard guard(lock_);
    stop_ = true;
  }
  stop_condition_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Publisher::main() {
  pthread_setname_np(pthread_self(), "redag-live");
  std::unique_lock lock(lock_);
  while (!stop_) {
    lock.unlock();
    publish(read_clock(CLOCK_MONOTONIC));
    lock.lock();
    stop_condition_.wait_for(lock, std::chrono::nanoseconds(interval_), [this] { return stop_; });
  }
}

void Publisher::publish(Time now) {
  sample_.dags.clear();
  sample_.tasks.clear();
  sampler_(sample_);
  builder_.build(sample_, now, frame_);
  frame_.publisher_cpu = read_clock(CLOCK_THREAD_CPUTIME_ID);
  writer_->publish(frame_);
}

}  // namespace redag::live
