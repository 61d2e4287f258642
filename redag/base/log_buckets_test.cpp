// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/log_buckets.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace redag {
namespace {

template <unsigned kBits>
void expect_buckets_without_gaps() {
  using Buckets = LogBuckets<kBits>;
  std::uint64_t next = 0;
  for (std::size_t i = 0; i < Buckets::kCount; ++i) {
    ASSERT_EQ(Buckets::lowest_in(i), next) << i;
    const std::uint64_t last = Buckets::highest_in(i);
    ASSERT_EQ(Buckets::bucket_of(next), i);
    ASSERT_EQ(Buckets::bucket_of(last), i);
    ASSERT_LE(last - next, next >> kBits) << "wider than 1 / 2^bits of its values";
    next = last + 1;  // 0 after the last bucket
  }
  EXPECT_EQ(next, 0U);
  EXPECT_EQ(Buckets::bucket_of(std::numeric_limits<std::uint64_t>::max()), Buckets::kCount - 1);
}

TEST(LogBuckets, CoverAllValuesWithoutAGap) {
  expect_buckets_without_gaps<0>();
  expect_buckets_without_gaps<3>();
  expect_buckets_without_gaps<7>();
}

}  // namespace
}  // namespace redag
