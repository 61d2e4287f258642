// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a Writer writes is read as it was, whatever the texts contain.
#include "redag/loader/yaml_writer.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "redag/loader/workload_yaml_tree.hpp"

namespace redag::yaml {
namespace {

using Layout = Writer::Layout;

TEST(YamlWriter, MapsAndListsInLinesAndOnOne) {
  Writer out;
  out.begin_map();
  out.write("name", "x");
  out.text("parts");
  out.begin_list();
  out.begin_map(Layout::OneLine);
  out.write("count", std::uint64_t{3});
  out.text("after");
  out.begin_list();
  out.text("a");
  out.text("b");
  out.end_list();
  out.end_map();
  out.begin_map();
  out.write("host", "y");
  out.text("none");
  out.begin_list();
  out.end_list();
  out.end_map();
  out.end_list();
  out.end_map();
  EXPECT_EQ(out.take(), "name: x\nparts:\n  - {count: 3, after: [a, b]}\n  - host: y\n    none: []\n");
}

TEST(YamlWriter, OneLineHasNoLimit) {
  Writer out;
  out.begin_list(Layout::OneLine);
  for (int i = 0; i < 200; ++i) out.text("two words");
  out.end_list();
  const std::string text = out.take();
  EXPECT_EQ(text.find('\n'), text.size() - 1);
}

std::string written(std::string_view text) {
  Writer out;
  out.begin_list(Layout::OneLine);
  out.text(text);
  out.quoted(text);
  out.end_list();
  return out.take();
}

TEST(YamlWriter, QuotesWhatWouldBeReadAsSomethingElse) {
  EXPECT_EQ(written("/a"), "[/a, \"/a\"]\n");
  EXPECT_EQ(written("caf\xC3\xA9"), "[caf\xC3\xA9, \"caf\xC3\xA9\"]\n");
  for (const char *null : {"", "~", "null", "Null", "NULL"}) {
    EXPECT_EQ(written(null), "[\"" + std::string(null) + "\", \"" + null + "\"]\n");
  }
  for (const char *special : {"a #b", "a: b", "a:", "- a", "-",  ": a", " a", "a ",  "#a",  "&a", "a&b", "*a",
                              "!a",   "|",    ">",  "%a",  "@a", "`a",  "'a", "---", "...", "a?", "a]",  "a}"}) {
    EXPECT_EQ(written(special), "[\"" + std::string(special) + "\", \"" + special + "\"]\n");
  }
  for (const char *plain : {"a#b", "a:b", "-a", "a - b", "a'b", "a\"b", "a*", "a!", "a|b", "5ms", "-1"}) {
    EXPECT_EQ(written(plain).substr(0, 2 + std::string_view(plain).size()), "[" + std::string(plain) + ",");
  }
  EXPECT_EQ(written("a, b"), "[\"a, b\", \"a, b\"]\n");
}

TEST(YamlWriter, BytesThatAreNotUtf8AreReplaced) {
  EXPECT_EQ(written("a\xFFz\xC3"), "[\"a\xEF\xBF\xBDz\xEF\xBF\xBD\", \"a\xEF\xBF\xBDz\xEF\xBF\xBD\"]\n");
}

/// Any mixture of what YAML gives a meaning.
std::string arbitrary_text() {
  const auto parts = *rc::gen::container<std::vector<std::string>>(rc::gen::element<std::string>(
      "a", "b", " ", "  ", "\n", "\r", "\t", ":", ": ", "#", " #", "-", "- ", "?", "? ", ",", "[", "]", "{", "}", "&",
      "*", "!", "|", ">", "'", "\"", "\\", "%", "%TAG", "@", "`", "~", "null", "---", "...", "=", "<<", "1", "\x01",
      "\x7F", "\xC2\x85", "\xE2\x80\xA8", "\xE2\x80\xA9", "\xEF\xBB\xBF", "\xEF\xBF\xBE", "\xC3\xA9",
      "\xF0\x9F\xA4\x96"));
  std::string text;
  for (const std::string &part : parts) text += part;
  return text;
}

/// Maps, lists and texts in each other, `levels` deep at most.
Node arbitrary_node(int levels) {
  Node node;
  node.kind = *rc::gen::element(Node::Kind::Scalar, Node::Kind::Sequence, Node::Kind::Map);
  if (levels == 0) node.kind = Node::Kind::Scalar;
  if (node.kind == Node::Kind::Scalar) {
    node.text = arbitrary_text();
    return node;
  }
  const auto parts = *rc::gen::inRange(0, 4);
  for (int i = 0; i < parts; ++i) {
    if (node.kind == Node::Kind::Map) node.children.push_back(arbitrary_node(0));
    node.children.push_back(arbitrary_node(levels - 1));
  }
  return node;
}

void write(Writer &out, const Node &node) {
  const auto layout = *rc::gen::element(Layout::Lines, Layout::OneLine);
  switch (node.kind) {
    case Node::Kind::Null:
    case Node::Kind::Scalar: *rc::gen::arbitrary<bool>() ? out.quoted(node.text) : out.text(node.text); return;
    case Node::Kind::Sequence:
      out.begin_list(layout);
      for (const Node &child : node.children) write(out, child);
      out.end_list();
      return;
    case Node::Kind::Map:
      out.begin_map(layout);
      for (const Node &child : node.children) write(out, child);
      out.end_map();
      return;
  }
}

bool same(const Node &a, const Node &b) {
  return a.kind == b.kind && a.text == b.text &&
         std::equal(a.children.begin(), a.children.end(), b.children.begin(), b.children.end(), same);
}

RC_GTEST_PROP(YamlWriter, EveryTreeIsReadAsItWas, ()) {
  const Node tree = arbitrary_node(*rc::gen::inRange(0, 5));
  Writer out;
  write(out, tree);
  const std::string text = out.take();
  const Result<Node> root = parse(text, "x.yaml");
  if (!root) RC_FAIL(to_string(root.error()) + "\n" + text);
  if (!same(*root, tree)) RC_FAIL(text);
}

}  // namespace
}  // namespace redag::yaml
