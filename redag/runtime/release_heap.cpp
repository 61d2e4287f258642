// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/release_heap.hpp"

#include <algorithm>
#include <tuple>

#include "redag/model/demand.hpp"

namespace redag::runtime {

bool ReleaseHeap::later(const Entry &a, const Entry &b) {
  return std::tie(a.seen, a.id.value, a.number) > std::tie(b.seen, b.id.value, b.number);
}

Duration ReleaseHeap::jitter(const Entry &entry) {
  if (entry.jitter == 0) return 0;
  task_.jitter = entry.jitter;
  return release_jitter(task_, entry.id, entry.number, seed_);
}

void ReleaseHeap::add(const Task &task, TaskId id, Time base) {
  if (task.activation != Activation::Timer) return;
  Entry entry{0, base + task.offset, id, 0, task.period, task.jitter};
  entry.seen = entry.nominal + jitter(entry);
  heap_.push_back(entry);
  std::push_heap(heap_.begin(), heap_.end(), later);
}

void ReleaseHeap::remove(std::span<const TaskId> tasks) {
  const auto removed = [&](const Entry &entry) {
    return std::find(tasks.begin(), tasks.end(), entry.id) != tasks.end();
  };
  heap_.erase(std::remove_if(heap_.begin(), heap_.end(), removed), heap_.end());
  std::make_heap(heap_.begin(), heap_.end(), later);
}

void ReleaseHeap::pop_due(Time now, std::vector<Release> &out) {
  while (out.size() < out.capacity() && next() <= now) {
    std::pop_heap(heap_.begin(), heap_.end(), later);
    Entry &entry = heap_.back();
    out.push_back(Release{entry.id, entry.nominal});
    entry.nominal += entry.period;
    ++entry.number;
    // A job never overtakes the one before it, however large the jitter.
    entry.seen = std::max(entry.seen, entry.nominal + jitter(entry));
    std::push_heap(heap_.begin(), heap_.end(), later);
  }
}

}  // namespace redag::runtime
