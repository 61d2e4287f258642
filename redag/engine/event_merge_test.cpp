// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/event_merge.hpp"

#include <gtest/gtest.h>

namespace redag::runtime {
namespace {

using Kind = JobEventKind;

JobEvent event(Time time, Kind kind, std::uint32_t task) {
  JobEvent e;
  e.time = e.value = time;
  e.kind = kind;
  e.task = TaskId(task);
  return e;
}

// Formats events as "D0@5": the first letter of the kind, the task, the time.
std::string text(const std::vector<JobEvent> &events) {
  std::string out;
  for (const JobEvent &e : events) {
    out += std::string(out.empty() ? "" : " ") + to_string(e.kind)[0] + std::to_string(e.task.value) + "@" +
           std::to_string(e.time);
  }
  return out;
}

TEST(EventMerge, StartedComesByTime) {
  EventMerge merge;
  merge.decisions() = {event(1, Kind::Dispatched, 0), event(5, Kind::Dispatched, 1), event(9, Kind::Finished, 0)};
  merge.started() = {event(6, Kind::Started, 1), event(3, Kind::Started, 0)};
  std::vector<JobEvent> out;
  merge.merge(out, false);
  const std::string d(1, to_string(Kind::Dispatched)[0]);
  const std::string s(1, to_string(Kind::Started)[0]);
  const std::string f(1, to_string(Kind::Finished)[0]);
  EXPECT_EQ(text(out), d + "0@1 " + s + "0@3 " + d + "1@5 " + s + "1@6 " + f + "0@9");
}

TEST(EventMerge, AtEqualTimesAJobIsDispatchedThenBeginsThenEnds) {
  EventMerge merge;
  merge.decisions() = {event(4, Kind::Dispatched, 2), event(4, Kind::Finished, 1), event(4, Kind::Finished, 2)};
  merge.started() = {event(4, Kind::Started, 2), event(4, Kind::Started, 0)};
  std::vector<JobEvent> out;
  merge.merge(out, false);
  ASSERT_EQ(out.size(), 4U);  // job 0's Dispatched may still come
  EXPECT_EQ(out[0].kind, Kind::Dispatched);
  EXPECT_EQ(out[1].kind, Kind::Finished);
  EXPECT_EQ(out[2].kind, Kind::Started);
  EXPECT_EQ(out[2].task, TaskId(2));
  EXPECT_EQ(out[3].kind, Kind::Finished);
  merge.merge(out, true);
  ASSERT_EQ(out.size(), 5U);
  EXPECT_EQ(out[4].task, TaskId(0));
}

TEST(EventMerge, AtEqualTimesABodyEndsBeforeItsJob) {
  EventMerge merge;
  merge.decisions() = {event(4, Kind::Dispatched, 1), event(7, Kind::Finished, 1)};
  merge.started() = {event(7, Kind::Executed, 1), event(7, Kind::Executed, 0), event(7, Kind::Started, 1)};
  std::vector<JobEvent> out;
  merge.merge(out, false);
  ASSERT_EQ(out.size(), 4U);  // the events of job 0 may have to wait
  EXPECT_EQ(out[1].kind, Kind::Started);
  EXPECT_EQ(out[2].kind, Kind::Executed);
  EXPECT_EQ(out[2].task, TaskId(1));
  EXPECT_EQ(out[3].kind, Kind::Finished);
}

TEST(EventMerge, ALateStartedKeepsItsExactTimeInValue) {
  EventMerge merge;
  std::vector<JobEvent> out;
  merge.decisions() = {event(1, Kind::Dispatched, 0), event(8, Kind::Dispatched, 1)};
  merge.merge(out, false);
  merge.started() = {event(2, Kind::Started, 0)};  // its thread was preempted before it could report it
  merge.decisions() = {event(9, Kind::Finished, 0)};
  merge.merge(out, false);
  ASSERT_EQ(out.size(), 4U);
  EXPECT_EQ(out[2].kind, Kind::Started);
  EXPECT_EQ(out[2].time, 8);
  EXPECT_EQ(out[2].value, 2);
}

}  // namespace
}  // namespace redag::runtime
