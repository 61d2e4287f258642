// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "fake_middleware.hpp"

#include <pthread.h>

#include <memory>
#include <system_error>
#include <utility>

namespace fake_middleware {
namespace {

void *run(void *main) {
  (*static_cast<std::function<void()> *>(main))();
  return nullptr;
}

}  // namespace

std::function<void()> start(By by, std::function<void()> main) {
  const auto kept = std::make_shared<std::function<void()>>(std::move(main));
  if (by == By::StdThread) {
    const auto thread = std::make_shared<std::thread>([kept] { (*kept)(); });
    return [thread] { thread->join(); };
  }
  pthread_t thread{};
  if (const int error = pthread_create(&thread, nullptr, &run, kept.get()); error != 0) {
    throw std::system_error(error, std::generic_category(), "pthread_create");
  }
  return [thread, kept] { pthread_join(thread, nullptr); };
}

}  // namespace fake_middleware
