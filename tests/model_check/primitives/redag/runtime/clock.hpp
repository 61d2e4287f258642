// In place of redag/runtime/clock.hpp: the explorer's time. Processor time stands still.
#pragma once

#include "redag/base/time.hpp"
#include "redag/testing/explorer.hpp"

namespace redag::runtime {

[[nodiscard]] inline Time monotonic_now() noexcept { return testing::explored::now(); }
[[nodiscard]] inline Duration thread_cpu_now() noexcept { return 0; }

}  // namespace redag::runtime
