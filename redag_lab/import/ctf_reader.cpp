// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/ctf_reader.hpp"

#include <fmt/format.h>

#include "redag/base/text.hpp"

#ifndef REDAG_HAS_BABELTRACE

namespace redag::lab {

Result<ReadTrace> read_ros_trace(const std::string &, const std::function<void(const RosEvent &)> &,
                                 const ReadProgress &) {
  return make_error("this program was built without libbabeltrace2, which reads recordings",
                    "install it (Debian, Ubuntu: libbabeltrace2-dev), and build again");
}

}  // namespace redag::lab

#else

#include <babeltrace2/babeltrace.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

namespace redag::lab {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostCpus = 1024;  // of a robot file

template <auto Put>
struct Release {
  template <class T>
  void operator()(T *object) const {
    Put(object);
  }
};
template <class T, auto Put>
using Ref = std::unique_ptr<T, Release<Put> >;

using Graph = Ref<bt_graph, bt_graph_put_ref>;
using Plugin = Ref<const bt_plugin, bt_plugin_put_ref>;
using Value = Ref<bt_value, bt_value_put_ref>;

/// Returns what the library says of its last error, without its details.
std::string library_error() {
  const Ref<const bt_error, bt_error_release> error(bt_current_thread_take_error());
  if (!error || bt_error_get_cause_count(error.get()) == 0) return "unknown error of libbabeltrace2";
  std::string message = bt_error_cause_get_message(bt_error_borrow_cause_by_index(error.get(), 0));
  return message.substr(0, message.find_first_of(":\n"));
}

tl::unexpected<Diagnostics> damaged(const std::string &place, const std::string &why = library_error()) {
  return make_error(fmt::format("cannot read the recording {}: {}", in_quotes(place), printable(why)),
                    "was it copied whole, and the session ended (`lttng destroy`)?");
}

// ---- what lies in a folder ----

Result<std::vector<std::string> > find_traces(const std::string &folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return make_error(in_quotes(folder) + " is no folder", "name the folder that `ros2 trace` or `lttng` recorded to");
  }
  std::vector<std::string> traces;
  const auto look = [&](const fs::path &place) {
    if (fs::is_regular_file(place / "metadata", error)) traces.push_back(place.string());
  };
  look(folder);
  for (fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied, error), end;
       !error && at != end; at.increment(error)) {
    if (at->is_directory(error)) look(at->path());
  }
  if (traces.empty()) {
    return make_error(in_quotes(folder) + " holds no recording in the Common Trace Format: no file 'metadata' is in it",
                      "name the folder that `ros2 trace` or `lttng` recorded to");
  }
  std::sort(traces.begin(), traces.end());
  return traces;
}

