// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/recorder.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "redag/loader/text_file.hpp"
#include "redag/threads/clock.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/this_machine.hpp"

namespace redag::runtime {
namespace {

constexpr Duration kCollectEvery = 100 * kMillisecond;
constexpr Duration kDescribeEvery = kSecond;  // while measured execution times grow

}  // namespace

Result<std::unique_ptr<Recorder>> Recorder::create(const std::string &folder, std::uint64_t most_bytes) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return file_error(folder, 0, "cannot create the folder of the record: " + error.message());
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    return file_error(folder, 0, std::string("cannot write the record into this folder: ") + std::strerror(errno),
                      "choose another folder, or its permissions");
  }
  const std::string path = folder + "/" + std::string(trace::kEventsFile);
  Result<std::string> aside = trace::move_unfinished_aside(path);
  if (!aside) return tl::unexpected<Diagnostics>(std::move(aside.error()));
  return std::unique_ptr<Recorder>(new Recorder(path, most_bytes, *std::move(aside)));
}

Recorder::~Recorder() { end_thread(); }

Result<void> Recorder::start(Engine &engine, Describe describe, const std::string &name) {
  if (thread_.joinable()) return {};
  engine_ = &engine;
  describe_ = std::move(describe);
  name_ = name;
  if (Result<void> described = describe_again(); !described) return described;
  return start_thread({name + "-record", 0, {}}, [this] { main(); }).map([this](ThreadHandle &&thread) {
    thread_ = std::move(thread);
  });
}

void Recorder::main() noexcept {
  while (!stop_.wait_until(monotonic_now() + kCollectEvery)) collect(kNever);
}

void Recorder::end_thread() {
  stop_.set();
  if (thread_.joinable()) thread_.join();
}

// A record needs at least one task.
Result<void> Recorder::describe_again() {
  trace::RunInfo info = describe_();
  trace::add_provenance(info);
  described_at_ = monotonic_now();
  if (info.workload.dags.empty()) return {};
  const bool is_known = info.workload == described_ && info.removals == removals_ && info.settled == settled_;
  if (file_ && is_known) return {};
  described_ = info.workload;
  removals_ = info.removals;
  settled_ = info.settled;
  if (file_) return file_->describe(info);
  return trace::EventsWriter::record(path_, info, most_bytes_).map([this](trace::EventsWriter &&file) {
    file_.emplace(std::move(file));
  });
}

// Takes the events since the last call. Those after the end of the run follow no rules and are left out.
void Recorder::collect(Time end) {
  events_.clear();
  engine_->drain(events_, end != kNever);
  if (!state_) return;
  const Time cut = std::min(end, engine_->halted_at());
  std::erase_if(events_, [cut](const JobEvent &event) { return event.time >= cut; });
  const std::size_t tasks = described_.task_count();
  const bool has_new_task =
      std::any_of(events_.begin(), events_.end(), [&](const JobEvent &e) { return e.task.value >= tasks; });
  const bool is_old = monotonic_now() - described_at_ >= kDescribeEvery;
  if (has_new_task || is_old || end != kNever) state_ = describe_again();
  if (state_ && file_) {
    file_->add(events_);
    state_ = file_->flush(engine_->lost_events());
  }
  if (state_ || end != kNever) return;
  std::fprintf(stderr, "%s: the record of the run ends here: %s\n", name_.c_str(), to_string(state_.error()).c_str());
}

Result<void> Recorder::finish(Time end) {
  if (engine_ == nullptr) return {};  // the run never began
  end_thread();
  // An executor can be stopped before its first millisecond is over, at which its times begin.
  end = std::max<Time>(end, 0);
  collect(end);
  const std::uint64_t lost = engine_->lost_events();
  engine_ = nullptr;
  return state_ && file_ ? file_->commit(end, lost) : state_;
}

}  // namespace redag::runtime
