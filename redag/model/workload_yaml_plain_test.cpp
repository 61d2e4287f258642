// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/model/workload_yaml_plain.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "redag/base/rng.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::yaml {
namespace {

constexpr const char *kBlocks = R"(# a comment
name: blocks   # another one
platform:
  workers: 4

  preemption: os
dags:
- name: left
  tasks:
    - {name: a, wcet: 1.5ms, after: [b, c], execution: {normal: {mean: 1ms, stddev: 0}}}
    -   name: b   # in a column of its own

        wcet: 100us
        callback: {node: /nav/planner, timer: any, empty: {}, list: []}
- name: "in quotes: # , ] }"
  period: 'it: is'
  degrade: {  skip: 3  }
)";

std::string describe_tree(const Node &node) {
  std::string text = std::to_string(static_cast<int>(node.kind)) + (node.quoted ? "q" : "") + "@" +
                     std::to_string(node.line) + ":" + std::to_string(node.column) + "'" + node.text + "'(";
  for (const Node &child : node.children) text += describe_tree(child) + " ";
  return text + ")";
}

// What is plain is read as yaml-cpp reads it. Returns true if the text is plain.
bool is_plain_and_the_same(const std::string &text) {
  const std::optional<Node> plain = parse_plain(text);
  if (!plain) return false;
  const Result<Node> any = parse_any(text, "test.yaml");
  EXPECT_TRUE(any) << text << "\n" << to_string(any.error());
  EXPECT_EQ(describe_tree(*plain), describe_tree(any.value_or(Node{}))) << text;
  return true;
}

TEST(PlainYaml, ReadsWhatWorkloadsAreWrittenIn) {
  EXPECT_TRUE(is_plain_and_the_same(kBlocks));
  for (const char *text :
       {"a: 1", "a: 1\n", "\n\n  # c\na: 1\n\n", "a:\n  b:\n    c: d\ne: f", "a:\n- b: c\n  d: e\n- f\n- [g]\nh: i",
        "a: b c  d # e", "a: -5ms", "a: +5", "a: /x*", "a: .5", "a: [1, 2 3, {b: c}]", "a: {b: [], c: {}}  # d",
        "a: \"\"", "a: 'b'", "a:   # b\n    c: d", "a: ''"}) {
    EXPECT_TRUE(is_plain_and_the_same(text)) << text;
  }
}

// Errors, values without a text, and everything unusual are for yaml-cpp.
TEST(PlainYaml, LeavesTheRestToTheParser) {
  for (const char *text : {"",
                           "\n",
                           "# c",
                           "a",
                           "- a",
                           "{a: b}",
                           "a:",
                           "a: ~",
                           "a: null",
                           "a: Null",
                           "null: a",
                           "a:\nb: c",
                           "a:\n\n",
                           "a:b",
                           "a : b",
                           " a: b",
                           "a: b\n c",
                           "a: b\n c: d",
                           "a:\n  b: c\n d: e",
                           "a: b: c",
                           "a: [b",
                           "a: {b: c",
                           "a: [b,]",
                           "a: {b: c,}",
                           "a: [b\n]",
                           "a: {b}",
                           "a: {b:c}",
                           "a: [b: c]",
                           "a: \"b",
                           "a: \"b\\n\"",
                           "a: 'b''c'",
                           "a: 'b' c",
                           "a: \" b\"",
                           "a: \"b\nc\"",
                           "a: |\n  b",
                           "a: >\n  b",
                           "a: &b c",
                           "a: *b",
                           "a: !b c",
                           "a: b#c: d",
                           "a: b\t",
                           "a:\tb",
                           "a: b\r\n",
                           "a: \x01",
                           "---\na: b",
                           "a: b\n---\nc: d",
                           "a: b\n...\n",
                           "%YAML 1.2\n---\na: b",
                           "? a\n: b",
                           "\"a\": b",
                           "a: [b]c",
                           "a: {b: c}d",
                           "a:\n- b\nc",
                           "a:\n  - b\n  c: d",
                           "a:\n- b\n - c",
                           "a: - b",
                           "a: [b]#c",
                           "a: -",
                           "a: @b",
                           "a: b?",
                           "a: {b : c}",
                           "a:\n  - - b\n",
                           "a: +.5",
                           "a: \xC2\xB5s",
                           "\xEF\xBB\xBF"
                           "a: b",
                           "a: [[[[[[[[[[[[[[[[[[b]]]]]]]]]]]]]]]]]]"}) {
    EXPECT_FALSE(is_plain_and_the_same(text)) << text;
  }
  EXPECT_FALSE(is_plain_and_the_same(std::string(200, 'k') + ": a"));
}

TEST(PlainYaml, SavedAndExampleWorkloadsArePlain) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    lab::GenerateOptions options;
    options.shape = seed % 2 == 0 ? lab::DagShape::Layered : lab::DagShape::Independent;
    options.dags = 3;
    options.utilization = 1;
    options.workers = 2;
    const Result<Workload> workload = lab::generate(options, seed);
    if (!workload) continue;
    EXPECT_TRUE(is_plain_and_the_same(to_yaml(*workload)));
  }
  for (const auto &entry : std::filesystem::directory_iterator(REDAG_SOURCE_DIR "/workloads")) {
    if (entry.path().extension() != ".yaml") continue;
    std::ostringstream text;
    text << std::ifstream(entry.path()).rdbuf();
    EXPECT_TRUE(is_plain_and_the_same(text.str())) << entry.path();
  }
}

// Texts with a few characters changed: most are still YAML of some kind.
TEST(PlainYaml, ReadsChangedTextsAsTheParserDoes) {
  const std::vector<std::string> texts = {
      kBlocks,
      "a: b\nc: [d, e]\nf:\n  - g: {h: i}\n    j: 'k'\n  - l\nm: \"n\"\n",
      "a:\n- b: c\n  d:\n    - e\n    - {f: g}\n- h\ni: j k # l\n",
  };
  constexpr std::string_view kCharacters = "  \n\n::--##,,{}[]\"'ab1.~|>&*!?%@\t\r\\/+_";
  const char *more = std::getenv("REDAG_YAML_TEXTS");
  const std::uint64_t count = more != nullptr ? std::strtoull(more, nullptr, 10) : 20'000;
  std::uint64_t plain = 0;
  for (std::uint64_t seed = 0; seed < count && !testing::Test::HasFailure(); ++seed) {
    Rng rng(mix(seed));
    std::string text = texts[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(texts.size()) - 1))];
    for (std::int64_t changes = rng.uniform(1, 4); changes > 0; --changes) {
      const auto at = static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(text.size()) - 1));
      const auto last = static_cast<std::int64_t>(kCharacters.size()) - 1;
      const char other = kCharacters[static_cast<std::size_t>(rng.uniform(0, last))];
      switch (rng.uniform(0, 2)) {
        case 0: text[at] = other; break;
        case 1: text.insert(at, 1, other); break;
        default: text.erase(at, 1); break;
      }
    }
    plain += is_plain_and_the_same(text) ? 1U : 0U;
  }
  EXPECT_GT(plain, count / 20);
}

}  // namespace
}  // namespace redag::yaml
