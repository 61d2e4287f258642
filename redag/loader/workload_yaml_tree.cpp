// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/workload_yaml_tree.hpp"

#include <algorithm>
#include <new>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <yaml.h>

#include "redag/base/check.hpp"
#include "redag/base/text.hpp"

namespace redag::yaml {
namespace {

struct Place {
  int line = 1;
  int column = 1;
};

Place place_of(const yaml_mark_t &mark) { return {static_cast<int>(mark.line) + 1, static_cast<int>(mark.column) + 1}; }

/// Leaves parse() at the first mistake.
struct Rejected {
  Place place;
  std::string message;
  std::string hint;
};

const char *as_text(const yaml_char_t *bytes) { return reinterpret_cast<const char *>(bytes); }

/// What libyaml found next. Owns the texts in it.
class Event {
 public:
  Event() = default;
  ~Event() { yaml_event_delete(&raw_); }
  Event(const Event &) = delete;
  Event &operator=(const Event &) = delete;

  [[nodiscard]] yaml_event_t &raw() { return raw_; }

 private:
  yaml_event_t raw_{};
};

/// Returns the place of byte `end`. Requires that the text before it is valid UTF-8.
Place place_at(std::string_view text, std::size_t end) {
  Place place;
  for (std::size_t i = 0; i < end; i += utf8_length(text, i)) {
    if (text[i] == '\n') {
      ++place.line;
      place.column = 1;
    } else {
      ++place.column;
    }
  }
  return place;
}

std::string_view line_of(std::string_view text, int number) {
  for (; number > 1; --number) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return {};
    text.remove_prefix(end + 1);
  }
  text = text.substr(0, text.find('\n'));
  if (text.ends_with('\r')) text.remove_suffix(1);
  return text;
}

/// Explains what the eye cannot see in a line: a tab in its indentation, or a character that only looks like a space.
std::optional<Rejected> unseen_mistake(std::string_view text, int number) {
  const std::string_view line = line_of(text, number);
  const std::size_t begin = std::min(line.find_first_not_of(" \t"), line.size());
  if (const std::size_t tab = line.substr(0, begin).find('\t'); tab != std::string_view::npos) {
    std::string mended;
    for (const char c : line.substr(0, begin)) mended += c == '\t' ? "  " : " ";
    mended += line.substr(begin);
    return Rejected{{number, static_cast<int>(tab) + 1},
                    "a tab is in the indentation, where YAML takes only spaces",
                    "write " + in_quotes(mended)};
  }
  const std::size_t at = find_odd_space(line);
  if (at == std::string_view::npos) return std::nullopt;
  const std::size_t length = utf8_length(line, at);
  return Rejected{{number, place_at(line, at).column},
                  fmt::format("U+{:04X} is here, which looks like a space or like nothing, and is part of the text",
                              static_cast<std::uint32_t>(code_point(line.substr(at, length)))),
                  fmt::format("write {}", in_quotes(std::string(line.substr(begin, at - begin)) + ' ' +
                                                    std::string(line.substr(at + length))))};
}

/// libyaml's events of one text, which must outlive it.
class EventReader {
 public:
  explicit EventReader(std::string_view text) : text_(text) {
    if (yaml_parser_initialize(&parser_) == 0) throw std::bad_alloc();
    yaml_parser_set_encoding(&parser_, YAML_UTF8_ENCODING);
    const char *bytes = text.empty() ? "" : text.data();
    yaml_parser_set_input_string(&parser_, reinterpret_cast<const unsigned char *>(bytes), text.size());
  }
  ~EventReader() { yaml_parser_delete(&parser_); }
  EventReader(const EventReader &) = delete;
  EventReader &operator=(const EventReader &) = delete;

  /// Replaces `event` by the next one. Throws Rejected where the text is not YAML.
  void next(Event &event) {
    yaml_event_delete(&event.raw());
    if (yaml_parser_parse(&parser_, &event.raw()) == 0) throw mistake();
  }

