// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/serve/metrics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag/live/reader.hpp"

namespace redag::cli {
namespace {

using ::testing::HasSubstr;

constexpr Duration kMs = kMillisecond;

live::Frame frame() {
  live::Frame frame;
  frame.name = "a \"cart\"\\\n";
  frame.program = "redag";
  frame.workers = 2;
  frame.began = kSecond;
  frame.published = 3 * kSecond;
  frame.dags = {{.name = "fast", .deadline = 8 * kMs, .late = 3}};
  live::TaskFrame task{.name = "sense", .dag = 0, .period = 10 * kMs, .deadline = 8 * kMs};
  task.figures.released = 12;
  task.figures.finished = 7;
  task.figures.skipped = 2;
  task.figures.misses = 4;
  task.figures.cpu = 1500 * kMs;
  task.figures.ready = 1;
  task.figures.response_max = 3 * kMs;
  task.spread.all[0] = 4;
  task.spread.all[1] = 2;
  task.spread.all[live::page::kClasses - 1] = 1;
  frame.tasks.push_back(task);
  frame.threads = {{.index = 1, .used = 250 * kMs}};
  frame.tasks[0].figures.away = 2;
  frame.devices = {{.name = "gpu", .slots = 4, .used = 3, .queued = 5, .served = 6, .busy = 700 * kMs}};
  return frame;
}

std::string text_of(const std::vector<live::Listed> &pages) { return metrics_text(pages, 4 * kSecond); }

TEST(Metrics, AreInSecondsAndNamedByExecutorDagAndTask) {
  const std::string text = text_of({{"redag.7.1", 7, 1, live::Page{{}, frame()}}});
  const std::string executor = R"(executor="a \"cart\"\\\n",pid="7",number="1")";
  const std::string task = executor + R"(,dag="fast",task="sense")";
  for (const std::string &line : {"redag_executor_workers{" + executor + "} 2",
                                  "redag_executor_uptime_seconds{" + executor + "} 2",
                                  "redag_page_age_seconds{" + executor + "} 1",
                                  "redag_thread_cpu_seconds_total{" + executor + ",thread=\"1\"} 0.25",
                                  "redag_jobs_released_total{" + task + "} 12",
                                  "redag_jobs_ended_total{" + task + ",outcome=\"skipped\"} 2",
                                  "redag_deadline_misses_total{" + task + "} 4",
                                  "redag_cpu_seconds_total{" + task + "} 1.5",
                                  "redag_jobs{" + task + ",state=\"ready\"} 1",
                                  "redag_deadline_seconds{" + task + "} 0.008",
                                  "redag_response_max_seconds{" + task + "} 0.003",
                                  "redag_response_seconds_count{" + task + "} 7",
                                  "redag_jobs_away{" + task + "} 2",
                                  "redag_device_slots{" + executor + ",device=\"gpu\"} 4",
                                  "redag_device_slots_used{" + executor + ",device=\"gpu\"} 3",
                                  "redag_device_jobs_queued{" + executor + ",device=\"gpu\"} 5",
                                  "redag_device_served_total{" + executor + ",device=\"gpu\"} 6",
                                  "redag_device_busy_seconds_total{" + executor + ",device=\"gpu\"} 0.7",
                                  "redag_end_to_end_late_total{" + executor + ",dag=\"fast\"} 3",
                                  std::string("redag_unreadable_pages 0")}) {
    EXPECT_THAT(text, HasSubstr(line + "\n"));
  }
  EXPECT_THAT(text, ::testing::Not(HasSubstr("redag_response_bound_seconds"))) << "no bound is known";
}

// Each bucket states the longest time of its class: 1024 ns belongs to the next one.
TEST(Metrics, BucketsAreCumulative) {
  const std::string text = text_of({{"redag.7.1", 7, 1, live::Page{{}, frame()}}});
  EXPECT_THAT(text, HasSubstr("le=\"1.535e-06\"} 4\n"));
  EXPECT_THAT(text, HasSubstr("le=\"2.047e-06\"} 6\n"));
  EXPECT_THAT(text, HasSubstr("le=\"+Inf\"} 7\n"));
}

TEST(Metrics, PagesThatCannotBeReadAreCounted) {
  EXPECT_EQ(text_of({{"redag.7.0", 7, 0, make_error("damaged")}}),
            "# HELP redag_unreadable_pages Live pages that could not be read.\n"
            "# TYPE redag_unreadable_pages gauge\n"
            "redag_unreadable_pages 1\n");
}

}  // namespace
}  // namespace redag::cli
