// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The names by which threads of Cyclone DDS and of Fast DDS can be recognised. Pure functions.
#pragma once

#include <string_view>

namespace redag::live {

/// True if threads that receive or deliver data have this name. Cyclone DDS: recv, recvMC, recvUC, dq.builtins,
/// dq.user, tev. Fast DDS since 2.11: dds.udp.7400, dds.tcp.1, dds.tcp_accept, dds.tcp_keep, dds.shm.7400, dds.dsha.1,
/// dds.ev.1, dds.ds_ev.1, dds.asyn.1.1.
[[nodiscard]] bool is_middleware_thread_name(std::string_view name);
/// The same for names of Cyclone DDS alone, which users' threads can have as well.
[[nodiscard]] bool is_cyclone_thread_name(std::string_view name);

/// True for threads of these libraries that neither receive nor deliver: they free memory, write logs, or look after
/// files.
[[nodiscard]] bool works_in_background(std::string_view name);

}  // namespace redag::live