 private:
  [[nodiscard]] Rejected mistake() const {
    if (parser_.error == YAML_MEMORY_ERROR) throw std::bad_alloc();
    const std::string_view problem = parser_.problem;
    if (parser_.error == YAML_READER_ERROR) {
      return {place_at(text_, parser_.problem_offset), fmt::format("invalid YAML: {}", problem), ""};
    }
    const Place place = place_of(parser_.problem_mark);
    if (parser_.context != nullptr) {
      if (auto unseen = unseen_mistake(text_, place_of(parser_.context_mark).line)) return *std::move(unseen);
    }
    if (auto unseen = unseen_mistake(text_, place.line)) return *std::move(unseen);
    if (parser_.context == nullptr) return {place, fmt::format("invalid YAML: {}", problem), ""};
    const std::string_view context = parser_.context;
    const Place begin = place_of(parser_.context_mark);
    // It swallows the rest of the file, whose end is not the place to look at.
    if (context == "while scanning a quoted scalar" && problem == "found unexpected end of stream") {
      return {begin, "invalid YAML: a quote is not closed", ""};
    }
    std::string message = fmt::format("invalid YAML: {} {}", problem, context);
    if (begin.line != place.line) message += fmt::format(" that begins in line {}", begin.line);
    return {place, std::move(message), ""};
  }

  std::string_view text_;
  yaml_parser_t parser_{};
};

class TreeBuilder {
 public:
  explicit TreeBuilder(std::string_view text) : text_(text) {}

  /// Takes the events of one document, from its begin to its end.
  Node read(EventReader &reader) {
    Event event;
    do {
      reader.next(event);
    } while (take(event.raw()));
    REDAG_CHECK(open_.empty(), "libyaml closes what it opened");
    return std::move(root_);
  }

 private:
  bool take(const yaml_event_t &event) {
    switch (event.type) {
      case YAML_SCALAR_EVENT: add_scalar(event); break;
      case YAML_SEQUENCE_START_EVENT:
        refuse_extras(event.start_mark, event.data.sequence_start.anchor, event.data.sequence_start.tag);
        open(Node::Kind::Sequence, event.start_mark);
        break;
      case YAML_MAPPING_START_EVENT:
        refuse_extras(event.start_mark, event.data.mapping_start.anchor, event.data.mapping_start.tag);
        open(Node::Kind::Map, event.start_mark);
        break;
      case YAML_SEQUENCE_END_EVENT:
      case YAML_MAPPING_END_EVENT: close(); break;
      case YAML_ALIAS_EVENT: refuse_alias(event.start_mark);
      default: return false;
    }
    return true;
  }

  [[noreturn]] static void refuse_alias(const yaml_mark_t &mark) {
    throw Rejected{place_of(mark), "aliases and anchors (* and &) are not supported", "write out the values"};
  }

  static void refuse_extras(const yaml_mark_t &mark, const yaml_char_t *anchor, const yaml_char_t *tag) {
    if (anchor != nullptr) refuse_alias(mark);
    if (tag == nullptr) return;
    throw Rejected{place_of(mark), fmt::format("tags (here {}) are not supported", in_quotes(as_text(tag))),
                   "remove the tag"};
  }

  void add_scalar(const yaml_event_t &event) {
    const auto &scalar = event.data.scalar;
    refuse_extras(event.start_mark, scalar.anchor, scalar.tag);
    const std::string_view text(as_text(scalar.value), scalar.length);
    const bool quoted = scalar.style != YAML_PLAIN_SCALAR_STYLE;
    if (!quoted && is_null(text)) {
      add(Node::Kind::Null, event.start_mark);
      return;
    }
    if (!quoted && find_odd_space(text) != std::string_view::npos) {
      for (std::size_t line = event.start_mark.line; line <= event.end_mark.line; ++line) {
        if (auto unseen = unseen_mistake(text_, static_cast<int>(line) + 1)) throw *std::move(unseen);
      }
    }
    Node &node = add(Node::Kind::Scalar, event.start_mark);
    node.text = text;
    node.quoted = quoted;
  }

  // Pointers in open_ stay valid, because only the innermost open node's children grow.
  Node &add(Node::Kind kind, const yaml_mark_t &mark) {
    Node *node = &root_;
    if (!open_.empty()) {
      std::vector<Node> &children = open_.back()->children;
      if (children.empty()) children.reserve(4);  // most parts have at least two keys
      node = &children.emplace_back();
    }
    node->kind = kind;
    const Place place = place_of(mark);
    node->line = place.line;
    node->column = place.column;
    return *node;
  }

