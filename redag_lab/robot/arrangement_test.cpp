// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Real threads of this process, which the kernel really raises and lowers. Interrupts are those of a folder.
#include "redag_lab/robot/arrangement.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "redag/live/process.hpp"

namespace redag::robot {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

bool never_stops() { return false; }

std::string contents(const fs::path &path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::uint64_t start_of(std::int64_t tid) {
  return live::start_time_in(contents(fmt::format("/proc/self/task/{}/stat", tid))).value_or(0);
}

// A thread that waits, and does one thing when it is told to end.
class Waiting {
 public:
  explicit Waiting(std::function<void()> at_end = {}) {
    std::unique_lock lock(mutex_);
    thread_ = std::thread([this, at_end = std::move(at_end)] {
      std::unique_lock own(mutex_);
      tid_ = gettid();
      changed_.notify_all();
      changed_.wait(own, [this] { return ends_; });
      if (at_end) at_end();
    });
    changed_.wait(lock, [this] { return tid_ != 0; });
  }
  ~Waiting() { end(); }
  void end() {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
  }
  [[nodiscard]] ThreadId id() const { return {getpid(), tid_, start_of(tid_)}; }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::int64_t tid_ = 0;
  bool ends_ = false;
  std::thread thread_;
};

class ArrangementTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const Waiting probe;
    const ThreadChange change = raise(probe);
    if (const Result<void> raised = system_.set(change.thread, "probe", change.after); !raised) {
      GTEST_SKIP() << to_string(raised.error());
    }
    folder_ = fs::temp_directory_path() / fmt::format("redag-arrangement-{}", getpid());
    fs::create_directory(folder_);
    path_ = (folder_ / "state.json").string();
  }
  void TearDown() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }

  [[nodiscard]] Arrangement open() const {
    Result<Arrangement> opened = Arrangement::open(system_, path_);
    if (!opened) throw std::runtime_error(to_string(opened.error()));
    return *std::move(opened);
  }

  // Raises the thread, and confines it to one processor.
  [[nodiscard]] ThreadChange raise(const Waiting &thread) const {
    ThreadChange change;
    change.thread = thread.id();
    change.name = "t";
    change.entry = "threads t";
    change.before = system_.state_of(change.thread).value();
    change.after = ThreadState{{Scheduling::Class::Fifo, kRaised, 0, true}, {change.before.cpus.back()}};
    return change;
  }
  [[nodiscard]] std::optional<ThreadState> now(const ThreadChange &change) const {
    return system_.state_of(change.thread);
  }

  static constexpr int kRaised = 5;
  System system_;
  fs::path folder_;
  std::string path_;
};

