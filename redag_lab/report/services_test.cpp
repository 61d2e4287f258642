// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/services.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "redag_lab/report/schedule.hpp"
#include "redag_lab/report/timeline.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::report {
namespace {

constexpr Time ms(Time count) { return count * kMillisecond; }

// A device of two slots and one of one. The jobs of three tasks ask them; one service is in progress at the end.
trace::Trace with_devices() {
  Workload workload =
      testing::make_workload({testing::make_dag("d", {{"a", 100}, {"b", 100}, {"c", 100}})}, 1, PreemptionMode::Os);
  workload.platform.devices = {{.name = "gpu", .slots = 2}, {.name = "dla"}};
  testing::TraceBuilder run(workload);
  run.at(0).arrives("a", 0).arrives("b", 0).arrives("c", 0);
  run.dispatched("a", 0, 0, 100).at(1).waits("a", 0, 0, 0).served("a", 0, 0);
  run.dispatched("b", 0, 0, 100).at(2).waits("b", 0, 0, 0).served("b", 0, 0);
  run.dispatched("c", 0, 0, 100).at(3).waits("c", 0, 0, 0);
  run.at(5).woken("a", 0, 0).served("c", 0, 0).resumed("a", 0, 0).at(6).waits("a", 0, 0, 1).served("a", 0, 1);
  run.at(9).woken("b", 0, 0).resumed("b", 0, 0).at(10).waits("b", 0, 0, -1).at(12).woken("b", 0, -1);
  return run.until(20);
}

std::vector<Service> services_of(const trace::Trace &trace) {
  std::vector<Service> services;
  ServiceFolder folder(trace.info);
  folder.add(trace.events);
  folder.finish();
  folder.drain([&](const Service &service) { services.push_back(service); });
  std::stable_sort(services.begin(), services.end(),
                   [](const Service &a, const Service &b) { return a.begin < b.begin; });
  return services;
}

TEST(Services, TakeTheFirstSlotThatIsFree) {
  const TaskId a(0), b(1), c(2);
  const DeviceId gpu(0), dla(1);
  EXPECT_EQ(services_of(with_devices()), (std::vector<Service>{{ms(1), ms(5), a, 0, gpu, 0},
                                                               {ms(2), ms(9), b, 0, gpu, 1},
                                                               {ms(5), ms(20), c, 0, gpu, 0},
                                                               {ms(6), ms(20), a, 0, dla, 0}}));
}

TEST(Services, FillTheTimelineAndTheWindowsOfTheSchedule) {
  const trace::Trace trace = with_devices();
  TimelineBuilder builder(trace.info, 2);
  for (const Service &service : services_of(trace)) builder.add(service);
  const Timeline timeline = builder.take();
  EXPECT_EQ(timeline.device_busy, (std::vector<std::vector<Duration>>{{ms(4 + 7 + 5), ms(10)}, {ms(4), ms(10)}}));
  const Schedule schedule = schedule_of(trace, 100, 1).value();
  EXPECT_EQ(schedule.windows.front().services, services_of(trace));
}

TEST(Services, OfDevicesThatTheWorkloadDoesNotKnowAreLeftOut) {
  trace::Trace trace = with_devices();
  trace.info.workload.platform.devices.pop_back();
  EXPECT_EQ(services_of(trace).size(), 3U);
}

}  // namespace
}  // namespace redag::report