  void open(Node::Kind kind, const yaml_mark_t &mark) {
    if (open_.size() >= kMaxDepth) {
      throw Rejected{place_of(mark), fmt::format("the file is nested more than {} levels deep", kMaxDepth),
                     "a workload needs seven levels"};
    }
    open_.push_back(&add(kind, mark));
  }

  void close() {
    REDAG_CHECK(!open_.empty(), "libyaml closes only what it opened");
    open_.pop_back();
  }

  std::string_view text_;
  Node root_;
  std::vector<Node *> open_;
};

// libyaml would say less about them, and takes a second byte order mark for an invalid character.
void refuse_bad_characters(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i]);
    const std::size_t length = c < 0x80 ? 1 : utf8_length(text, i);
    if (length == 0) {
      throw Rejected{place_at(text, i), fmt::format("byte 0x{:02x} is not valid UTF-8", c), "save the file as UTF-8"};
    }
    if ((c < 0x20 && c != '\t' && c != '\n' && c != '\r') || c == 0x7F) {
      throw Rejected{place_at(text, i), fmt::format("the file contains control character 0x{:02x}", c),
                     "is it a text file?"};
    }
    i += length;
  }
}

bool is_break_before(std::string_view text, std::size_t at) {
  const std::string_view before = text.substr(0, at);
  // What libyaml takes for the end of a line: besides these two U+0085, U+2028 and U+2029.
  if (before.empty() || before.ends_with('\n') || before.ends_with('\r')) return true;
  return before.ends_with("\xC2\x85") || before.ends_with("\xE2\x80\xA8") || before.ends_with("\xE2\x80\xA9");
}

// Only tags need the directive. libyaml compares each with all before it: a file of them would take hours.
void refuse_tag_directives(std::string_view text) {
  constexpr std::string_view kDirective = "%TAG";
  for (std::size_t at = text.find(kDirective); at != text.npos; at = text.find(kDirective, at + 1)) {
    if (!is_break_before(text, at)) continue;
    throw Rejected{place_at(text, at), "tags (here the directive %TAG) are not supported", "remove the directive"};
  }
}

Node read_only_document(std::string_view text) {
  EventReader reader(text);
  Event event;
  reader.next(event);  // the begin of the text
  reader.next(event);
  if (event.raw().type == YAML_STREAM_END_EVENT) return {};
  Node root = TreeBuilder(text).read(reader);
  reader.next(event);
  if (event.raw().type == YAML_STREAM_END_EVENT) return root;
  reader.next(event);
  throw Rejected{place_of(event.raw().start_mark), "the file has a second document",
                 "put each document in a file of its own"};
}

}  // namespace

Result<Node> parse(std::string_view text, const std::string &file) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  try {
    refuse_bad_characters(text);
    refuse_tag_directives(text);
    return read_only_document(text);
  } catch (Rejected &rejected) {
    return tl::unexpected<Diagnostics>(
        Diagnostics{Diagnostic{Severity::Error, file, rejected.place.line, rejected.place.column,
                               std::move(rejected.message), std::move(rejected.hint)}});
  }
}

bool is_null(std::string_view plain) {
  return plain.empty() || plain == "~" || plain == "null" || plain == "Null" || plain == "NULL";
}

std::size_t find_odd_space(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    if (static_cast<unsigned char>(text[i]) < 0x80) {
      ++i;
      continue;
    }
    const std::size_t length = utf8_length(text, i);
    if (length == 0) return std::string_view::npos;
    const char32_t code = code_point(text.substr(i, length));
    const bool is_wide = code >= 0x2000 && code <= 0x200B;  // of several widths, or none
    if (is_wide || code == 0xA0 || code == 0xAD || code == 0x1680 || code == 0x202F || code == 0x205F ||
        code == 0x2060 || code == 0x3000) {
      return i;
    }
    i += length;
  }
  return std::string_view::npos;
}

std::string describe(const Node &node) {
  switch (node.kind) {
    case Node::Kind::Null: return "nothing";
    case Node::Kind::Sequence: return "a list";
    case Node::Kind::Map: return "a map";
    case Node::Kind::Scalar: break;
  }
  return in_quotes(node.text);
}

}  // namespace redag::yaml
