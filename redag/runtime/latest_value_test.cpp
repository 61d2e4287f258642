// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/latest_value.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace redag::runtime {
namespace {

TEST(LatestValue, ReadsWhatWasWrittenLast) {
  LatestValue<std::string> pose("initial");
  LatestValue<std::string>::Writer writer = pose.writer();
  LatestValue<std::string>::Reader reader = pose.reader();
  EXPECT_FALSE(reader.has_news());
  EXPECT_EQ(reader.read(), "initial");
  for (const char *text : {"a", "b", "c", "d", "e"}) {
    writer.write(text);
    EXPECT_TRUE(reader.has_news());
    EXPECT_EQ(reader.read(), text);
    EXPECT_FALSE(reader.has_news());
    EXPECT_EQ(reader.read(), text);
  }
}

TEST(LatestValue, AValueStaysUntilTheNextRead) {
  LatestValue<int> value(0, 3);
  auto writer = value.writer();
  std::vector<LatestValue<int>::Reader> readers;
  for (int i = 0; i < 3; ++i) readers.push_back(value.reader());
  std::array<const int *, 3> seen{};
  for (int i = 0; i < 3; ++i) {
    writer.write(i);
    seen[static_cast<std::size_t>(i)] = &readers[static_cast<std::size_t>(i)].read();
  }
  for (int i = 100; i < 120; ++i) writer.write(i);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(*seen[static_cast<std::size_t>(i)], i);
}

TEST(LatestValue, BooleansAreValuesToo) {
  LatestValue<bool> stop(false);
  auto writer = stop.writer();
  auto reader = stop.reader();
  writer.write(true);
  EXPECT_TRUE(reader.read());
}

TEST(LatestValue, AllowsOneWriterAndTheReadersOfItsConstructor) {
  LatestValue<int> value(0, 2);
  auto writer = value.writer();
  EXPECT_THROW(static_cast<void>(value.writer()), std::logic_error);
  auto first = value.reader();
  {
    auto second = value.reader();
    EXPECT_THROW(static_cast<void>(value.reader()), std::logic_error);
  }
  auto third = value.reader();  // in place of the second
  writer.write(7);
  EXPECT_EQ(first.read(), 7);
  EXPECT_EQ(third.read(), 7);
  EXPECT_THROW(LatestValue<int>(0, 0), std::invalid_argument);
}

// Under ThreadSanitizer this also covers weaker orders of memory than tests/model_check does.
TEST(LatestValue, ThreadsNeverSeeAMixtureOrAnOlderValue) {
  struct Triple {
    std::array<std::uint64_t, 16> words{};
  };
  constexpr std::uint64_t kLast = 20'000;
  LatestValue<Triple> value(Triple{}, 2);
  auto writer = value.writer();
  std::atomic<bool> wrong{false};
  std::vector<std::thread> threads;
  for (int r = 0; r < 2; ++r) {
    threads.emplace_back([&value, &wrong, reader = value.reader()]() mutable {
      for (std::uint64_t last = 0; last < kLast;) {
        const Triple &seen = reader.read();
        for (const std::uint64_t word : seen.words) wrong = wrong || word != seen.words[0];
        wrong = wrong || seen.words[0] < last;
        last = seen.words[0];
      }
    });
  }
  for (std::uint64_t i = 1; i <= kLast; ++i) {
    Triple triple;
    triple.words.fill(i);
    writer.write(triple);
  }
  for (std::thread &thread : threads) thread.join();
  EXPECT_FALSE(wrong);
}

}  // namespace
}  // namespace redag::runtime
