// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/model/workload_yaml_plain.hpp"

#include <array>
#include <cstdint>
#include <utility>

namespace redag::yaml {
namespace {

// What a character can be in the plain part of YAML.
enum Character : std::uint8_t {
  kWord = 1,   // in a key, or anywhere in a plain scalar
  kInner = 2,  // in a plain scalar, but not as its first character
  kShown = 4,  // in quotes and comments
};

constexpr std::array<std::uint8_t, 256> kCharacters = [] {
  std::array<std::uint8_t, 256> of{};
  for (unsigned c = 0x20; c < 0x7F; ++c) of[c] = kShown;
  for (const auto &[first, last] :
       {std::pair{'a', 'z'}, std::pair{'A', 'Z'}, std::pair{'0', '9'}, std::pair{'_', '_'}}) {
    for (int c = first; c <= last; ++c) of[static_cast<unsigned>(c)] |= kWord | kInner;
  }
  for (const char c : {'/', '.', '+', '-', '*'}) of[static_cast<unsigned char>(c)] |= kInner;
  return of;
}();

constexpr std::size_t kLongestKey = 100;  // yaml-cpp takes up to 1024 characters for a key
constexpr std::size_t kDeepest = 16;
static_assert(kDeepest < kMaxDepth);

// Each function that parses something returns false if it is not in the plain part, and the parse ends. `at_` is then
// meaningless.
class PlainParser {
 public:
  explicit PlainParser(std::string_view text) : text_(text) {}

  bool document(Node &root) { return next_line() && column() == 0 && block_map(root, 0) && at_ == text_.size(); }

 private:
  [[nodiscard]] char peek(std::size_t ahead = 0) const {
    return at_ + ahead < text_.size() ? text_[at_ + ahead] : '\n';
  }
  [[nodiscard]] bool is(std::uint8_t what, std::size_t ahead = 0) const {
    return (kCharacters[static_cast<unsigned char>(peek(ahead))] & what) != 0;
  }
  [[nodiscard]] std::size_t column() const { return at_ - line_start_; }
  void skip_blanks() {
    while (peek() == ' ') ++at_;
  }
  void begin(Node &node, Node::Kind kind) const {
    node.kind = kind;
    node.line = line_;
    node.column = static_cast<int>(column()) + 1;
  }

  // ---- lines ----

  // Goes past blanks, a comment and the end of the line. A comment follows a blank or begins its line.
  bool end_line() {
    const std::size_t begin = at_;
    skip_blanks();
    if (peek() == '#' && (at_ > begin || column() == 0)) {
      while (is(kShown)) ++at_;
    }
    if (peek() != '\n') return false;
    if (at_ == text_.size()) return true;
    ++at_;
    ++line_;
    line_start_ = at_;
    return true;
  }

  // Goes to the first character of the next line that has more than a comment, or to the end of the text.
  bool next_line() {
    for (;;) {
      const std::size_t begin = at_;
      skip_blanks();
      if (peek() != '#' && peek() != '\n') return true;
      at_ = begin;
      if (!end_line()) return false;
      if (at_ == text_.size()) return true;
    }
  }
  // After next_line(): the text goes on in this column.
  [[nodiscard]] bool continues_at(std::size_t indent) const { return at_ < text_.size() && column() == indent; }
  [[nodiscard]] bool continues_beyond(std::size_t indent) const { return at_ < text_.size() && column() > indent; }

  // ---- blocks: each begins at its first character and ends with next_line() ----
  //
  // A line that begins in none of the columns where it could go on ends all blocks, and document() then finds that the
  // text is not at its end.

  // Returns the length of the key that begins here; 0: none does.
  [[nodiscard]] std::size_t key_length() const {
    std::size_t length = 0;
    while (length < kLongestKey && is(kWord, length)) ++length;
    if (length == 0 || peek(length) != ':') return 0;
    const char after = peek(length + 1);
    return after == ' ' || after == '\n' ? length : 0;
  }

  // Reads the key and goes past its colon.
  bool key(Node &map) {
    const std::size_t length = key_length();
    if (length == 0) return false;
    Node &node = map.children.emplace_back();
    begin(node, Node::Kind::Scalar);
    node.text = text_.substr(at_, length);
    at_ += length + 1;
    return !is_null(node.text);
  }

  bool block_map(Node &node, std::size_t indent) {
    const Nested nested(depth_);
    if (depth_ > kDeepest) return false;
    begin(node, Node::Kind::Map);
    node.children.reserve(8);
    do {
      if (!key(node)) return false;
      skip_blanks();
      Node &value = node.children.emplace_back();
      const bool in_line = peek() != '\n' && peek() != '#';
      if (!(in_line ? line_value(value) : block_value(value, indent))) return false;
    } while (continues_at(indent));
    return true;
  }

