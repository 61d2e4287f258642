// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of a writer with readers that share data: LatestValue and BoundedQueue. The value that
// they pass notices whether it is read while it is written.
#include "protocol.hpp"
#include "redag/runtime/bounded_queue.hpp"
#include "redag/runtime/latest_value.hpp"

namespace redag::model_check {
namespace {

using explored::spawn;

/// A number whose every access has a beginning and an end, between which other threads may run. No two accesses of one
/// object may overlap if one of them writes.
class Watched {
 public:
  Watched(int number = 0) : number_(number) {}  // NOLINT(google-explicit-constructor): a test's shorthand
  Watched(const Watched &from) : number_(from.get()) {}
  ~Watched() {
    explored::write(object_, "destroy");
    explored::check(readers_ == 0 && !written_, "a value is destroyed while another thread uses it");
  }
  Watched &operator=(const Watched &from) {
    const int number = from.get();
    explored::write(object_, "begin to write");
    explored::check(readers_ == 0 && !written_, "a value is written while another thread uses it");
    written_ = true;
    explored::write(object_, "end to write");
    number_ = number;
    written_ = false;
    return *this;
  }
  [[nodiscard]] int get() const {
    explored::read(object_, "begin to read");
    explored::check(!written_, "a value is read while it is written");
    ++readers_;
    explored::read(object_, "end to read");
    --readers_;
    return number_;
  }

 private:
  int number_;
  mutable int readers_ = 0;
  bool written_ = false;
  testing::ObjectId object_ = explored::new_object();
};

// Reads `times` times. What it sees is never older than what it saw before, or than what was there when it began.
void read_several(runtime::LatestValue<Watched>::Reader &reader, int times) {
  for (int last = 0; times > 0; --times) {
    const int seen = reader.read().get();
    explored::check(seen >= last, "a reader sees an older value than before");
    last = seen;
  }
}

TEST(DataProtocol, AReaderSeesWholeValuesInOrder) {
  expect_holds([] {
    runtime::LatestValue<Watched> value;
    auto writer = value.writer();
    auto reader = value.reader();
    const std::uint32_t thread = spawn([&] { read_several(reader, 2); });
    for (int i = 1; i <= 3; ++i) writer.write(i);
    explored::join(thread);
    explored::check(reader.read().get() == 3, "the last value is not the latest");
  });
}

TEST(DataProtocol, TwoReadersSeeWholeValuesInOrder) {
  expect_holds([] {
    runtime::LatestValue<Watched> value(0, 2);
    auto writer = value.writer();
    auto first = value.reader();
    auto second = value.reader();
    const std::uint32_t a = spawn([&] { read_several(first, 2); });
    const std::uint32_t b = spawn([&] { read_several(second, 1); });
    for (int i = 1; i <= 3; ++i) writer.write(i);
    explored::join(a);
    explored::join(b);
    explored::check(first.read().get() == 3 && second.read().get() == 3, "the last value is not the latest");
  });
}

TEST(DataProtocol, AReadThatBeginsAfterAWriteSeesIt) {
  expect_holds([] {
    runtime::LatestValue<Watched> value;
    auto writer = value.writer();
    auto reader = value.reader();
    int written = 0;
    const testing::ObjectId object = explored::new_object();
    const std::uint32_t thread = spawn([&] {
      explored::read(object, "what is written");
      const int least = written;
      explored::check(reader.read().get() >= least, "a read misses a write that was over before it began");
    });
    for (int i = 1; i <= 2; ++i) {
      writer.write(i);
      explored::write(object, "written");
      written = i;
    }
    explored::join(thread);
  });
}

TEST(DataProtocol, AQueueLosesAndRepeatsNothing) {
  expect_holds([] {
    runtime::BoundedQueue<Watched> queue(2);
    auto writer = queue.writer();
    auto reader = queue.reader();
    int pushed = 0;
    const std::uint32_t thread = spawn([&] {
      for (int i = 1; i <= 3; ++i) {
        if (!writer.push(Watched(i))) return;  // the queue is full: the reader has taken fewer than two less than i
        pushed = i;
      }
    });
    int taken = 0;
    for (int tries = 0; tries < 3; ++tries) {
      if (const auto value = reader.pop()) {
        explored::check(value->get() == taken + 1, "values come in another order, or are lost");
        ++taken;
      }
    }
    explored::join(thread);
    while (const auto value = reader.pop()) {
      explored::check(value->get() == taken + 1, "values come in another order, or are lost");
      ++taken;
    }
    explored::check(taken == pushed, "a value is lost");
  });
}

}  // namespace
}  // namespace redag::model_check
