// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of the two ends of a ring. The value that they pass notices whether it is read while it
// is written.
#include "protocol.hpp"
#include "redag/trace/ring.hpp"

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

TEST(DataProtocol, ARingLosesAndRepeatsNothing) {
  expect_holds([] {
    trace::RingOf<Watched> ring(2);
    int pushed = 0;
    const std::uint32_t thread = spawn([&] {
      for (int i = 1; i <= 3; ++i) {
        if (!ring.push(Watched(i))) return;  // the ring is full: the reader has taken fewer than two less than i
        pushed = i;
      }
    });
    int taken = 0;
    const auto take = [&] {
      Watched value;
      if (ring.pop({&value, 1}) == 0) return false;
      explored::check(value.get() == ++taken, "values come in another order, or are lost");
      return true;
    };
    for (int tries = 0; tries < 3; ++tries) take();
    explored::join(thread);
    while (take()) {
    }
    explored::check(taken == pushed, "a value is lost");
  });
}

}  // namespace
}  // namespace redag::model_check