TEST_F(ArrangementTest, AppliesAndUndoes) {
  const Waiting a;
  const Waiting b;
  Changes changes;
  changes.threads = {raise(a), raise(b)};
  Arrangement arrangement = open();
  const Result<bool> applied = arrangement.apply(changes, never_stops);
  ASSERT_TRUE(applied) << to_string(applied.error());
  EXPECT_TRUE(*applied);
  for (const ThreadChange &change : changes.threads) EXPECT_EQ(now(change), change.after);
  const Result<Arrangement::Undone> undone = arrangement.undo();
  ASSERT_TRUE(undone) << to_string(undone.error());
  EXPECT_EQ(undone->restored, 2u);
  EXPECT_TRUE(undone->remarks.empty());
  for (const ThreadChange &change : changes.threads) EXPECT_EQ(now(change), change.before);
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(ArrangementTest, GivesAReservationAndTakesItBack) {
  const Waiting a;
  Changes changes;
  changes.threads = {raise(a)};
  ThreadChange &change = changes.threads[0];
  // The thread comes from one processor, where it returns, and a reservation is for all.
  change.after = change.before;
  change.before.cpus = {change.before.cpus.back()};
  ASSERT_TRUE(system_.set(change.thread, "a", change.before));
  change.after.scheduling = Scheduling{.kind = Scheduling::Class::Deadline,
                                       .resets_on_fork = true,
                                       .budget = kMillisecond,
                                       .deadline = 100 * kMillisecond,
                                       .period = 100 * kMillisecond};
  if (const Result<void> granted = system_.set(change.thread, "a", change.after); !granted) {
    GTEST_SKIP() << to_string(granted.error());
  }
  ASSERT_TRUE(system_.set(change.thread, "a", change.before));
  {
    Arrangement arrangement = open();
    const Result<bool> applied = arrangement.apply(changes, never_stops);
    ASSERT_TRUE(applied) << to_string(applied.error());
    EXPECT_EQ(now(change), change.after);
  }
  const Result<Arrangement::Undone> undone = open().undo();
  ASSERT_TRUE(undone) << to_string(undone.error());
  EXPECT_THAT(undone->remarks, ElementsAre());
  EXPECT_EQ(now(change), change.before);
}

TEST_F(ArrangementTest, NotesEverythingBeforeTheFirstChange) {
  const Waiting a;
  Changes changes;
  changes.threads = {raise(a)};
  Arrangement arrangement = open();
  int asked = 0;
  const Result<bool> applied = arrangement.apply(changes, [&] {
    if (asked++ > 0) return false;
    EXPECT_THAT(contents(path_), HasSubstr(fmt::format("\"tid\": {}", a.id().tid)));
    EXPECT_EQ(now(changes.threads[0]), changes.threads[0].before);
    return false;
  });
  EXPECT_TRUE(applied && *applied);
  EXPECT_EQ(asked, 1);
  EXPECT_TRUE(arrangement.undo());
}

TEST_F(ArrangementTest, AnInterruptedOneTakesBackWhatItDid) {
  const Waiting a;
  const Waiting b;
  Changes changes;
  changes.threads = {raise(a), raise(b)};
  Arrangement arrangement = open();
  int asked = 0;
  const Result<bool> applied = arrangement.apply(changes, [&] { return asked++ == 1; });
  ASSERT_TRUE(applied);
  EXPECT_FALSE(*applied);
  for (const ThreadChange &change : changes.threads) EXPECT_EQ(now(change), change.before);
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(ArrangementTest, AFailedOneTakesBackWhatItDid) {
  const Waiting a;
  const Waiting b;
  Changes changes;
  changes.threads = {raise(a), raise(b)};
  changes.threads[1].after.cpus = {4095};
  Arrangement arrangement = open();
  const Result<bool> applied = arrangement.apply(changes, never_stops);
  ASSERT_FALSE(applied);
  EXPECT_THAT(to_string(applied.error()), HasSubstr("cannot run on processors 4095 only"));
  EXPECT_EQ(now(changes.threads[0]), changes.threads[0].before);
  EXPECT_TRUE(arrangement.is_empty());
}

TEST_F(ArrangementTest, AnotherProcessUndoesWhatAKilledOneLeft) {
  const Waiting a;
  const Waiting b;
  Changes changes;
  changes.threads = {raise(a), raise(b)};
  {
    Arrangement arrangement = open();
    ASSERT_TRUE(arrangement.apply(changes, never_stops));
  }
  // As if it was killed between the two system calls of the second change.
  ThreadState half = changes.threads[1].before;
  half.cpus = changes.threads[1].after.cpus;
  ASSERT_TRUE(system_.set(changes.threads[1].thread, "b", half));
  const Result<Arrangement::Undone> undone = open().undo();
  ASSERT_TRUE(undone) << to_string(undone.error());
  EXPECT_TRUE(undone->remarks.empty());
  for (const ThreadChange &change : changes.threads) EXPECT_EQ(now(change), change.before);
}

TEST_F(ArrangementTest, KeepsTheOldestState) {
  const Waiting a;
  Changes changes;
  changes.threads = {raise(a)};
  const ThreadState first = changes.threads[0].before;
  Arrangement arrangement = open();
  ASSERT_TRUE(arrangement.apply(changes, never_stops));
  changes.threads[0].before = changes.threads[0].after;
  changes.threads[0].after.scheduling.priority = 3;
  ASSERT_TRUE(arrangement.apply(changes, never_stops));
  ASSERT_TRUE(arrangement.undo());
  EXPECT_EQ(now(changes.threads[0]), first);
}

TEST_F(ArrangementTest, LeavesWhatAnotherHandHasChanged) {
  const Waiting a;
  Changes changes;
  changes.threads = {raise(a)};
  Arrangement arrangement = open();
  ASSERT_TRUE(arrangement.apply(changes, never_stops));
  ThreadState other = changes.threads[0].after;
  other.scheduling.priority = 2;
  ASSERT_TRUE(system_.set(changes.threads[0].thread, "a", other));
  const Result<Arrangement::Undone> undone = arrangement.undo();
  ASSERT_TRUE(undone);
  EXPECT_EQ(undone->restored, 0u);
  ASSERT_EQ(undone->remarks.size(), 1u);
  EXPECT_THAT(undone->remarks[0], HasSubstr("changed by others since"));
  EXPECT_EQ(now(changes.threads[0]), other);
}

TEST_F(ArrangementTest, ThreadsThatEndAreNoMistake) {
  Waiting a;
  Changes changes;
  changes.threads = {raise(a)};
  Arrangement arrangement = open();
  ASSERT_TRUE(arrangement.apply(changes, never_stops));
  a.end();
  EXPECT_TRUE(arrangement.apply(changes, never_stops));
  const Result<Arrangement::Undone> undone = arrangement.undo();
  ASSERT_TRUE(undone);
  EXPECT_EQ(undone->restored, 0u);
}

TEST_F(ArrangementTest, ThreadsOfRaisedOnesBeginAsOrdinaryOnes) {
  std::optional<ThreadState> of_child;
  Waiting a([&] {
    std::thread([&] { of_child = system_.state_of(ThreadId{getpid(), gettid(), start_of(gettid())}); }).join();
  });
  Changes changes;
  changes.threads = {raise(a)};
  changes.threads[0].after.cpus = changes.threads[0].before.cpus;  // where its child runs as well
  Arrangement arrangement = open();
  ASSERT_TRUE(arrangement.apply(changes, never_stops));
  a.end();
  ASSERT_TRUE(of_child);
  EXPECT_EQ(to_string(of_child->scheduling), "nice 0");
}

TEST_F(ArrangementTest, OneAtATime) {
  const Arrangement first = open();
  const Result<Arrangement> second = Arrangement::open(system_, path_);
  ASSERT_FALSE(second);
  EXPECT_THAT(to_string(second.error()), HasSubstr("another 'redag arrange' works on this robot"));
}

TEST_F(ArrangementTest, RefusesAFileThatIsNoState) {
  for (const char *text :
       {"", "{}", "[]", R"({"format": "redag.arrangement/2"})", R"({"format": "redag.arrangement/1", "boot": 3})"}) {
    std::ofstream(path_) << text;
    const Result<Arrangement> opened = Arrangement::open(system_, path_);
    ASSERT_FALSE(opened) << text;
    EXPECT_THAT(to_string(opened.error()), HasSubstr("is not the state of an arrangement")) << text;
  }
  std::ofstream(path_)
      << R"({"format": "redag.arrangement/1", "boot": "of yesterday", "threads": [], "interrupts": []})";
  EXPECT_TRUE(open().is_empty()) << "numbers of threads mean others after a boot";
}

TEST_F(ArrangementTest, MovesInterruptsAndBack) {
  std::ofstream(folder_ / "interrupts") << "           CPU0       CPU1\n"
                                           "  0:         44          0  IO-APIC   2-edge      timer\n"
                                           " 24:        100          7  PCI-MSI 524288-edge      eth0-rx, eth1\n"
                                           "NMI:          0          0  Non-maskable interrupts\n";
  for (const char *number : {"0", "24"}) {
    fs::create_directories(folder_ / "irq" / number);
    std::ofstream(folder_ / "irq" / number / "smp_affinity_list") << "0-1\n";
  }
  const System system(folder_.string());
  const Snapshot snapshot = system.read();
  ASSERT_EQ(snapshot.interrupts.size(), 2u);
  EXPECT_EQ(snapshot.interrupts[1].number, 24);
  EXPECT_EQ(snapshot.interrupts[1].name, "PCI-MSI 524288-edge eth0-rx, eth1");
  EXPECT_THAT(snapshot.interrupts[1].cpus, ElementsAre(0, 1));
  Changes changes;
  changes.interrupts = {InterruptChange{24, "eth0-rx", {0, 1}, {1}}};
  Result<Arrangement> arrangement = Arrangement::open(system, path_);
  ASSERT_TRUE(arrangement);
  ASSERT_TRUE(arrangement->apply(changes, never_stops));
  EXPECT_EQ(contents(folder_ / "irq" / "24" / "smp_affinity_list"), "1\n");
  ASSERT_TRUE(arrangement->undo());
  EXPECT_EQ(contents(folder_ / "irq" / "24" / "smp_affinity_list"), "0-1\n");
}

TEST(RobotSystem, ReadsProcessesAsTheyAre) {
  if (getppid() == 0) GTEST_SKIP() << "the parent is in another namespace of processes";
  const System system;
  const Snapshot snapshot = system.read();
  const auto parent = std::find_if(snapshot.processes.begin(), snapshot.processes.end(),
                                   [](const LiveProcess &process) { return process.pid == getppid(); });
  ASSERT_NE(parent, snapshot.processes.end());
  EXPECT_FALSE(parent->name.empty());
  EXPECT_FALSE(parent->command.empty());
  ASSERT_FALSE(parent->threads.empty());
  EXPECT_EQ(parent->threads[0].id.tid, getppid());
  for (const LiveProcess &process : snapshot.processes) EXPECT_NE(process.pid, getpid());
}

}  // namespace
}  // namespace redag::robot
