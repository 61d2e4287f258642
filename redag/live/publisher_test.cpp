// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/publisher.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "redag/live/reader.hpp"

namespace redag::live {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TaskSample task_of(std::uint64_t key, std::uint32_t dag, std::uint64_t finished,
                   std::shared_ptr<const Histogram> response = nullptr) {
  TaskSample task;
  task.key = key;
  task.name = "t" + std::to_string(key);
  task.dag = dag;
  task.released = finished;
  task.finished = finished;
  task.response = std::move(response);
  return task;
}

TEST(FrameBuilder, RecentIsTheLastWindowOrTwo) {
  FrameBuilder builder(0, 2 * kSecond);
  const auto response = std::make_shared<Histogram>();
  std::uint64_t finished = 0;
  for (int half = 1; half <= 40; ++half) {
    // 50 jobs each half second: slow ones for five seconds, then quick ones.
    for (int i = 0; i < 50; ++i) response->add(half <= 10 ? kSecond : kMillisecond);
    finished += 50;
    Sample sample{{{"dag", 0}}, {task_of(1, 0, finished, response)}};
    sample.tasks[0].misses = half <= 10 ? finished : 500;
    sample.tasks[0].cpu = static_cast<Duration>(finished) * kMillisecond;
    sample.tasks[0].preemptions = finished / 2;
    Frame frame;
    const Time now = half * (kSecond / 2);
    builder.build(sample, now, frame);
    const page::Figures &figures = frame.tasks[0].figures;
    EXPECT_EQ(figures.finished, finished);
    EXPECT_EQ(figures.response_max, kSecond);
    EXPECT_GE(frame.window, std::min<Duration>(now, 2 * kSecond));
    EXPECT_LE(frame.window, 4 * kSecond);
    EXPECT_EQ(figures.recent_jobs, static_cast<std::uint64_t>(frame.window / (kSecond / 100)));
    EXPECT_EQ(figures.recent_cpu, static_cast<Duration>(figures.recent_jobs) * kMillisecond);
    EXPECT_EQ(figures.recent_preemptions, figures.recent_jobs / 2);
    const bool slow_in_window = now - frame.window < 5 * kSecond;
    EXPECT_EQ(figures.recent_misses > 0, slow_in_window) << half;
    EXPECT_EQ(figures.recent_max > 2 * kMillisecond, slow_in_window) << half;
  }
}

TEST(FrameBuilder, ADagIsTheSumOfItsTasks) {
  FrameBuilder builder(0, kSecond);
  const auto quick = std::make_shared<Histogram>();
  const auto slow = std::make_shared<Histogram>();
  for (int i = 0; i < 98; ++i) quick->add(kMillisecond);
  slow->add(kSecond);
  slow->add(kSecond);
  Sample sample{{{"a", 1}, {"b", 0}}, {task_of(3, 1, 98, quick), task_of(1, 0, 5), task_of(2, 1, 2, slow)}};
  sample.tasks[0].active = 1;
  sample.tasks[2].active = 2;
  sample.tasks[2].ready = 3;
  sample.tasks[2].waiting = 4;
  sample.tasks[0].away = 1;
  sample.tasks[2].away = 2;
  Frame frame;
  builder.build(sample, kSecond / 2, frame);
  ASSERT_THAT(frame.dags, SizeIs(2));
  EXPECT_EQ(frame.dags[0].max_active, 1U);
  EXPECT_EQ(frame.dags[0].figures.finished, 5U);
  EXPECT_EQ(frame.dags[0].figures.response_max, 0);
  EXPECT_EQ(frame.dags[1].figures.finished, 100U);
  EXPECT_EQ(frame.dags[1].figures.active, 3U);
  EXPECT_EQ(frame.dags[1].figures.ready, 3U);
  EXPECT_EQ(frame.dags[1].figures.waiting, 4U);
  EXPECT_EQ(frame.dags[1].figures.away, 3U);
  EXPECT_EQ(frame.dags[1].figures.response_p50, 0) << "of jobs of two tasks there is none";
  EXPECT_EQ(frame.dags[1].figures.response_max, 0);
  EXPECT_EQ(frame.dags[1].figures.recent_p99, 0);
  // By DAG, within a DAG in the given order.
  EXPECT_EQ(frame.tasks[0].name, "t1");
  EXPECT_EQ(frame.tasks[1].name, "t3");
  EXPECT_EQ(frame.tasks[2].name, "t2");
}

TEST(FrameBuilder, ADagAnswersEndToEndByItsWorstSink) {
  FrameBuilder builder(0, kSecond);
  const auto histogram = [](Duration value, int count) {
    auto made = std::make_shared<Histogram>();
    for (int i = 0; i < count; ++i) made->add(value);
    return made;
  };
  Sample sample{{{"a", 0, 3 * kMillisecond}},
                {task_of(1, 0, 9, histogram(9 * kSecond, 9)), task_of(2, 0, 100, histogram(10, 100)),
                 task_of(3, 0, 5, histogram(20, 5))}};
  const auto often = histogram(kMillisecond, 99);
  often->add(kSecond);
  sample.tasks[1].end_to_end = often;
  sample.tasks[1].late_end_to_end = 1;
  const auto rare = histogram(4 * kMillisecond, 5);
  sample.tasks[2].end_to_end = rare;
  sample.tasks[2].late_end_to_end = 5;
  Frame frame;
  builder.build(sample, 2 * kSecond, frame);
  const DagFrame &dag = frame.dags[0];
  EXPECT_EQ(dag.figures.response_max, kSecond) << "of the first sink";
  EXPECT_EQ(dag.figures.response_p99, 4 * kMillisecond) << "of the second sink";
  EXPECT_EQ(dag.figures.recent_p50, 4 * kMillisecond);
  EXPECT_EQ(dag.deadline, 3 * kMillisecond);
  EXPECT_EQ(dag.late, 6U);
  EXPECT_EQ(dag.recent_late, 6U);
  for (int second = 3; second <= 6; ++second) builder.build(sample, second * kSecond, frame);
  EXPECT_EQ(dag.late, 6U);
  EXPECT_EQ(dag.recent_late, 0U);
  EXPECT_EQ(dag.figures.recent_max, 0);
  EXPECT_EQ(dag.figures.response_max, kSecond);
}

TEST(FrameBuilder, ASpreadCountsClassesOfTime) {
  FrameBuilder builder(0, kSecond);
  const auto response = std::make_shared<Histogram>();
  const std::vector<std::pair<Duration, std::size_t>> classes{
      {0, 0},    {1535, 0},       {1536, 1},     {2047, 1},          {2048, 2},
      {3072, 3}, {1'000'000, 19}, {kSecond, 39}, {12 * kSecond, 46}, {1000 * kSecond, 47}};
  std::vector<std::uint32_t> expected(page::kClasses);
  for (const auto &[time, index] : classes) {
    response->add(time);
    ++expected[index];
    EXPECT_LE(index == 0 ? 0 : page::least_in(index), time);
    if (index + 1 < page::kClasses) {
      EXPECT_GT(page::least_in(index + 1), time);
    }
  }
  Frame frame;
  builder.build({{{"a", 0}}, {task_of(1, 0, 10, response)}}, kSecond / 2, frame);
  EXPECT_THAT(frame.tasks[0].spread.all, ::testing::ElementsAreArray(expected));
  for (int second = 1; second <= 3; ++second) {
    builder.build({{{"a", 0}}, {task_of(1, 0, 10, response)}}, second * kSecond, frame);
  }
  EXPECT_THAT(frame.tasks[0].spread.all, ::testing::ElementsAreArray(expected));
}

TEST(FrameBuilder, ThreadsNameTheTaskThatTheyRun) {
  FrameBuilder builder(0, kSecond);
  Sample sample{{{"a", 0}, {"b", 0}}, {task_of(7, 1, 0), task_of(8, 0, 0)}};
  sample.threads = {{kSecond, 7}, {0, {}}, {5, 99}};
  Frame frame;
  builder.build(sample, kSecond, frame);
  builder.build(sample, 2 * kSecond, frame);
  sample.threads[0].used += 30;
  builder.build(sample, 3 * kSecond, frame);
  EXPECT_EQ(frame.threads_in_all, 3U);
  ASSERT_THAT(frame.threads, SizeIs(3));
  EXPECT_EQ(frame.threads[0].task, 1U) << "rows are ordered by DAG";
  EXPECT_EQ(frame.threads[0].used, kSecond + 30);
  EXPECT_EQ(frame.threads[0].recent_used, 30);
  EXPECT_EQ(frame.threads[1].task, std::nullopt);
  EXPECT_EQ(frame.threads[2].task, std::nullopt) << "a task that is no longer there";

  // Of too many threads, those that did most lately.
  sample.threads.assign(100, {});
  builder.build(sample, 4 * kSecond, frame);
  for (std::size_t i = 20; i < 100; ++i) sample.threads[i].used = static_cast<Duration>(i);
  builder.build(sample, 4 * kSecond + 1, frame);
  EXPECT_EQ(frame.threads_in_all, 100U);
  ASSERT_THAT(frame.threads, SizeIs(page::kThreads));
  EXPECT_EQ(frame.threads.front().index, 36U);
  EXPECT_EQ(frame.threads.back().index, 99U);
}

TEST(FrameBuilder, DevicesNameTheTasksThatTheyServe) {
  FrameBuilder builder(0, kSecond);
  Sample sample{{{"a", 0}, {"b", 0}}, {task_of(7, 1, 0), task_of(8, 0, 0)}};
  sample.devices = {{"gpu", 2, 3, 10, kSecond, {7, 8}}, {"dla", 1, 0, 0, 0, {99}}};
  Frame frame;
  builder.build(sample, kSecond, frame);
  builder.build(sample, 2 * kSecond, frame);
  sample.devices[0].served += 4;
  sample.devices[0].busy += 30;
  builder.build(sample, 3 * kSecond, frame);
  EXPECT_EQ(frame.devices_in_all, 2U);
  ASSERT_THAT(frame.devices, SizeIs(2));
  const DeviceFrame &gpu = frame.devices[0];
  EXPECT_EQ(gpu.name, "gpu");
  EXPECT_EQ(gpu.slots, 2U);
  EXPECT_EQ(gpu.used, 2U);
  EXPECT_EQ(gpu.queued, 3U);
  EXPECT_EQ(gpu.served, 14U);
  EXPECT_EQ(gpu.recent_served, 4U);
  EXPECT_EQ(gpu.busy, kSecond + 30);
  EXPECT_EQ(gpu.recent_busy, 30);
  EXPECT_THAT(gpu.tasks, ElementsAre(1U, 0U)) << "rows are ordered by DAG";
  EXPECT_EQ(frame.devices[1].used, 1U);
  EXPECT_THAT(frame.devices[1].tasks, IsEmpty()) << "a task that is no longer there";

  // A device seems to have been busy for a little less than before: no figure is negative.
  sample.devices[0].busy -= 20;
  for (int second = 4; second <= 8; ++second) {
    builder.build(sample, second * kSecond, frame);
    EXPECT_GE(frame.devices[0].recent_busy, 0);
  }

  // Of too many devices, those that did most lately, in their order.
  sample.devices.assign(page::kDevices + 3, {});
  builder.build(sample, 9 * kSecond, frame);
  for (std::size_t d = 0; d < sample.devices.size(); ++d) {
    sample.devices[d].name = std::to_string(d);
    sample.devices[d].busy = d < 3 ? 0 : static_cast<Duration>(d);
    sample.devices[d].serves.assign(6, 7);
  }
  sample.devices[1].busy = 100;
  builder.build(sample, 9 * kSecond + 1, frame);
  EXPECT_EQ(frame.devices_in_all, page::kDevices + 3);
  ASSERT_THAT(frame.devices, SizeIs(page::kDevices));
  EXPECT_EQ(frame.devices[0].name, "1");
  EXPECT_EQ(frame.devices[1].name, "4");
  EXPECT_THAT(frame.devices[1].tasks, SizeIs(page::kServices));
  EXPECT_EQ(frame.devices.back().name, "14");
}

TEST(FrameBuilder, TheResponseOfASingleTaskIsItsDags) {
  FrameBuilder builder(0, kSecond);
  const auto slow = std::make_shared<Histogram>();
  slow->add(kSecond);
  Frame frame;
  TaskSample task = task_of(1, 0, 1, slow);
  task.end_to_end = slow;
  builder.build({{{"a", 0}}, {task}}, kSecond / 2, frame);
  EXPECT_EQ(frame.dags[0].figures.response_max, kSecond);
  EXPECT_EQ(frame.dags[0].figures.response_p99, frame.tasks[0].figures.response_p99);
  EXPECT_EQ(frame.dags[0].figures.recent_max, frame.tasks[0].figures.recent_max);
}

TEST(FrameBuilder, AKeyThatIsUsedAgainBeginsAnew) {
  FrameBuilder builder(0, kSecond);
  const auto first = std::make_shared<Histogram>();
  for (int i = 0; i < 10; ++i) first->add(kSecond);
  Frame frame;
  for (int second = 1; second <= 3; ++second)
    builder.build({{{"a", 0}}, {task_of(1, 0, 10, first)}}, second * kSecond, frame);
  EXPECT_EQ(frame.tasks[0].figures.recent_jobs, 0U);
  const auto second = std::make_shared<Histogram>();
  for (int i = 0; i < 20; ++i) second->add(kMillisecond);
  builder.build({{{"a", 0}}, {task_of(1, 0, 20, second)}}, 4 * kSecond, frame);
  EXPECT_EQ(frame.tasks[0].figures.recent_jobs, 20U);
  EXPECT_LE(frame.tasks[0].figures.recent_max, kMillisecond);
}

class TemporaryFolder {
 public:
  TemporaryFolder() : path_(::testing::TempDir() + "redag_publisher_XXXXXX") {
    EXPECT_NE(::mkdtemp(path_.data()), nullptr);
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  [[nodiscard]] const std::string &path() const { return path_; }

 private:
  std::string path_;
};

/// Waits until `is_so` returns true; otherwise the test ends by its own time limit.
template <class Condition>
void wait_until(Condition is_so) {
  while (!is_so()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

TEST(Publisher, PublishesUntilItIsGone) {
  const TemporaryFolder folder;
  PublisherOptions options;
  options.folder = folder.path();
  options.name = "cart";
  options.interval = kMillisecond;
  const auto response = std::make_shared<Histogram>();
  std::atomic<std::uint64_t> finished{0};
  std::atomic<int> samples{0};
  auto publisher = Publisher::start(options, [&](Sample &sample) {
    EXPECT_TRUE(sample.dags.empty() && sample.tasks.empty() && sample.threads.empty() && sample.devices.empty());
    sample.dags = {{"a", 2}};
    sample.tasks = {task_of(1, 0, finished, response)};
    sample.threads = {{}};
    sample.devices = {{}};
    ++samples;
  });
  ASSERT_TRUE(publisher) << to_string(publisher.error());
  const std::string path = (*publisher)->path();
  // Jobs run meanwhile, as on workers.
  for (int i = 0; i < 20'000; ++i) {
    response->add(kMillisecond);
    ++finished;
  }
  wait_until([&] {
    const Result<Page> page = read_page(path);
    return page && !page->frame.tasks.empty() && page->frame.tasks[0].figures.finished == 20'000;
  });
  const Result<Page> page = read_page(path);
  ASSERT_TRUE(page);
  EXPECT_EQ(page->frame.name, "cart");
  EXPECT_EQ(page->frame.interval, kMillisecond);
  EXPECT_GT(page->frame.publisher_cpu, 0);
  EXPECT_GE(page->frame.published, page->frame.began);
  EXPECT_GE(page->frame.tasks[0].figures.response_p50, kMillisecond);
  publisher->reset();
  EXPECT_FALSE(std::filesystem::exists(path));
  const int before = samples;
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_EQ(samples, before);
}

}  // namespace
}  // namespace redag::live
