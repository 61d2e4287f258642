// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/middleware_names.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

namespace redag::live {
namespace {

// A name that ends with a dot is followed by more. Cyclone DDS: q_gc.c, q_debmon.c, dds_init.c. Fast DDS: Log.cpp,
// LogTopic.cpp, SharedMemLog.hpp, SharedMemWatchdog.hpp, TypeLookupRequestListener.cpp, FileWatch.hpp.
constexpr std::array<std::string_view, 10> kBackground{"gc",         "debmon",       "threadmon",    "dds.log",
                                                       "dds.slog.",  "dds.shmd.",    "dds.shm.wdog", "dds.tls.",
                                                       "dds.fwatch", "dds.fwatch.cb"};

// Names in Cyclone DDS: q_init.c, q_radmin.c, q_xevent.c. dq.* deliver what recv* received; tev sends acknowledgements.
constexpr std::array<std::string_view, 6> kCyclone{"recv", "recvMC", "recvUC", "dq.builtins", "dq.user", "tev"};
// Names in Fast DDS: UDPChannelResource.cpp, TCPTransportInterface.cpp, SharedMemChannelResource.hpp,
// DataSharingListener.cpp, RTPSParticipantImpl.cpp, PDPServer.cpp, FlowControllerImpl.hpp. Numbers follow, separated by
// dots.
constexpr std::array<std::string_view, 7> kFastNumbered{"dds.udp.", "dds.tcp.",   "dds.shm.", "dds.dsha.",
                                                        "dds.ev.",  "dds.ds_ev.", "dds.asyn."};
constexpr std::array<std::string_view, 2> kFastWhole{"dds.tcp_accept", "dds.tcp_keep"};

bool is_fast(std::string_view name) {
  if (std::find(kFastWhole.begin(), kFastWhole.end(), name) != kFastWhole.end()) return true;
  return std::any_of(kFastNumbered.begin(), kFastNumbered.end(), [&](std::string_view prefix) {
    const bool begins = name.size() > prefix.size() && name.substr(0, prefix.size()) == prefix;
    return begins && name.find_first_not_of("0123456789.", prefix.size()) == std::string_view::npos;
  });
}

}  // namespace

bool is_cyclone_thread_name(std::string_view name) {
  return std::find(kCyclone.begin(), kCyclone.end(), name) != kCyclone.end();
}

bool is_middleware_thread_name(std::string_view name) { return is_cyclone_thread_name(name) || is_fast(name); }

bool works_in_background(std::string_view name) {
  return std::any_of(kBackground.begin(), kBackground.end(), [&](std::string_view known) {
    return known.back() == '.' ? name.substr(0, known.size()) == known : name == known;
  });
}

}  // namespace redag::live
