// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/model/workload_yaml_tree.hpp"

#include <istream>
#include <optional>
#include <streambuf>
#include <utility>

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include "redag/base/check.hpp"
#include "redag/base/text.hpp"

namespace redag::yaml {
namespace {

/// Thrown through yaml-cpp to stop it at the first forbidden construct.
struct Rejected {
  YAML::Mark mark;
  std::string message;
  std::string hint;
};

tl::unexpected<Diagnostics> error_at(const std::string &file, int line, int column, std::string message,
                                     std::string hint) {
  return tl::unexpected<Diagnostics>(
      Diagnostics{Diagnostic{Severity::Error, file, line, column, std::move(message), std::move(hint)}});
}

class TreeBuilder : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark & /*mark*/) override {}
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark &mark, YAML::anchor_t anchor) override {
    refuse_extras(mark, anchor, "");
    add(Node::Kind::Null, mark);
  }

  void OnAlias(const YAML::Mark &mark, YAML::anchor_t /*anchor*/) override { refuse_alias(mark); }

  void OnScalar(const YAML::Mark &mark, const std::string &tag, YAML::anchor_t anchor,
                const std::string &value) override {
    refuse_extras(mark, anchor, tag);
    Node &node = add(Node::Kind::Scalar, mark);
    node.text = value;
    node.quoted = tag == "!";
    last_scalar_ = mark;
  }

  void OnSequenceStart(const YAML::Mark &mark, const std::string &tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value /*style*/) override {
    refuse_extras(mark, anchor, tag);
    open(Node::Kind::Sequence, mark);
  }
  void OnSequenceEnd() override { close(); }

  void OnMapStart(const YAML::Mark &mark, const std::string &tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value /*style*/) override {
    refuse_extras(mark, anchor, tag);
    open(Node::Kind::Map, mark);
  }
  void OnMapEnd() override { close(); }

  [[nodiscard]] Node take_root() { return std::move(root_); }
  [[nodiscard]] const YAML::Mark &last_scalar() const { return last_scalar_; }

 private:
  [[noreturn]] static void refuse_alias(const YAML::Mark &mark) {
    throw Rejected{mark, "aliases and anchors (* and &) are not supported", "write out the values"};
  }

  static void refuse_extras(const YAML::Mark &mark, YAML::anchor_t anchor, const std::string &tag) {
    if (anchor != YAML::NullAnchor) refuse_alias(mark);
    // yaml-cpp gives "?" to plain and "!" to quoted scalars that have no tag.
    if (!tag.empty() && tag != "?" && tag != "!") {
      throw Rejected{mark, fmt::format("tags (here '{}') are not supported", tag), "remove the tag"};
    }
  }

  // Pointers in open_ stay valid, because only the innermost open node's children grow.
  Node &add(Node::Kind kind, const YAML::Mark &mark) {
    Node *node = &root_;
    if (!open_.empty()) node = &open_.back()->children.emplace_back();
    node->kind = kind;
    node->line = mark.line + 1;
    node->column = mark.column + 1;
    return *node;
  }

  void open(Node::Kind kind, const YAML::Mark &mark) {
    if (open_.size() >= kMaxDepth) {
      throw Rejected{mark, fmt::format("the file is nested more than {} levels deep", kMaxDepth),
                     "a workload needs seven levels"};
    }
    open_.push_back(&add(kind, mark));
  }

  void close() {
    REDAG_CHECK(!open_.empty(), "yaml-cpp closes only what it opened");
    open_.pop_back();
  }

  Node root_;
  std::vector<Node *> open_;
  YAML::Mark last_scalar_ = YAML::Mark::null_mark();
};

struct BadCharacter {
  int line;
  int column;
  std::string message;
  std::string hint;
};

// Checked before yaml-cpp, which guesses other encodings and takes the character 4 for the end of the file.
std::optional<BadCharacter> find_bad_character(std::string_view text) {
  int line = 1;
  std::size_t line_start = 0;
  for (std::size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i]);
    const auto column = static_cast<int>(i - line_start) + 1;
    const std::size_t length = utf8_length(text, i);
    if (length == 0)
      return BadCharacter{line, column, fmt::format("byte 0x{:02x} is not valid UTF-8", c), "save the file as UTF-8"};
    if (c == '\n') {
      ++line;
      line_start = i + 1;
    } else if ((c < 0x20 && c != '\t' && c != '\r') || c == 0x7F) {
      return BadCharacter{line, column, fmt::format("the file contains control character 0x{:02x}", c),
                          "is it a text file?"};
    }
    i += length;
  }
  return std::nullopt;
}

/// yaml-cpp lets an unclosed quoted text run to the end of the file. It is then the last scalar.
bool is_unclosed(std::string_view text, int position) {
  if (position < 0 || static_cast<std::size_t>(position) >= text.size()) return false;
  auto i = static_cast<std::size_t>(position);
  const char quote = text[i];
  if (quote != '"' && quote != '\'') return false;
  for (++i; i < text.size(); ++i) {
    if (quote == '"' && text[i] == '\\') {
      ++i;
    } else if (text[i] == quote) {
      const bool doubled = quote == '\'' && i + 1 < text.size() && text[i + 1] == quote;
      if (!doubled) return false;
      ++i;
    }
  }
  return true;
}

/// A stream over text in memory.
class ViewBuffer : public std::streambuf {
 public:
  explicit ViewBuffer(std::string_view text) {
    char *begin = const_cast<char *>(text.data());  // a get area is never written to
    setg(begin, begin, begin + text.size());
  }
};

}  // namespace

Result<Node> parse(std::string_view text, const std::string &file) {
  if (const auto bad = find_bad_character(text)) {
    return error_at(file, bad->line, bad->column, bad->message, bad->hint);
  }
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  try {
    ViewBuffer buffer(text);
    std::istream stream(&buffer);
    YAML::Parser parser(stream);
    TreeBuilder builder;
    if (!parser.HandleNextDocument(builder)) return Node{};
    if (const YAML::Mark &mark = builder.last_scalar(); is_unclosed(text, mark.pos)) {
      return error_at(file, mark.line + 1, mark.column + 1, "invalid YAML: a quote is not closed", "");
    }
    TreeBuilder rest;
    if (parser.HandleNextDocument(rest)) {
      const Node second = rest.take_root();
      return error_at(file, second.line, second.column, "the file has a second document",
                      "put each document in a file of its own");
    }
    return builder.take_root();
  } catch (const Rejected &rejected) {
    return error_at(file, rejected.mark.line + 1, rejected.mark.column + 1, rejected.message, rejected.hint);
  } catch (const YAML::Exception &exception) {
    return error_at(file, exception.mark.line + 1, exception.mark.column + 1, "invalid YAML: " + exception.msg, "");
  }
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
