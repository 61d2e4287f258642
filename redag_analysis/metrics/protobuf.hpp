// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes protobuf's wire format (protobuf.dev/programming-guides/encoding). A message is open while its object lives,
// and appends to a text that it shares with those around it. Own code, because no library that ROS can install for its
// users does this without generated code.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

namespace redag::metrics::protobuf {

/// Bytes that a message inside another has as its length, while it is open.
inline constexpr std::size_t kLengthBytes = 1;

inline void append_varint(std::string &bytes, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7U) bytes.push_back(static_cast<char>(value | 0x80U));
  bytes.push_back(static_cast<char>(value));
}

/// A message with these fields: an enumeration of their numbers.
template <class Field>
class Message {
  static_assert(std::is_same_v<std::underlying_type_t<Field>, std::uint32_t>);

 public:
  /// One that nothing surrounds.
  explicit Message(std::string &bytes) : bytes_(bytes) {}
  /// The value of a field of another, which is not written to until this one is closed.
  template <class Outer>
  Message(Message<Outer> &outer, Outer field) : bytes_(outer.bytes_) {
    outer.add_tag(field, kLengthDelimited);
    bytes_.append(kLengthBytes, '\0');
    begin_ = bytes_.size();
  }
  Message(const Message &) = delete;
  Message &operator=(const Message &) = delete;
  ~Message() {
    if (begin_ == 0) return;
    // Most messages are short. The length of a long one needs more room, and the message moves.
    std::string length;
    append_varint(length, bytes_.size() - begin_);
    bytes_.replace(begin_ - kLengthBytes, kLengthBytes, length);
  }

  void add_uint(Field field, std::uint64_t value) {
    add_tag(field, kVarint);
    append_varint(bytes_, value);
  }
  void add_int(Field field, std::int64_t value) { add_uint(field, static_cast<std::uint64_t>(value)); }
  void add_fixed64(Field field, std::uint64_t value) {
    add_tag(field, kFixed64);
    for (unsigned shift = 0; shift < 64; shift += 8) bytes_.push_back(static_cast<char>(value >> shift));
  }
  /// Also for bytes.
  void add_text(Field field, std::string_view text) {
    add_tag(field, kLengthDelimited);
    append_varint(bytes_, text.size());
    bytes_.append(text);
  }

 private:
  template <class Inner>
  friend class Message;

  // Types of the wire format.
  static constexpr std::uint32_t kVarint = 0;
  static constexpr std::uint32_t kFixed64 = 1;
  static constexpr std::uint32_t kLengthDelimited = 2;

  void add_tag(Field field, std::uint32_t type) {
    append_varint(bytes_, std::uint64_t{static_cast<std::uint32_t>(field)} << 3U | type);
  }

  std::string &bytes_;
  std::size_t begin_ = 0;  // of its content; 0: nothing surrounds it
};

}  // namespace redag::metrics::protobuf