  // A value in the rest of this line.
  bool line_value(Node &node) { return flow(node) && end_line() && next_line(); }

  // A block in the lines below its key. A list can stand as far left as its key.
  bool block_value(Node &node, std::size_t indent) {
    while (is(kShown)) ++at_;  // a comment: key() saw the blank before it
    if (!end_line() || !next_line()) return false;
    const bool is_list = peek() == '-' && peek(1) == ' ';
    if (is_list && continues_at(indent)) return block_list(node, indent);
    if (!continues_beyond(indent)) return false;  // the value is null
    return is_list ? block_list(node, column()) : block_map(node, column());
  }

  bool block_list(Node &node, std::size_t indent) {
    const Nested nested(depth_);
    if (depth_ > kDeepest) return false;
    begin(node, Node::Kind::Sequence);
    while (continues_at(indent) && peek() == '-' && peek(1) == ' ') {
      ++at_;
      skip_blanks();
      Node &item = node.children.emplace_back();
      if (!(key_length() > 0 ? block_map(item, column()) : line_value(item))) return false;
    }
    return true;
  }

  // ---- values within a line ----

  bool flow(Node &node) {
    switch (peek()) {
      case '{': return flow_map(node);
      case '[': return flow_list(node);
      case '"':
      case '\'': return quoted(node);
      default: return plain(node);
    }
  }

  // After an entry of a map or list: goes past a comma, or past the end.
  bool next_entry(char end, bool &more) {
    skip_blanks();
    more = peek() == ',';
    if (!more && peek() != end) return false;
    ++at_;
    if (more) skip_blanks();
    return true;
  }

  bool flow_map(Node &node) {
    const Nested nested(depth_);
    if (depth_ > kDeepest) return false;
    begin(node, Node::Kind::Map);
    node.children.reserve(8);
    ++at_;
    skip_blanks();
    bool more = peek() != '}';
    if (!more) ++at_;
    while (more) {
      if (!key(node)) return false;
      skip_blanks();
      if (!flow(node.children.emplace_back()) || !next_entry('}', more)) return false;
    }
    return true;
  }

  bool flow_list(Node &node) {
    const Nested nested(depth_);
    if (depth_ > kDeepest) return false;
    begin(node, Node::Kind::Sequence);
    ++at_;
    skip_blanks();
    bool more = peek() != ']';
    if (!more) ++at_;
    while (more) {
      if (!flow(node.children.emplace_back()) || !next_entry(']', more)) return false;
    }
    return true;
  }

  // Without escapes, and without blanks at an end.
  bool quoted(Node &node) {
    begin(node, Node::Kind::Scalar);
    node.quoted = true;
    const char quote = peek();
    const std::size_t first = ++at_;
    while (is(kShown) && peek() != quote && peek() != '\\') ++at_;
    if (peek() != quote || peek(1) == quote) return false;
    node.text = text_.substr(first, at_ - first);
    ++at_;
    return node.text.empty() || (node.text.front() != ' ' && node.text.back() != ' ');
  }

  bool plain(Node &node) {
    const bool is_number = (peek() == '-' || peek() == '+' || peek() == '.') && is(kWord, 1);
    if (!is(kWord) && !is_number && peek() != '/') return false;
    begin(node, Node::Kind::Scalar);
    const std::size_t first = at_;
    std::size_t end = at_;
    while (is(kInner) || peek() == ' ') {
      ++at_;
      if (text_[at_ - 1] != ' ') end = at_;
    }
    at_ = end;
    node.text = text_.substr(first, end - first);
    return !is_null(node.text);
  }

  [[nodiscard]] static bool is_null(std::string_view text) {
    return text == "null" || text == "Null" || text == "NULL";
  }

  // Counts how deeply blocks and flows are nested.
  class Nested {
   public:
    explicit Nested(std::size_t &depth) : depth_(depth) { ++depth_; }
    ~Nested() { --depth_; }
    Nested(const Nested &) = delete;
    Nested &operator=(const Nested &) = delete;

   private:
    std::size_t &depth_;
  };

  std::string_view text_;
  std::size_t at_ = 0;
  std::size_t line_start_ = 0;
  int line_ = 1;
  std::size_t depth_ = 0;
};

}  // namespace

std::optional<Node> parse_plain(std::string_view text) {
  Node root;
  if (!PlainParser(text).document(root)) return std::nullopt;
  return root;
}

}  // namespace redag::yaml
