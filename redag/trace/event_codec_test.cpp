// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/event_codec.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "redag/derived/rng.hpp"
#include "redag/loader/validate.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {
namespace {

constexpr std::size_t kTasks = 5;

JobEvent random_event(Rng &rng) {
  JobEvent event;
  event.time = rng.uniform(-kMaxTraceTime, kMaxTraceTime);
  event.value = rng.uniform(-kMaxDuration, kMaxDuration);
  event.task = TaskId(static_cast<std::size_t>(rng.uniform(0, kTasks - 1)));
  event.job = static_cast<std::uint32_t>(rng());
  event.worker = rng.uniform(0, 2) == 0 ? WorkerId::kNoneValue : static_cast<std::uint32_t>(rng.uniform(0, 4095));
  event.kind = static_cast<JobEventKind>(rng.uniform(0, static_cast<int>(kLastJobEventKind)));
  event.kind = static_cast<JobEventKind>(rng.uniform(0, static_cast<int>(kLastJobEventKind)));
  const bool has_reasons = event.kind < JobEventKind::Served;  // of later kinds the code has no reason
  event.reason = has_reasons ? static_cast<Reason>(rng.uniform(0, static_cast<int>(kLastReason))) : Reason::None;
  return event;
}

std::string encoded(const std::vector<JobEvent> &events, Time base) {
  std::string code;
  EventCodec(kTasks).encode(events, base, code);
  return code;
}

TEST(EventCodec, GivesBackAnyEvents) {
  Rng rng(7);
  for (int round = 0; round < 200; ++round) {
    std::vector<JobEvent> events(static_cast<std::size_t>(rng.uniform(0, 60)));
    for (JobEvent &event : events) event = random_event(rng);
    const Time base = rng.uniform(-kMaxTraceTime, kMaxTraceTime);
    const std::string code = encoded(events, base);
    EXPECT_LE(code.size(), most_encoded_bytes(events.size()));
    EventCodec codec(kTasks);
    std::vector<JobEvent> again;
    ASSERT_TRUE(codec.decode(code, base, again));
    EXPECT_EQ(again, events);
    // A codec is used for block after block.
    ASSERT_TRUE(codec.decode(code, base, again));
    EXPECT_EQ(again, events);
  }
}

TEST(EventCodec, APeriodicJobTakesAFewBytes) {
  std::vector<JobEvent> events;
  const auto add = [&](JobEventKind kind, std::uint32_t job, Time time, std::int64_t value, std::uint32_t worker) {
    events.push_back({.time = time, .value = value, .task = TaskId(1), .job = job, .worker = worker, .kind = kind});
  };
  for (std::uint32_t job = 0; job < 1000; ++job) {
    const Time release = job * kMillisecond;
    add(JobEventKind::Released, job, release, release, WorkerId::kNoneValue);
    add(JobEventKind::Ready, job, release, release, WorkerId::kNoneValue);
    add(JobEventKind::Dispatched, job, release, release + kMillisecond, 3);
    add(JobEventKind::Finished, job, release + 250'000, release + 250'000, 3);
  }
  EXPECT_LT(encoded(events, 0).size(), events.size() * 9);
}

TEST(EventCodec, CodeOfOtherEventsIsRefused) {
  Rng rng(1);
  std::vector<JobEvent> events(20);
  for (JobEvent &event : events) event = random_event(rng);
  const std::string code = encoded(events, 0);
  std::vector<JobEvent> out;
  EventCodec codec(kTasks);
  for (std::size_t length = 0; length < code.size(); ++length) {
    EXPECT_FALSE(codec.decode(std::string_view(code).substr(0, length), 0, out)) << length;
  }
  EXPECT_FALSE(codec.decode(code + '\0', 0, out));
  EXPECT_FALSE(EventCodec(1).decode(code, 0, out)) << "tasks that the run does not have";

  const auto one_with = [&](const auto &change) {
    JobEvent event = random_event(rng);
    change(event);
    return codec.is_event(event);
  };
  EXPECT_TRUE(one_with([](JobEvent &) {}));
  EXPECT_FALSE(one_with([](JobEvent &event) { event.task = TaskId(kTasks); }));
  EXPECT_FALSE(one_with([](JobEvent &event) { event.worker = kMaxWorkers; }));
  EXPECT_FALSE(one_with([](JobEvent &event) { event.time = kMaxTraceTime + 1; }));
  EXPECT_FALSE(one_with([](JobEvent &event) { event.value = std::numeric_limits<std::int64_t>::max(); }));
  EXPECT_FALSE(one_with([](JobEvent &event) { event.kind = static_cast<JobEventKind>(15); }));
  EXPECT_FALSE(one_with([](JobEvent &event) { event.reason = static_cast<Reason>(15); }));
}

TEST(EventCodec, RandomBytesNeverCrash) {
  Rng rng(3);
  EventCodec codec(kTasks);
  std::vector<JobEvent> out;
  for (int round = 0; round < 2000; ++round) {
    std::string code(static_cast<std::size_t>(rng.uniform(0, 80)), '\0');
    for (char &c : code) c = static_cast<char>(rng());
    if (!codec.decode(code, 0, out)) continue;
    for (const JobEvent &event : out) EXPECT_TRUE(codec.is_event(event));
  }
}

}  // namespace
}  // namespace redag::trace
