// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The reader, docs/workload.schema.json and docs/workload_format.md state the same keys, names and limits.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "redag/loader/workload_yaml.hpp"
#include "tests/testing/repository.hpp"

namespace redag {
namespace {

using Json = nlohmann::json;
using Keys = std::set<std::string>;

std::string text_of(const char *name) {
  std::ostringstream text;
  text << std::ifstream(testing::repository() / "docs" / name).rdbuf();
  return text.str();
}

Json schema() { return Json::parse(text_of("workload.schema.json")); }

Keys keys_of(const Json &object) {
  Keys keys;
  for (const auto &[key, value] : object.at("properties").items()) keys.insert(key);
  return keys;
}

/// Returns the keys in the table below a heading of the page, without `prefix`.
Keys documented(const std::string &heading, const std::string &prefix = "") {
  const std::string page = text_of("workload_format.md");
  const std::size_t begin = page.find(heading + "\n");
  EXPECT_NE(begin, std::string::npos) << heading;
  const std::string section = page.substr(begin, page.find("\n#", begin + 1) - begin);
  const std::regex row("\n\\| `" + prefix + "([a-z_]+)` \\|");
  Keys keys;
  for (std::sregex_iterator at(section.begin(), section.end(), row); at != std::sregex_iterator(); ++at) {
    keys.insert((*at)[1].str());
  }
  return keys;
}

/// Returns the keys that the reader knows in a map. `{}` in `file` is replaced by a key and a value.
Keys known(const std::string &file) {
  Keys keys;
  for (std::size_t i = 0; i < kFieldCount; ++i) {
    const std::string key = to_string(static_cast<Field>(i));
    std::string text = file;
    text.replace(text.find("{}"), 2, key + ": {x: x}");
    const Result<LoadedWorkload> read = parse_workload(text, "w.yaml");
    EXPECT_FALSE(read) << key;
    if (to_string(read.error()).find("unknown key '" + key + "'") == std::string::npos) keys.insert(key);
  }
  return keys;
}

TEST(DocumentedFields, AreThoseOfTheReader) {
  const Json json = schema();
  const Json &parts = json.at("definitions");
  EXPECT_EQ(keys_of(json), known("{}\n"));
  EXPECT_EQ(keys_of(json.at("properties").at("platform")), known("platform:\n  {}\ndags: 1\n"));
  EXPECT_EQ(keys_of(parts.at("cluster")), known("platform:\n  clusters:\n    - {}\ndags: 1\n"));
  EXPECT_EQ(keys_of(parts.at("dag")), known("dags:\n  - {}\n"));
  EXPECT_EQ(keys_of(parts.at("task")), known("dags:\n  - name: d\n    tasks:\n      - {}\n"));
}

TEST(DocumentedFields, AreThoseOfThePage) {
  const Json json = schema();
  const Json &parts = json.at("definitions");
  EXPECT_EQ(keys_of(json.at("properties").at("platform")), documented("## The file", "platform\\."));
  EXPECT_EQ(keys_of(parts.at("cluster")), documented("## A cluster"));
  EXPECT_EQ(keys_of(parts.at("device")), documented("### Devices and segments"));
  EXPECT_EQ(keys_of(parts.at("dag")), documented("## A DAG"));
  EXPECT_EQ(keys_of(parts.at("task")), documented("## A task"));
}

template <class Enum>
std::vector<std::string> names() {
  std::vector<std::string> names;
  for (const Named<Enum> &named : kValues<Enum>) names.emplace_back(named.name);
  return names;
}

TEST(DocumentedFields, HaveTheReadersNamesAndLimits) {
  const Json json = schema();
  const Json &parts = json.at("definitions");
  const Json &top = json.at("properties");
  const Json &platform = top.at("platform").at("properties");
  const Json &task = parts.at("task").at("properties");
  EXPECT_EQ(top.at("policy").at("enum"), names<PolicyKind>());
  EXPECT_EQ(top.at("ties").at("enum"), names<Ties>());
  EXPECT_EQ(platform.at("preemption").at("enum"), names<PreemptionMode>());
  EXPECT_EQ(parts.at("criticality").at("enum"), names<Criticality>());
  EXPECT_EQ(parts.at("dag").at("properties").at("edges").at("enum"), names<Edges>());
  EXPECT_EQ(parts.at("device").at("properties").at("queue").at("enum"), names<Device::Queue>());
  EXPECT_EQ(task.at("on_budget").at("enum"), names<OnBudget>());
  for (const std::string &kind : names<Callback::Kind>()) EXPECT_TRUE(keys_of(parts.at("callback")).contains(kind));
  EXPECT_EQ(platform.at("workers").at("maximum"), kMaxWorkers);
  EXPECT_EQ(platform.at("clusters").at("maxItems"), kMaxClusters);
  EXPECT_EQ(platform.at("devices").at("maxProperties"), kMaxDevices);
  EXPECT_EQ(parts.at("count").at("maximum"), kMaxBound);
  EXPECT_EQ(parts.at("name").at("maxLength"), kMaxNameBytes);
  EXPECT_EQ(task.at("concurrency").at("maximum"), kMaxConcurrency);
  EXPECT_EQ(task.at("segments").at("maxItems"), 2 * kMaxWaits + 1);
}

}  // namespace
}  // namespace redag