std::string content_of(const fs::path &path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

template <class Integer>
Integer integer_at(const std::string &bytes, std::size_t at) {
  Integer value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

/// True if every packet of a metadata file lies in it whole, or if it is plain text. libbabeltrace2 2.0 never returns
/// from a packet that is cut off.
bool is_whole_metadata(const std::string &bytes) {
  constexpr std::size_t kHeader = 37;
  constexpr std::uint32_t kMagic = 0x75d11d57;
  if (bytes.size() < sizeof(kMagic)) return false;
  const auto first = integer_at<std::uint32_t>(bytes, 0);
  if (first != kMagic && first != __builtin_bswap32(kMagic)) return true;
  const auto size_at = [&](std::size_t at) {
    const auto bits = integer_at<std::uint32_t>(bytes, at);
    return (first == kMagic ? bits : __builtin_bswap32(bits)) / 8;
  };
  for (std::size_t at = 0; at < bytes.size();) {
    if (bytes.size() - at < kHeader) return false;
    const std::size_t content = size_at(at + 24);
    const std::size_t packet = size_at(at + 28);
    if (content < kHeader || packet < content || packet > bytes.size() - at) return false;
    at += packet;
  }
  return true;
}

Value inputs_of(const std::string &trace) {
  Value params(bt_value_map_create());
  bt_value *inputs = nullptr;
  if (!params || bt_value_map_insert_empty_array_entry(params.get(), "inputs", &inputs) != 0 ||
      bt_value_array_append_string_element(inputs, trace.c_str()) != 0) {
    return nullptr;
  }
  return params;
}

/// Returns how many nanoseconds a recording lasts, for the progress, by the index that LTTng writes beside it; 0: there
/// is none; nothing: the index is not that of these files, which would end the process in the library. (So does, for
/// damaged recordings, the library's own query for the length.)
std::optional<std::uint64_t> length_of(const std::vector<std::string> &traces) {
  constexpr std::size_t kHeader = 16;
  constexpr std::size_t kEntry = 40;  // to the end of the times of its packet
  std::uint64_t begin = UINT64_MAX;
  std::uint64_t end = 0;
  for (const std::string &trace : traces) {
    std::error_code error;
    for (fs::directory_iterator at(fs::path(trace) / "index", error), last; !error && at != last; at.increment(error)) {
      const std::string bytes = content_of(at->path());
      const auto number = [&](std::size_t place) { return __builtin_bswap64(integer_at<std::uint64_t>(bytes, place)); };
      if (bytes.size() < kHeader || integer_at<std::uint32_t>(bytes, 0) != __builtin_bswap32(0xc1f1dcc1)) return {};
      const std::size_t entry = __builtin_bswap32(integer_at<std::uint32_t>(bytes, 12));
      const std::uint64_t size = fs::file_size(fs::path(trace) / at->path().stem(), error);
      if (entry < kEntry || error) return {};
      for (std::size_t i = kHeader; i + entry <= bytes.size(); i += entry) {
        if (number(i) > size || number(i + 8) / 8 > size - number(i)) return {};
        begin = std::min(begin, number(i + 24));
        end = std::max(end, number(i + 32));
      }
    }
  }
  return end > begin ? end - begin : 0;
}

// ---- events ----

std::optional<std::uint64_t> number(const bt_field *field) {
  if (field == nullptr) return std::nullopt;
  const bt_field_class_type type = bt_field_get_class_type(field);
  if (bt_field_class_type_is(type, BT_FIELD_CLASS_TYPE_UNSIGNED_INTEGER)) {
    return bt_field_integer_unsigned_get_value(field);
  }
  if (bt_field_class_type_is(type, BT_FIELD_CLASS_TYPE_SIGNED_INTEGER)) {
    return static_cast<std::uint64_t>(bt_field_integer_signed_get_value(field));
  }
  return std::nullopt;
}

const bt_field *member(const bt_field *structure, const char *name) {
  if (structure == nullptr || name == nullptr) return nullptr;
  if (bt_field_get_class_type(structure) != BT_FIELD_CLASS_TYPE_STRUCTURE) return nullptr;
  return bt_field_structure_borrow_member_field_by_name_const(structure, name);
}

std::uint64_t number_in(const bt_field *structure, const char *name) {
  return number(member(structure, name)).value_or(0);
}

std::string_view text_in(const bt_field *structure, const char *name) {
  const bt_field *field = member(structure, name);
  if (field == nullptr || bt_field_get_class_type(field) != BT_FIELD_CLASS_TYPE_STRING) return {};
  return bt_field_string_get_value(field);
}

/// Takes the messages of the graph.
class Sink {
 public:
  Sink(const std::function<void(const RosEvent &)> &sink, const ReadProgress &progress, std::uint64_t length)
      : sink_(sink), progress_(progress), length_(length) {}

  ReadTrace read;
  std::string problem;  // ends the reading
  bt_message_iterator *messages = nullptr;

  bt_graph_simple_sink_component_consume_func_status consume() {
    bt_message_array_const batch = nullptr;
    std::uint64_t count = 0;
    const auto status = bt_message_iterator_next(messages, &batch, &count);
    if (status != BT_MESSAGE_ITERATOR_NEXT_STATUS_OK) {
      return static_cast<bt_graph_simple_sink_component_consume_func_status>(status);
    }
    for (std::uint64_t i = 0; i < count; ++i) {
      if (problem.empty()) take(batch[i]);
      bt_message_put_ref(batch[i]);
    }
    if (progress_) {
      const double done = length_ > 0 ? static_cast<double>(now_ - begin_) / static_cast<double>(length_) : 0;
      read.stopped = !progress_(std::clamp(done, 0.0, 1.0));
    }
    return problem.empty() ? BT_GRAPH_SIMPLE_SINK_COMPONENT_CONSUME_FUNC_STATUS_OK
                           : BT_GRAPH_SIMPLE_SINK_COMPONENT_CONSUME_FUNC_STATUS_ERROR;
  }

 private:
  void take(const bt_message *message) {
    bt_property_availability known = BT_PROPERTY_AVAILABILITY_NOT_AVAILABLE;
    std::uint64_t count = 0;
    switch (bt_message_get_type(message)) {
      case BT_MESSAGE_TYPE_EVENT: take_event(message); return;
      case BT_MESSAGE_TYPE_DISCARDED_EVENTS: known = bt_message_discarded_events_get_count(message, &count); break;
      case BT_MESSAGE_TYPE_DISCARDED_PACKETS: break;
      default: return;
    }
    read.lost += count;
    if (known == BT_PROPERTY_AVAILABILITY_NOT_AVAILABLE) read.lost_more = true;
  }

  void take_event(const bt_message *message) {
    ++read.events;
    const bt_event *event = bt_message_event_borrow_event_const(message);
    const RosEventName *name = name_of(bt_event_borrow_class_const(event));
    if (name == nullptr) return;
    RosEvent found;
    found.kind = name->kind;
    const bt_stream_class *stream = bt_stream_borrow_class_const(bt_event_borrow_stream_const(event));
    const bool has_clock = bt_stream_class_borrow_default_clock_class_const(stream) != nullptr;
    const bt_clock_snapshot *clock =
        has_clock ? bt_message_event_borrow_default_clock_snapshot_const(message) : nullptr;
    if (clock == nullptr ||
        bt_clock_snapshot_get_ns_from_origin(clock, &found.time) != BT_CLOCK_SNAPSHOT_GET_NS_FROM_ORIGIN_STATUS_OK) {
      problem = "its events have no time";
      return;
    }
    const bt_packet *packet = bt_event_borrow_packet_const(event);
    const bt_field *of_packet = packet != nullptr ? bt_packet_borrow_context_field_const(packet) : nullptr;
    read.cpus = std::max(read.cpus, std::min<std::uint64_t>(number_in(of_packet, "cpu_id"), kMostCpus - 1) + 1);
    now_ = found.time;
    if (begin_ == 0) begin_ = now_;
    const bt_field *payload = bt_event_borrow_payload_field_const(event);
    found.handle = number_in(payload, name->handle);
    found.other = number_in(payload, name->other);
    if (name->kind != RosEvent::Kind::Switch) {
      const bt_field *context = bt_event_borrow_common_context_field_const(event);
      const std::optional<std::uint64_t> process = number(member(context, "vpid"));
      const std::optional<std::uint64_t> thread = number(member(context, "vtid"));
      if (!process || !thread) {
        problem = "its events do not say their process and thread (contexts vpid and vtid)";
        return;
      }
      found.process = static_cast<std::uint32_t>(*process);
      found.thread = static_cast<std::uint32_t>(*thread);
      found.third = number_in(payload, name->third);
      found.value = static_cast<std::int64_t>(number_in(payload, name->value));
      found.name = text_in(payload, name->text);
      // CARET records objects again that were made before: with the clock of the events, but without its offset.
      const std::uint64_t now = bt_clock_snapshot_get_value(clock);
      const std::uint64_t created = number_in(payload, "init_timestamp");
      if (created > 0 && created < now) found.created = found.time - static_cast<Duration>(now - created);
      if (name->kind == RosEvent::Kind::NodeInit) found.space = text_in(payload, "namespace");
      if (name->kind == RosEvent::Kind::Take && number_in(payload, "taken") == 0) found.value = 0;
      found.program = text_in(context, "procname");
    }
    sink_(found);
  }

  const RosEventName *name_of(const bt_event_class *event) {
    const auto [known, is_new] = names_.try_emplace(event, nullptr);
    const char *name = is_new ? bt_event_class_get_name(event) : nullptr;
    if (name != nullptr) {
      std::string_view plain = name;
      constexpr std::string_view kCaret = "ros2_caret:";  // also has events of ros2_tracing under its name
      if (plain.starts_with(kCaret)) plain.remove_prefix(kCaret.size());
      const auto *found = std::find_if(kRosEventNames.begin(), kRosEventNames.end(), [&](const RosEventName &ours) {
        return ours.name == name || (plain != name && ours.name == "ros2:" + std::string(plain));
      });
      if (found != kRosEventNames.end()) known->second = found;
    }
    return known->second;
  }

  const std::function<void(const RosEvent &)> &sink_;
  const ReadProgress &progress_;
  std::unordered_map<const bt_event_class *, const RosEventName *> names_;
  std::uint64_t length_;
  std::int64_t begin_ = 0;
  std::int64_t now_ = 0;
};

Plugin find_plugin(const char *name) {
  const bt_plugin *plugin = nullptr;
  if (bt_plugin_find(name, BT_TRUE, BT_FALSE, BT_TRUE, BT_TRUE, BT_FALSE, &plugin) != 0) (void)library_error();
  return Plugin(plugin);
}

}  // namespace

Result<ReadTrace> read_ros_trace(const std::string &folder, const std::function<void(const RosEvent &)> &sink,
                                 const ReadProgress &progress) {
  const Result<std::vector<std::string> > traces = find_traces(folder);
  if (!traces) return tl::unexpected(traces.error());
  const Plugin ctf = find_plugin("ctf");
  const Plugin utils = find_plugin("utils");
  const bt_component_class_source *reader =
      ctf ? bt_plugin_borrow_source_component_class_by_name_const(ctf.get(), "fs") : nullptr;
  const bt_component_class_filter *muxer =
      utils ? bt_plugin_borrow_filter_component_class_by_name_const(utils.get(), "muxer") : nullptr;
  if (reader == nullptr || muxer == nullptr) {
    return make_error("libbabeltrace2 does not find its plugins 'ctf' and 'utils'",
                      "install them (Debian, Ubuntu: libbabeltrace2-0)");
  }

  const std::optional<std::uint64_t> length = length_of(*traces);
  if (!length) return damaged(folder, "its index is that of other files");
  Sink taker(sink, progress, *length);
  const auto begin = [](bt_message_iterator *messages, void *data) {
    static_cast<Sink *>(data)->messages = messages;
    return BT_GRAPH_SIMPLE_SINK_COMPONENT_INITIALIZE_FUNC_STATUS_OK;
  };
  const auto consume = [](bt_message_iterator *, void *data) { return static_cast<Sink *>(data)->consume(); };
  const Graph graph(bt_graph_create(0));
  const bt_component_filter *merged = nullptr;
  const bt_component_sink *last = nullptr;
  if (!graph ||
      bt_graph_add_filter_component(graph.get(), muxer, "merge", nullptr, BT_LOGGING_LEVEL_NONE, &merged) != 0 ||
      bt_graph_add_simple_sink_component(graph.get(), "redag", begin, consume, nullptr, &taker, &last) != 0) {
    return damaged(folder);
  }
  std::size_t position = 0;
  for (const std::string &trace : *traces) {
    const bt_component_source *source = nullptr;
    if (!is_whole_metadata(content_of(fs::path(trace) / "metadata"))) return damaged(trace, "its metadata are cut off");
    const Value params = inputs_of(trace);
    if (!params || bt_graph_add_source_component(graph.get(), reader, fmt::format("trace {}", position++).c_str(),
                                                 params.get(), BT_LOGGING_LEVEL_NONE, &source) != 0) {
      return damaged(trace);
    }
    // The muxer always has one free port, its last.
    for (std::uint64_t port = 0; port < bt_component_source_get_output_port_count(source); ++port) {
      const std::uint64_t free = bt_component_filter_get_input_port_count(merged) - 1;
      if (bt_graph_connect_ports(graph.get(), bt_component_source_borrow_output_port_by_index_const(source, port),
                                 bt_component_filter_borrow_input_port_by_index_const(merged, free), nullptr) != 0) {
        return damaged(trace);
      }
    }
  }
  if (bt_graph_connect_ports(graph.get(), bt_component_filter_borrow_output_port_by_index_const(merged, 0),
                             bt_component_sink_borrow_input_port_by_index_const(last, 0), nullptr) != 0) {
    return damaged(folder);
  }
  while (!taker.read.stopped) {
    const bt_graph_run_once_status status = bt_graph_run_once(graph.get());
    if (status == BT_GRAPH_RUN_ONCE_STATUS_END) break;
    if (status == BT_GRAPH_RUN_ONCE_STATUS_OK || status == BT_GRAPH_RUN_ONCE_STATUS_AGAIN) continue;
    if (taker.problem.empty()) return damaged(folder);
    (void)library_error();
    return make_error(fmt::format("the recording {} cannot be used: {}", in_quotes(folder), taker.problem),
                      "record it as `ros2 trace` does");
  }
  return taker.read;
}

}  // namespace redag::lab

#endif
