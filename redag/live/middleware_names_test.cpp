// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/middleware_names.hpp"

#include <gtest/gtest.h>

namespace redag::live {
namespace {

TEST(MiddlewareNames, AreKnownAsAWhole) {
  for (const char *name :
       {"recv", "recvMC", "recvUC", "dq.builtins", "dq.user", "tev", "dds.udp.7411", "dds.shm.7410", "dds.dsha.260",
        "dds.ev.12", "dds.ds_ev.0", "dds.asyn.1.1", "dds.tcp_accept", "dds.tcp_keep"}) {
    EXPECT_TRUE(is_middleware_thread_name(name)) << name;
  }
  for (const char *name :
       {"recv_camera", "recvLidar", "receiver", "dq.", "dq.control", "tevent", "tev.mine", "dds.", "dds.logger",
        "dds.udp.", "dds.shm.wdog", "dds.slog.0", "dds.fwatch", "dds.udp.lidar", "redag-timer", ""}) {
    EXPECT_FALSE(is_middleware_thread_name(name)) << name;
  }
}

}  // namespace
}  // namespace redag::live
