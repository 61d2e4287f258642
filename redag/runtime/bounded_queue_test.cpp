// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/bounded_queue.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

namespace redag::runtime {
namespace {

TEST(BoundedQueue, KeepsTheOrderAndItsBound) {
  BoundedQueue<std::string> queue(3);
  BoundedQueue<std::string>::Writer writer = queue.writer();
  BoundedQueue<std::string>::Reader reader = queue.reader();
  EXPECT_EQ(queue.capacity(), 3U);
  EXPECT_FALSE(reader.pop());
  for (int round = 0; round < 5; ++round) {
    for (const char *text : {"a", "b", "c"}) EXPECT_TRUE(writer.push(text));
    std::string refused = "d";
    EXPECT_FALSE(writer.push(std::move(refused)));
    EXPECT_EQ(refused, "d") << "a full queue leaves the value alone";  // NOLINT(bugprone-use-after-move)
    for (const char *text : {"a", "b", "c"}) EXPECT_EQ(reader.pop(), text);
    EXPECT_FALSE(reader.pop());
  }
}

TEST(BoundedQueue, TakesValuesThatCannotBeCopied) {
  BoundedQueue<std::unique_ptr<int>> queue(1);
  auto writer = queue.writer();
  auto reader = queue.reader();
  ASSERT_TRUE(writer.push(std::make_unique<int>(7)));
  const auto value = reader.pop();
  ASSERT_TRUE(value.has_value());
  EXPECT_EQ(**value, 7);
}

TEST(BoundedQueue, DestroysAValueWhenItIsTaken) {
  const auto value = std::make_shared<int>(7);
  BoundedQueue<std::shared_ptr<int>> queue(2);
  auto writer = queue.writer();
  auto reader = queue.reader();
  ASSERT_TRUE(writer.push(value));
  EXPECT_EQ(value.use_count(), 2);
  reader.pop().reset();
  EXPECT_EQ(value.use_count(), 1);
}

TEST(BoundedQueue, AllowsOneWriterAndOneReader) {
  BoundedQueue<int> queue(1);
  {
    auto writer = queue.writer();
    auto reader = queue.reader();
    EXPECT_THROW(static_cast<void>(queue.writer()), std::logic_error);
    EXPECT_THROW(static_cast<void>(queue.reader()), std::logic_error);
    auto moved = std::move(writer);
    EXPECT_TRUE(moved.push(1));
  }
  auto writer = queue.writer();
  auto reader = queue.reader();
  EXPECT_EQ(reader.pop(), 1);
  EXPECT_TRUE(writer.push(2));
  EXPECT_THROW(BoundedQueue<int>(0), std::invalid_argument);
}

TEST(BoundedQueue, ThreadsLoseNothing) {
  constexpr int kLast = 20'000;
  BoundedQueue<int> queue(7);
  std::thread writing([writer = queue.writer()]() mutable {
    for (int i = 1; i <= kLast; ++i) {
      while (!writer.push(i)) std::this_thread::yield();
    }
  });
  auto reader = queue.reader();
  int expected = 1;
  while (expected <= kLast) {
    if (const auto value = reader.pop()) {
      ASSERT_EQ(*value, expected++);
    } else {
      std::this_thread::yield();
    }
  }
  writing.join();
}

}  // namespace
}  // namespace redag::runtime
