// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/perfetto_reader.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cstddef>
#include <protozero/pbf_reader.hpp>
#include <set>

#include "redag/loader/text_file.hpp"

namespace redag::testing {
namespace {

using protozero::pbf_reader;

std::string inflated(const protozero::data_view &data) {
  std::string text(std::size_t{1} << 20U, '\0');
  for (;;) {
    uLongf size = text.size();
    const int status = ::uncompress(reinterpret_cast<Bytef *>(text.data()), &size,
                                    reinterpret_cast<const Bytef *>(data.data()), data.size());
    if (status == Z_BUF_ERROR) {
      text.resize(2 * text.size());
      continue;
    }
    EXPECT_EQ(status, Z_OK);
    text.resize(size);
    return text;
  }
}

class PictureReader {
 public:
  Picture take() {
    for (const auto &[track, open] : open_) EXPECT_TRUE(open.empty()) << "an open slice on " << path_of(track);
    return std::move(picture_);
  }

  // A Trace: packets one after the other.
  void read(const protozero::data_view &data) {
    pbf_reader trace(data);
    while (trace.next()) {
      EXPECT_EQ(trace.tag(), 1U);
      packet(trace.get_message());
    }
  }

 private:
  struct Track {
    std::string name;
    std::uint64_t parent = 0;
  };

  void packet(pbf_reader packet) {
    std::uint64_t stamp = 0;
    std::uint32_t sequence = 0;
    pbf_reader event;
    bool has_event = false;
    while (packet.next()) {
      switch (packet.tag()) {
        case 8: stamp = packet.get_uint64(); break;
        case 10: sequence = packet.get_uint32(); break;
        case 11:
          event = packet.get_message();
          has_event = true;
          break;
        case 13:
          EXPECT_EQ(packet.get_uint32(), 1U);
          EXPECT_EQ(picture_.packets, 0U) << "that begins the sequence";
          break;
        case 50: {
          const std::string packets = inflated(packet.get_view());
          picture_.bytes += packets.size();
          read({packets.data(), packets.size()});
          return;
        }
        case 60: track(packet.get_message()); break;
        default: ADD_FAILURE() << "packet with field " << packet.tag(); packet.skip();
      }
    }
    ++picture_.packets;
    EXPECT_EQ(sequence, 1U);
    if (has_event) track_event(event, static_cast<Time>(stamp));
  }

  void track(pbf_reader descriptor) {
    std::uint64_t id = 0;
    Track its;
    bool is_counter = false;
    while (descriptor.next()) {
      switch (descriptor.tag()) {
        case 1: id = descriptor.get_uint64(); break;
        case 2: its.name = descriptor.get_string(); break;
        case 5: its.parent = descriptor.get_uint64(); break;
        case 8: is_counter = true; [[fallthrough]];
        default: descriptor.skip();
      }
    }
    if (its.parent != 0) {
      EXPECT_TRUE(tracks_.contains(its.parent));
    }
    EXPECT_TRUE(tracks_.emplace(id, its).second);
    if (is_counter) counter_tracks_.insert(id);
  }

  [[nodiscard]] std::string path_of(std::uint64_t track) const {
    const Track &its = tracks_.at(track);
    return its.parent == 0 ? its.name : path_of(its.parent) + "/" + its.name;
  }

  static void annotation(pbf_reader its, std::map<std::string, std::string> &arguments) {
    std::string name;
    while (its.next()) {
      switch (its.tag()) {
        case 4: arguments[name] = std::to_string(its.get_int64()); break;
        case 6: arguments[name] = its.get_string(); break;
        case 10: name = its.get_string(); break;
        default: ADD_FAILURE() << "argument with field " << its.tag(); its.skip();
      }
    }
  }

  void track_event(pbf_reader event, Time time) {
    PictureEvent one;
    one.begin = time;
    std::int32_t type = 0;
    std::int64_t value = 0;
    while (event.next()) {
      switch (event.tag()) {
        case 4: annotation(event.get_message(), one.arguments); break;
        case 9: type = event.get_int32(); break;
        case 11: one.track_id = event.get_uint64(); break;
        case 22: one.category = event.get_string(); break;
        case 23: one.name = event.get_string(); break;
        case 30: value = event.get_int64(); break;
        case 47: one.flows_out.push_back(event.get_fixed64()); break;
        case 48: one.flows_in.push_back(event.get_fixed64()); break;
        default: ADD_FAILURE() << "event with field " << event.tag(); event.skip();
      }
    }
    one.track = path_of(one.track_id);
    EXPECT_EQ(counter_tracks_.contains(one.track_id), type == 4);
    std::vector<PictureEvent> &open = open_[one.track_id];
    if (type == 1) {
      open.push_back(std::move(one));
    } else if (type == 2) {
      ASSERT_FALSE(open.empty()) << "an end without a begin on " << one.track;
      PictureEvent whole = std::move(open.back());
      open.pop_back();
      whole.end = time;
      EXPECT_GE(whole.end, whole.begin);
      whole.arguments.merge(one.arguments);
      whole.flows_out = one.flows_out;
      picture_.slices.push_back(std::move(whole));
    } else if (type == 3) {
      picture_.instants.push_back(std::move(one));
    } else {
      EXPECT_EQ(type, 4);
      picture_.counters[one.track].push_back({time, value});
    }
  }

  Picture picture_;
  std::map<std::uint64_t, Track> tracks_;
  std::set<std::uint64_t> counter_tracks_;
  std::map<std::uint64_t, std::vector<PictureEvent>> open_;
};

}  // namespace

std::vector<PictureEvent> Picture::slices_of(const std::string &track) const {
  std::vector<PictureEvent> found;
  std::copy_if(slices.begin(), slices.end(), std::back_inserter(found),
               [&](const PictureEvent &slice) { return slice.track == track; });
  return found;
}

Picture read_picture(const std::string &path) {
  const Result<std::string> bytes = read_file(path);
  if (!bytes) {
    ADD_FAILURE() << to_string(bytes.error());
    return {};
  }
  PictureReader reader;
  reader.read({bytes->data(), bytes->size()});
  return reader.take();
}

}  // namespace redag::testing
