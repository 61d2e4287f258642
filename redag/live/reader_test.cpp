// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/reader.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <span>
#include <thread>
#include <vector>

#include "redag/live/pages.hpp"
#include "redag/live/writer.hpp"

namespace redag::live {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class LivePage : public ::testing::Test {
 protected:
  LivePage() {
    std::string name = ::testing::TempDir() + "redag_live_XXXXXX";
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::unique_ptr<PageWriter> make_writer(std::size_t slot_size = kSlotSize) {
    Result<std::unique_ptr<PageWriter>> writer = PageWriter::create(folder_, slot_size);
    EXPECT_TRUE(writer) << to_string(writer.error());
    return *std::move(writer);
  }

  /// Copies the page of `writer` to another name, for tests that damage it.
  std::string copy(const PageWriter &writer) const {
    std::string path = page_path(folder_, 1, 0);
    std::filesystem::copy_file(writer.path(), path, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::permissions(path, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    return path;
  }

  static void overwrite(const std::string &path, std::size_t offset, const std::string &bytes) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(offset));
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }

  template <class Value>
  static void overwrite(const std::string &path, std::size_t offset, Value value) {
    std::string bytes(sizeof(value), '\0');
    std::memcpy(bytes.data(), &value, sizeof(value));
    overwrite(path, offset, bytes);
  }

  static std::string error_of(const std::string &path) {
    const Result<Page> page = read_page(path);
    return page ? "" : to_string(page.error());
  }

  std::string folder_;
};

Frame make_frame(std::size_t dags = 2, std::size_t tasks_each = 3, std::uint64_t count = 7) {
  Frame frame;
  frame.name = "cart";
  frame.program = "redag";
  frame.driver = "threads";
  frame.preemption = "os";
  frame.policy = "rate_monotonic";
  frame.workers = 2;
  frame.began = 100;
  frame.published = 5 * kSecond;
  frame.interval = kSecond / 2;
  frame.window = 2 * kSecond;
  frame.publisher_cpu = 12'345;
  frame.threads_in_all = 5;
  frame.threads = {{.index = 1, .used = 100, .recent_used = 10, .task = 3}, {.index = 4}};
  frame.devices_in_all = 3;
  frame.devices = {{.name = "gpu",
                    .slots = 2,
                    .used = 2,
                    .queued = 3,
                    .served = 40,
                    .recent_served = 4,
                    .busy = 400,
                    .recent_busy = 50,
                    .tasks = {3, 5}},
                   {.name = "dla"}};
  for (std::size_t d = 0; d < dags; ++d) {
    frame.dags.push_back(DagFrame{"dag" + std::to_string(d), static_cast<std::uint32_t>(d), {}});
    frame.dags.back().figures.released = count;
    frame.dags.back().deadline = static_cast<Duration>(d) * kSecond;
    frame.dags.back().late = 9;
    frame.dags.back().recent_late = 2;
    frame.dags.back().spread.all[3] = 4;
    for (std::size_t t = 0; t < tasks_each; ++t) {
      TaskFrame task{"task" + std::to_string(t), static_cast<std::uint32_t>(d), kSecond, kSecond / 2, kSecond / 4, {}};
      task.figures.released = count;
      task.figures.recent_max = static_cast<std::int64_t>(count);
      task.figures.waiting = static_cast<std::uint32_t>(t);
      task.figures.away = static_cast<std::uint32_t>(t + 1);
      task.spread.all[0] = static_cast<std::uint32_t>(count);
      task.priority = 80 - static_cast<int>(t);
      task.spread.all[page::kClasses - 1] = 3;
      frame.tasks.push_back(std::move(task));
    }
  }
  return frame;
}

TEST_F(LivePage, IsReadAsItWasWritten) {
  const auto writer = make_writer();
  EXPECT_EQ(writer->path(), page_path(folder_, ::getpid(), 0));
  Frame written = make_frame();
  written.alert = "deadlock: a waits for b";
  writer->publish(written);
  const Result<Page> page = read_page(writer->path());
  ASSERT_TRUE(page) << to_string(page.error());
  EXPECT_EQ(page->process, this_process());
  EXPECT_EQ(page->frame.alert, written.alert);
  const Frame &read = page->frame;
  EXPECT_EQ(read.sequence, 1U);
  EXPECT_EQ(read.name, "cart");
  EXPECT_EQ(read.program, "redag");
  EXPECT_EQ(read.driver, "threads");
  EXPECT_EQ(read.preemption, "os");
  EXPECT_EQ(read.policy, "rate_monotonic");
  EXPECT_EQ(read.workers, 2U);
  EXPECT_EQ(read.began, written.began);
  EXPECT_EQ(read.published, written.published);
  EXPECT_EQ(read.interval, written.interval);
  EXPECT_EQ(read.window, written.window);
  EXPECT_EQ(read.publisher_cpu, written.publisher_cpu);
  EXPECT_EQ(read.left_out, 0U);
  ASSERT_THAT(read.dags, SizeIs(2));
  EXPECT_EQ(read.dags[1].name, "dag1");
  EXPECT_EQ(read.dags[1].max_active, 1U);
  ASSERT_THAT(read.tasks, SizeIs(6));
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(read.tasks[i].name, written.tasks[i].name);
    EXPECT_EQ(read.tasks[i].dag, written.tasks[i].dag);
    EXPECT_EQ(read.tasks[i].deadline, written.tasks[i].deadline);
    EXPECT_EQ(read.tasks[i].bound, written.tasks[i].bound);
    EXPECT_EQ(read.tasks[i].priority, written.tasks[i].priority);
    EXPECT_EQ(std::memcmp(&read.tasks[i].figures, &written.tasks[i].figures, sizeof(page::Figures)), 0);
    EXPECT_EQ(std::memcmp(&read.tasks[i].spread, &written.tasks[i].spread, sizeof(page::Spread)), 0);
  }
  EXPECT_EQ(read.dags[1].deadline, kSecond);
  EXPECT_EQ(read.dags[1].late, 9U);
  EXPECT_EQ(read.dags[1].recent_late, 2U);
  EXPECT_EQ(read.dags[1].spread.all[3], 4U);
  EXPECT_EQ(read.threads_in_all, 5U);
  ASSERT_THAT(read.threads, SizeIs(2));
  EXPECT_EQ(read.threads[0].used, 100);
  EXPECT_EQ(read.threads[0].recent_used, 10);
  EXPECT_EQ(read.threads[0].task, 3U);
  EXPECT_EQ(read.threads[1].index, 4U);
  EXPECT_EQ(read.threads[1].task, std::nullopt);
  EXPECT_EQ(read.tasks[1].figures.away, 2U);
  EXPECT_EQ(read.devices_in_all, 3U);
  ASSERT_THAT(read.devices, SizeIs(2));
  EXPECT_EQ(read.devices[0].name, "gpu");
  EXPECT_EQ(read.devices[0].slots, 2U);
  EXPECT_EQ(read.devices[0].used, 2U);
  EXPECT_EQ(read.devices[0].queued, 3U);
  EXPECT_EQ(read.devices[0].served, 40U);
  EXPECT_EQ(read.devices[0].recent_served, 4U);
  EXPECT_EQ(read.devices[0].busy, 400);
  EXPECT_EQ(read.devices[0].recent_busy, 50);
  EXPECT_THAT(read.devices[0].tasks, ElementsAre(3U, 5U));
  EXPECT_EQ(read.devices[1].name, "dla");
  EXPECT_THAT(read.devices[1].tasks, IsEmpty());
}

// As programs write it that know neither alerts nor spreads: their rows are shorter.
TEST_F(LivePage, RowsOfEarlierProgramsAreRead) {
  const auto writer = make_writer();
  writer->publish(make_frame());
  const std::string path = copy(*writer);
  const std::size_t slot = 4096 + kSlotSize;  // of frame 1
  std::string bytes(std::filesystem::file_size(path), '\0');
  std::ifstream(path, std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  std::string frame = bytes.substr(slot, page::kLeastFrameHeader);
  std::size_t at = slot + sizeof(page::FrameHeader);
  const auto take = [&](std::size_t size, std::size_t least) {
    frame += bytes.substr(at, least);
    at += size;
  };
  for (int dag = 0; dag < 2; ++dag) take(sizeof(page::DagRow), page::kLeastDagRow);
  for (int task = 0; task < 6; ++task) take(sizeof(page::TaskRow), page::kLeastTaskRow);
  const std::uint64_t sum = page::checksum(std::as_bytes(std::span(frame)).subspan(sizeof(std::uint64_t)));
  std::memcpy(frame.data(), &sum, sizeof(sum));
  overwrite(path, slot, frame);
  overwrite(path, offsetof(page::Header, frame_header_size), static_cast<std::uint32_t>(page::kLeastFrameHeader));
  overwrite(path, offsetof(page::Header, dag_row_size), static_cast<std::uint32_t>(page::kLeastDagRow));
  overwrite(path, offsetof(page::Header, task_row_size), static_cast<std::uint32_t>(page::kLeastTaskRow));
  const Result<Page> page = read_page(path);
  ASSERT_TRUE(page) << to_string(page.error());
  ASSERT_THAT(page->frame.tasks, SizeIs(6));
  EXPECT_EQ(page->frame.tasks[5].name, "task2");
  EXPECT_EQ(page->frame.tasks[5].figures.released, 7U);
  EXPECT_EQ(page->frame.tasks[5].spread.all[0], 0U);
  EXPECT_EQ(page->frame.tasks[5].priority, 0);
  EXPECT_EQ(page->frame.dags[1].deadline, 0);
  EXPECT_THAT(page->frame.threads, IsEmpty());
  EXPECT_THAT(page->frame.devices, IsEmpty());
}

// As programs write it that know no alert: the rows follow earlier. Here there are none.
TEST_F(LivePage, AnEarlierFrameHasNoAlert) {
  const auto writer = make_writer();
  Frame frame = make_frame(0, 0);
  frame.alert = "deadlock";
  writer->publish(frame);
  const std::string path = copy(*writer);
  const std::size_t slot = 4096 + kSlotSize;  // of frame 1
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  const std::uint32_t size = page::kLeastFrameHeader;
  file.seekp(offsetof(page::Header, frame_header_size));
  file.write(reinterpret_cast<const char *>(&size), sizeof(size));
  std::vector<char> head(size);
  file.seekg(static_cast<std::streamoff>(slot));
  file.read(head.data(), size);
  const std::uint64_t sum = page::checksum(std::as_bytes(std::span(head)).subspan(sizeof(std::uint64_t)));
  file.seekp(static_cast<std::streamoff>(slot));
  file.write(reinterpret_cast<const char *>(&sum), sizeof(sum));
  file.close();
  const Result<Page> page = read_page(path);
  ASSERT_TRUE(page) << to_string(page.error());
  EXPECT_EQ(page->frame.name, "cart");
  EXPECT_EQ(page->frame.alert, "");
}

TEST_F(LivePage, GrowsAndShrinksFromFrameToFrame) {
  const auto writer = make_writer();
  for (const std::size_t dags : {1U, 40U, 3U, 0U, 200U}) {
    writer->publish(make_frame(dags, 10));
    const Result<Page> page = read_page(writer->path());
    ASSERT_TRUE(page) << to_string(page.error());
    EXPECT_THAT(page->frame.tasks, SizeIs(dags * 10));
  }
}

TEST_F(LivePage, SaysWhatFoundNoRoom) {
  const auto writer = make_writer(16384);
  writer->publish(make_frame(4, 100));
  const Result<Page> page = read_page(writer->path());
  ASSERT_TRUE(page) << to_string(page.error());
  EXPECT_LT(page->frame.tasks.size(), 400U);
  EXPECT_GT(page->frame.tasks.size(), 0U);
  EXPECT_EQ(page->frame.left_out + page->frame.tasks.size(), 400U);
}

TEST_F(LivePage, ThreadsAndDevicesDoNotNameATaskThatFoundNoRoom) {
  const auto writer = make_writer(16384);
  Frame frame = make_frame(1, 100);
  frame.threads = {{.index = 0, .task = 0}, {.index = 1, .task = 99}};
  frame.devices = {{.name = "gpu", .slots = 2, .used = 2, .tasks = {99, 0}}};
  writer->publish(frame);
  const Result<Page> page = read_page(writer->path());
  ASSERT_TRUE(page) << to_string(page.error());
  ASSERT_THAT(page->frame.threads, SizeIs(2));
  EXPECT_EQ(page->frame.threads[0].task, 0U);
  EXPECT_EQ(page->frame.threads[1].task, std::nullopt);
  EXPECT_EQ(page->frame.devices[0].used, 2U);
  EXPECT_THAT(page->frame.devices[0].tasks, ElementsAre(0U));
}

TEST_F(LivePage, LongNamesAreCutBetweenCharacters) {
  const auto writer = make_writer();
  Frame frame = make_frame(1, 1);
  frame.tasks[0].name = std::string(95, 'x') + "\u00e4";  // the second byte of its last character is beyond the field
  writer->publish(frame);
  const Result<Page> page = read_page(writer->path());
  ASSERT_TRUE(page) << to_string(page.error());
  EXPECT_EQ(page->frame.tasks[0].name, std::string(95, 'x'));
}

TEST_F(LivePage, NamesCannotCommandTheTerminal) {
  const auto writer = make_writer();
  Frame frame = make_frame(1, 3);
  frame.tasks[0].name = "a\033[2Jb\x7f\r\n";
  frame.tasks[1].name = "\u00e4\u20ac\U0001f916 \u0085\u202e\xff\xc0\x80\xed\xa0\x80";
  frame.name = "\xe2\x82";  // incomplete
  writer->publish(frame);
  const Result<Page> page = read_page(writer->path());
  ASSERT_TRUE(page) << to_string(page.error());
  EXPECT_EQ(page->frame.tasks[0].name, "a\\u{1B}[2Jb\\u{7F}\\u{D}\\u{A}");
  EXPECT_EQ(page->frame.tasks[1].name, "\u00e4\u20ac\U0001f916 \\u{85}\\u{202E}\\xFF\\xC0\\x80\\xED\\xA0\\x80");
  EXPECT_EQ(page->frame.name, "\\xE2\\x82");
}

TEST_F(LivePage, OtherFilesBesideThemAreNone) {
  const auto writer = make_writer();
  writer->publish(make_frame());
  for (const char *name : {"redag", "redag.", "redag.1", "redag.1.", "redag..0", "redag.0.0", "redag.-1.0", "redag.x.0",
                           "redag.1.x", "redag.1.0x", "redag.1-0", "redag.99999999999999999999.0", "other.1.0"}) {
    std::ofstream(folder_ + "/" + name) << "something";
  }
  EXPECT_THAT(list_pages(folder_), SizeIs(1));
  remove_stale_pages(folder_);
  EXPECT_TRUE(std::filesystem::exists(folder_ + "/redag.1.0x"));
}

TEST_F(LivePage, OnlyTheOwnerCanOpenIt) {
  const mode_t old = ::umask(0);
  const auto writer = make_writer();
  ::umask(old);
  struct stat info {};
  ASSERT_EQ(::stat(writer->path().c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 07777U, 0600U);
  EXPECT_EQ(info.st_uid, ::geteuid());
}

TEST_F(LivePage, OthersPagesAreRefused) {
  const auto writer = make_writer();
  writer->publish(make_frame());
  const std::string path = copy(*writer);
  EXPECT_EQ(error_of(path), "");
  for (const mode_t mode : {0640U, 0604U, 0620U, 0602U, 0666U}) {
    ASSERT_EQ(::chmod(path.c_str(), mode), 0);
    EXPECT_THAT(error_of(path), HasSubstr("other users than its owner"));
  }
  ASSERT_EQ(::chmod(path.c_str(), 0600), 0);
  if (::geteuid() == 0) {
    ASSERT_EQ(::chown(path.c_str(), 12345, 12345), 0);
    EXPECT_THAT(error_of(path), HasSubstr("belongs to user 12345"));
  }
}

TEST_F(LivePage, WhatIsNoFileIsRefused) {
  const std::string path = page_path(folder_, 1, 0);
  EXPECT_THAT(error_of(path), HasSubstr("No such file"));
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  EXPECT_THAT(error_of(path), HasSubstr("not a file"));  // and does not wait for a writer to the pipe
  ::unlink(path.c_str());
  const auto writer = make_writer();
  writer->publish(make_frame());
  ASSERT_EQ(::symlink(writer->path().c_str(), path.c_str()), 0);
  EXPECT_NE(error_of(path), "");
  ::unlink(path.c_str());
  ASSERT_EQ(::mkdir(path.c_str(), 0700), 0);
  EXPECT_THAT(error_of(path), HasSubstr("not a file"));
}

TEST_F(LivePage, DamageIsSaid) {
  const auto writer = make_writer();
  writer->publish(make_frame());
  const auto spoilt = [&](std::size_t offset, auto value) {
    const std::string path = copy(*writer);
    overwrite(path, offset, value);
    return error_of(path);
  };
  const std::size_t slot = 4096 + kSlotSize;  // of frame 1
  EXPECT_THAT(spoilt(0, 'x'), HasSubstr("first bytes"));
  EXPECT_THAT(spoilt(offsetof(page::Header, version), std::uint32_t{2}), HasSubstr("version 2"));
  EXPECT_THAT(spoilt(offsetof(page::Header, page_size), ~std::uint64_t{0}), HasSubstr("sizes"));
  EXPECT_THAT(spoilt(offsetof(page::Header, slot_size), ~std::uint64_t{7}), HasSubstr("sizes"));
  EXPECT_THAT(spoilt(offsetof(page::Header, slot_offset), ~std::uint64_t{0}), HasSubstr("sizes"));
  EXPECT_THAT(spoilt(offsetof(page::Header, task_row_size), std::uint32_t{8}), HasSubstr("sizes"));
  EXPECT_THAT(spoilt(offsetof(page::Header, dag_row_size), std::uint32_t{265}), HasSubstr("sizes"));
  EXPECT_THAT(spoilt(offsetof(page::Header, sequence), std::uint64_t{0}), HasSubstr("no complete frame"));
  EXPECT_THAT(spoilt(offsetof(page::Header, sequence), std::uint64_t{3}), HasSubstr("no complete frame"));
  EXPECT_THAT(spoilt(slot + offsetof(page::FrameHeader, tasks), ~std::uint32_t{0}), HasSubstr("no complete frame"));
  EXPECT_THAT(spoilt(slot + sizeof(page::FrameHeader), 'x'), HasSubstr("no complete frame"));
  const std::string path = copy(*writer);
  std::filesystem::resize_file(path, slot + 100);
  EXPECT_THAT(error_of(path), HasSubstr("sizes"));
  std::filesystem::resize_file(path, 20);
  EXPECT_THAT(error_of(path), HasSubstr("too short"));
}

// The writer of this page knows the format: the checksum is right, and the rest is not.
TEST_F(LivePage, LiesAreFound) {
  const auto writer = make_writer();
  Frame frame = make_frame();
  frame.tasks[1].figures.response_p99 = -1;
  writer->publish(frame);
  EXPECT_THAT(error_of(writer->path()), HasSubstr("out of range"));
  frame = make_frame();
  frame.tasks[1].dag = 2;
  writer->publish(frame);
  EXPECT_THAT(error_of(writer->path()), HasSubstr("out of range"));
  frame = make_frame();
  frame.published = kNever;
  writer->publish(frame);
  EXPECT_THAT(error_of(writer->path()), HasSubstr("out of range"));
  frame = make_frame();
  frame.devices[0].used = 3;
  writer->publish(frame);
  EXPECT_THAT(error_of(writer->path()), HasSubstr("out of range"));
  frame = make_frame();
  frame.devices[1].recent_busy = -1;
  writer->publish(frame);
  EXPECT_THAT(error_of(writer->path()), HasSubstr("out of range"));
  // These the writer does not write: as many devices as a row has no room for, and a task that is not there.
  const auto lie = [&](std::size_t offset, std::uint32_t value) {
    writer->publish(make_frame());
    const std::string path = copy(*writer);
    const Result<Page> sound = read_page(path);
    EXPECT_TRUE(sound) << to_string(sound.error());
    const std::size_t slot = 4096 + sound->frame.sequence % 2 * kSlotSize;
    overwrite(path, slot + offset, value);
    std::string bytes(sizeof(page::FrameHeader) + 2 * sizeof(page::DagRow) + 6 * sizeof(page::TaskRow), '\0');
    std::ifstream file(path, std::ios::binary);
    file.seekg(static_cast<std::streamoff>(slot));
    file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    overwrite(path, slot, page::checksum(std::as_bytes(std::span(bytes)).subspan(sizeof(std::uint64_t))));
    return error_of(path);
  };
  EXPECT_THAT(lie(offsetof(page::FrameHeader, devices), page::kDevices + 1), HasSubstr("out of range"));
  EXPECT_THAT(lie(offsetof(page::FrameHeader, device) + offsetof(page::DeviceRow, task), 6), HasSubstr("out of range"));
  EXPECT_EQ(lie(offsetof(page::FrameHeader, device) + offsetof(page::DeviceRow, task), 5), "");
}

// Random bytes, in a page whose checksum is then corrected, and pages of noise only. Reading always ends, and each
// frame that it returns keeps its promises.
TEST_F(LivePage, NoiseDoesNotCrashTheReader) {
  const auto writer = make_writer(16384);
  writer->publish(make_frame());
  const std::string path = copy(*writer);
  std::string original(std::filesystem::file_size(path), '\0');
  std::ifstream(path, std::ios::binary).read(original.data(), static_cast<std::streamsize>(original.size()));
  std::mt19937_64 random(20'251);
  const std::size_t slot = 4096 + 16384;
  int read = 0;
  for (int round = 0; round < 400; ++round) {
    std::string bytes = original;
    const bool all = round % 20 == 0;
    const std::size_t edits = all ? bytes.size() : 1 + random() % 6;
    for (std::size_t i = 0; i < edits; ++i) {
      // Most changes hit the structure; the header decides what the rest means.
      const std::size_t at = all ? i : random() % 3 == 0 ? random() % 88 : slot + random() % 8200;
      bytes[at] = random() % 4 == 0 ? '\xff' : static_cast<char>(random());
    }
    if (all) std::memcpy(bytes.data(), original.data(), round % 40 == 0 ? 88 : 0);
    if (round % 2 == 1) {  // the checksum of a frame of the stated size
      page::FrameHeader head{};
      std::memcpy(&head, bytes.data() + slot, sizeof(head));
      const std::uint64_t size = sizeof(head) + head.dags * sizeof(page::DagRow) + head.tasks * sizeof(page::TaskRow);
      if (size <= 16384) {
        const auto *begin = reinterpret_cast<const std::byte *>(bytes.data() + slot);
        const std::uint64_t sum = page::checksum({begin + 8, begin + size});
        std::memcpy(bytes.data() + slot, &sum, sizeof(sum));
      }
    }
    if (round % 7 == 0) bytes.resize(random() % bytes.size());
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
    const Result<Page> page = read_page(path);
    if (!page) continue;
    ++read;
    for (const TaskFrame &task : page->frame.tasks) {
      EXPECT_LT(task.dag, page->frame.dags.size());
      EXPECT_GE(task.figures.recent_p99, 0);
      for (const char c : task.name) EXPECT_GE(static_cast<unsigned char>(c), 0x20);
    }
    for (const DeviceFrame &device : page->frame.devices) {
      EXPECT_LE(device.used, device.slots);
      for (const std::uint32_t task : device.tasks) EXPECT_LT(task, page->frame.tasks.size());
    }
  }
  EXPECT_GT(read, 20);  // otherwise only the first checks were tried
}

// Every row of a frame holds the frame's number, which would show a mix of two frames.
TEST_F(LivePage, IsWholeWhileItIsWritten) {
  const auto writer = make_writer();
  writer->publish(make_frame(5, 40, 1));
  std::atomic<bool> stop{false};
  std::thread other([&] {
    for (std::uint64_t count = 2; !stop; ++count) writer->publish(make_frame(5, 40, count));
  });
  int whole = 0;
  std::uint64_t last = 0;
  for (int i = 0; i < 300; ++i) {
    const Result<Page> page = read_page(writer->path());
    if (!page) continue;  // the writer was faster ten times: it does nothing else
    ++whole;
    EXPECT_GE(page->frame.sequence, last);
    last = page->frame.sequence;
    ASSERT_THAT(page->frame.tasks, SizeIs(200));
    for (const TaskFrame &task : page->frame.tasks) {
      ASSERT_EQ(task.figures.released, page->frame.sequence);
      ASSERT_EQ(task.figures.recent_max, static_cast<std::int64_t>(page->frame.sequence));
    }
  }
  stop = true;
  other.join();
  EXPECT_GT(whole, 100);
  EXPECT_GT(last, 1U);
}

TEST_F(LivePage, SeveralInOneProcess) {
  const auto first = make_writer();
  const auto second = make_writer();
  first->publish(make_frame());
  second->publish(make_frame());
  std::vector<Listed> pages = list_pages(folder_);
  ASSERT_THAT(pages, SizeIs(2));
  EXPECT_EQ(pages[0].pid, ::getpid());
  EXPECT_EQ(pages[0].number, 0U);
  EXPECT_EQ(pages[1].number, 1U);
  EXPECT_TRUE(pages[0].page);
}

TEST_F(LivePage, GoesWithItsWriter) {
  make_writer()->publish(make_frame());
  EXPECT_THAT(list_pages(folder_), IsEmpty());
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(LivePage, OfADeadProcessIsRemoved) {
  const auto writer = make_writer();
  writer->publish(make_frame());
  const std::string path = copy(*writer);
  ASSERT_TRUE(read_page(path));
  // Another process now has the pid: it began at another time.
  overwrite(path, offsetof(page::Header, process_start), this_process().start + 1);
  EXPECT_THAT(list_pages(folder_), SizeIs(1));
  EXPECT_FALSE(std::filesystem::exists(path));

  // There is no such process.
  const std::string gone = copy(*writer);
  overwrite(gone, offsetof(page::Header, pid), std::int64_t{0x7fffffff});
  EXPECT_EQ(remove_stale_pages(folder_), 1U);
  EXPECT_FALSE(std::filesystem::exists(gone));

  // In another namespace the pid says nothing.
  const std::string elsewhere = copy(*writer);
  overwrite(elsewhere, offsetof(page::Header, process_start), std::uint64_t{1});
  overwrite(elsewhere, offsetof(page::Header, pid_namespace), std::uint64_t{1});
  EXPECT_EQ(remove_stale_pages(folder_), 0U);
  EXPECT_THAT(list_pages(folder_), SizeIs(2));

  // A file that is no page must not be removed.
  overwrite(elsewhere, 0, 'x');
  EXPECT_THAT(list_pages(folder_), SizeIs(2));
  EXPECT_TRUE(std::filesystem::exists(elsewhere));
}

TEST_F(LivePage, ThatAKilledProcessLeftIsReplaced) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto writer = PageWriter::create(folder_);
    if (!writer) ::_exit(1);
    (*writer)->publish(make_frame());
    ::kill(::getpid(), SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  ASSERT_TRUE(std::filesystem::exists(page_path(folder_, child, 0)));
  const auto writer = make_writer();
  EXPECT_FALSE(std::filesystem::exists(page_path(folder_, child, 0)));
}

TEST_F(LivePage, CannotBeMadeEverywhere) {
  const auto writer = PageWriter::create(folder_ + "/missing");
  ASSERT_FALSE(writer);
  EXPECT_THAT(to_string(writer.error()), HasSubstr("no live page"));
  EXPECT_THAT(list_pages(folder_ + "/missing"), IsEmpty());
}

TEST(Process, StartIsFieldTwentyTwo) {
  EXPECT_EQ(start_time_in("23359 (cat) R 1 1 1 0 -1 4194304 97 0 0 0 0 0 0 0 20 0 1 0 1307096 3133440 366"), 1307096U);
  EXPECT_EQ(start_time_in("1 (a) b) 1 2 3) S 1 1 1 0 -1 4 97 0 0 0 0 0 0 0 20 0 1 0 77 3"), 77U);
  EXPECT_EQ(start_time_in("1 (a) S 1 1"), std::nullopt);
  EXPECT_EQ(start_time_in(""), std::nullopt);
  EXPECT_EQ(start_time_in("1 (a) S 1 1 1 0 -1 4 97 0 0 0 0 0 0 0 20 0 1 0 x 3"), std::nullopt);
}

TEST(Process, LivesAsLongAsItRuns) {
  Process self = this_process();
  EXPECT_GT(self.start, 0U);
  EXPECT_EQ(life_of(self), Life::Alive);
  ++self.start;
  EXPECT_EQ(life_of(self), Life::Dead);
  ++self.pid_namespace;
  EXPECT_EQ(life_of(self), Life::Unknown);
}

}  // namespace
}  // namespace redag::live
