// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The tables of docs/workload_format.md and the parts of docs/workload.schema.json are made from the rows of
// fields.hpp. REDAG_UPDATE_DOCS=1 redag_workload_test --gtest_filter='DocumentedFields.*' writes them anew.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "redag/loader/fields.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "tests/testing/repository.hpp"

namespace redag {
namespace {

using Json = nlohmann::ordered_json;

std::string text_of(const char *name) {
  std::ostringstream text;
  text << std::ifstream(testing::repository() / "docs" / name).rdbuf();
  return text.str();
}

/// The file in docs/ is as it would be made today.
void expect_current(const char *name, const std::string &made) {
  if (std::getenv("REDAG_UPDATE_DOCS") != nullptr) std::ofstream(testing::repository() / "docs" / name) << made;
  EXPECT_EQ(text_of(name), made) << "REDAG_UPDATE_DOCS=1 writes docs/" << name << " anew";
}

bool is_required(const char *absent) { return absent != nullptr && std::string_view(absent) == "required"; }

template <class Enum>
std::vector<std::string> names() {
  std::vector<std::string> names;
  for (const Named<Enum> &named : kValues<Enum>) names.emplace_back(named.name);
  return names;
}

/// The type of a field's member.
template <class Owner, class T>
T type_of(T Owner::*member);
template <class T>
T type_of(T nothing);

template <class Owner, class Member>
std::string default_of(const fields::Row<Member> &row) {
  using T = decltype(type_of(row.member));
  if (row.absent != nullptr) return row.absent;
  if constexpr (std::is_enum_v<T>) return fmt::format("`{}`", to_string(Owner{}.*row.member));
  if constexpr (std::is_integral_v<T>) return std::to_string(Owner{}.*row.member);
  ADD_FAILURE() << row.key << " does not say what a file without it means";
  return {};
}

/// The value as the page describes it: its text, with the names or the range that the text leaves out.
template <class Member>
std::string value_of(const fields::Row<Member> &row) {
  using T = decltype(type_of(row.member));
  std::string text = row.text;
  if constexpr (std::is_enum_v<T>) {
    std::string all;
    for (const std::string &name : names<T>()) all += (all.empty() ? "`" : ", `") + name + "`";
    if (text.find('`' + names<T>()[0] + "`") == std::string::npos) text = all + ": " + text;
  }
  if constexpr (std::is_same_v<T, std::uint32_t> || std::is_same_v<T, std::optional<int>>) {
    text += fmt::format("; {} to {}", row.rule.least, row.rule.most);
  }
  return text;
}

template <class Owner, class Member>
std::string line_of(const fields::Row<Member> &row, const std::string &prefix) {
  return fmt::format("| `{}{}` | {} | {} |\n", prefix, row.key, value_of(row), default_of<Owner>(row));
}

template <class Owner, class Rows>
std::string lines_of(const Rows &rows, const std::string &prefix = "") {
  std::string lines;
  fields::for_each(rows, [&](const auto &row) {
    const bool is_platform = row.field == Field::Platform;
    lines += is_platform ? lines_of<Platform>(fields::kPlatform, "platform.") : line_of<Owner>(row, prefix);
  });
  return lines;
}

/// Replaces the lines of the first table below a heading.
void replace_table(std::string &page, const std::string &heading, const std::string &lines) {
  constexpr std::string_view kRule = "\n|---|---|---|\n";
  const std::size_t section = page.find("\n" + heading + "\n");
  ASSERT_NE(section, std::string::npos) << heading;
  const std::size_t begin = page.find(kRule, section) + kRule.size();
  page.replace(begin, page.find("\n\n", begin) + 1 - begin, lines);
}

TEST(DocumentedFields, AreThoseOfThePage) {
  std::string page = text_of("workload_format.md");
  replace_table(page, "## The file", lines_of<Workload>(fields::kWorkload));
  replace_table(page, "## A cluster", lines_of<Cluster>(fields::kCluster));
  replace_table(page, "### Devices and segments", lines_of<Device>(fields::kDevice));
  replace_table(page, "## A DAG", lines_of<Dag>(fields::kDag));
  replace_table(page, "## A task", lines_of<Task>(fields::kTask));
  expect_current("workload_format.md", page);
}

Json reference(const std::string &definition) { return {{"$ref", "#/definitions/" + definition}}; }

/// The value of a field for editors. What its type does not say is a definition of its own.
template <class Member>
Json schema_of(const fields::Row<Member> &row, const std::string &definition) {
  using T = decltype(type_of(row.member));
  const fields::Rule &rule = row.rule;
  if (row.field == Field::Offset) return {{"anyOf", {reference("duration"), {{"const", kAnyOffset}}}}};
  if (row.field == Field::Group) return reference(definition);
  if constexpr (std::is_same_v<T, std::string>) return reference("name");
  if constexpr (std::is_same_v<T, Duration>) return reference(rule.least > 0 ? "positiveDuration" : "duration");
  if constexpr (std::is_same_v<T, std::uint32_t> || std::is_same_v<T, std::optional<int>>) {
    return {{"type", "integer"}, {"minimum", rule.least}, {"maximum", rule.most}};
  }
  if constexpr (std::is_enum_v<T>) return {{"enum", names<T>()}};
  return reference(definition);
}

/// A text of the page as plain text.
std::string plain(std::string text) {
  text = std::regex_replace(text, std::regex(R"( \(\[below\]\([^)]*\)\))"), "");
  text = std::regex_replace(text, std::regex(R"(\[([^\]]*)\]\([^)]*\))"), "$1");
  return std::regex_replace(text, std::regex("`"), "");
}

/// Gives the object `part` the properties and the required keys of a table.
template <class Owner, class Rows>
void fill(Json &part, const Rows &rows) {
  Json properties = Json::object();
  Json required = Json::array();
  fields::for_each(rows, [&](const auto &row) {
    if (is_required(row.absent)) required.push_back(row.key);
    Json &value = properties[row.key] = schema_of(row, row.key);
    std::string text = plain(row.text);
    if (!is_required(row.absent) && row.absent != nullptr) text += "; default: " + plain(row.absent);
    value["description"] = text;
    using T = decltype(type_of(row.member));
    if constexpr (std::is_enum_v<T>) {
      if (row.absent == nullptr) value["default"] = to_string(Owner{}.*row.member);
    }
  });
  if (!required.empty()) part["required"] = required;
  part["properties"] = properties;
}

/// Formats JSON with each object and list on one line that fits on it.
std::string formatted(const Json &json, std::size_t indentation, bool on_one_line) {
  if (!json.is_structured()) return json.dump();
  const std::string margin = on_one_line ? " " : "\n" + std::string(indentation + 2, ' ');
  std::string text;
  for (const auto &[key, value] : json.items()) {
    if (!text.empty()) text += ',' + margin;
    if (json.is_object()) text += Json(key).dump() + ": ";
    const std::string short_form = formatted(value, 0, true);
    const bool fits = on_one_line || indentation + key.size() + short_form.size() < 110;
    text += fits ? short_form : formatted(value, indentation + 2, false);
  }
  if (!on_one_line) text = margin + text + '\n' + std::string(indentation, ' ');
  return json.is_object() ? '{' + text + '}' : '[' + text + ']';
}

TEST(DocumentedFields, AreThoseOfTheSchema) {
  Json json = Json::parse(text_of("workload.schema.json"));
  Json &parts = json.at("definitions");
  fill<Workload>(json, fields::kWorkload);
  fill<Platform>(parts.at("platform"), fields::kPlatform);
  fill<Cluster>(parts.at("cluster"), fields::kCluster);
  fill<Device>(parts.at("device"), fields::kDevice);
  fill<Dag>(parts.at("dag"), fields::kDag);
  fill<Task>(parts.at("task"), fields::kTask);
  expect_current("workload.schema.json", formatted(json, 0, false) + '\n');
}

/// What types of their own allow, which the schema states by hand.
TEST(DocumentedFields, HaveTheReadersLimits) {
  const Json json = Json::parse(text_of("workload.schema.json"));
  const Json &parts = json.at("definitions");
  for (const std::string &kind : names<Callback::Kind>()) {
    EXPECT_TRUE(parts.at("callback").at("properties").contains(kind));
  }
  EXPECT_EQ(parts.at("clusters").at("maxItems"), kMaxClusters);
  EXPECT_EQ(parts.at("devices").at("maxProperties"), kMaxDevices);
  EXPECT_EQ(parts.at("name").at("maxLength"), kMaxNameBytes);
  EXPECT_EQ(parts.at("segments").at("maxItems"), 2 * kMaxWaits + 1);
  EXPECT_EQ(parts.at("overrun").at("anyOf").at(1).at("properties").at("queue").at("maximum"), kMaxQueueDepth);
}

}  // namespace
}  // namespace redag
