// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/hosts_yaml.hpp"

#include <gtest/gtest.h>

namespace redag::hosts {
namespace {

std::string refusal_of_file(std::string_view text) {
  const Result<HostList> list = parse_hosts(text, "dir/hosts.yaml");
  return list ? "accepted" : to_string(list.error());
}

TEST(HostsYaml, ReadsHostsAndLinks) {
  const Result<HostList> list = parse_hosts(
      "hosts:\n"
      "  - {name: base, result: results/base, offset: 0}\n"
      "  - {name: arm, result: /data/arm, offset: [1ms+-8us@start, 2ms+-8us@end], rate: 200ppm, uncertainty: 2us}\n"
      "  - {name: head, result: head, clock: [before.txt, after.txt]}\n"
      "links:\n"
      "  - {from: base.a.b, to: arm.c.d, transport: 500us}\n",
      "dir/hosts.yaml");
  ASSERT_TRUE(list) << to_string(list.error());
  ASSERT_EQ(list->hosts.size(), 3U);
  EXPECT_EQ(list->hosts[0].result, "dir/results/base");
  EXPECT_EQ(list->hosts[0].clock.readings, std::vector{OffsetReading{}});
  EXPECT_EQ(list->hosts[0].clock.by, "0");
  EXPECT_EQ(list->hosts[1].result, "/data/arm");
  EXPECT_EQ(list->hosts[1].clock.readings.size(), 2U);
  EXPECT_EQ(list->hosts[1].clock.rate, 200'000);
  EXPECT_EQ(list->hosts[1].clock.extra, 2'000);
  EXPECT_EQ(list->hosts[1].line, 3);
  EXPECT_EQ(list->hosts[2].clock_files, (std::vector<std::string>{"dir/before.txt", "dir/after.txt"}));
  ASSERT_EQ(list->links.size(), 1U);
  EXPECT_EQ(list->links[0].to, "arm.c.d");
  EXPECT_EQ(list->links[0].transport, 500'000);
  EXPECT_EQ(list->links[0].line, 6);
}

TEST(HostsYaml, NamesThePlaceOfAMistake) {
  EXPECT_EQ(refusal_of_file("links: []\n"),
            "dir/hosts.yaml:1:1: error: the file lists no hosts (add them under 'hosts:')");
  EXPECT_EQ(refusal_of_file("hosts:\n  - {name: a.b, result: x}\n"),
            "dir/hosts.yaml:2:12: error: the name 'a.b' of a host contains '.', which separates names");
  EXPECT_EQ(refusal_of_file("hosts:\n  - {name: a, ofset: 0, result: x}\n")
                .rfind("dir/hosts.yaml:2:15: error: unknown key 'ofset'", 0),
            0U);
  EXPECT_EQ(refusal_of_file("hosts:\n  - {name: a}\n"),
            "dir/hosts.yaml:2:5: error: a host has no result (add 'result:')");
  EXPECT_EQ(refusal_of_file("hosts:\n  - {name: a, result: x, offset: 1ms+--5us}\n")
                .rfind("dir/hosts.yaml:2:34: error: the uncertainty in", 0),
            0U);
  EXPECT_EQ(refusal_of_file("hosts:\n  - {name: a, result: x, rate: 10}\n")
                .rfind("dir/hosts.yaml:2:32: error: '10' is no bound", 0),
            0U);
  EXPECT_EQ(
      refusal_of_file("hosts:\n  - {name: a, result: x, uncertainty: -5us}\n").rfind("dir/hosts.yaml:2:39: error:", 0),
      0U);
  EXPECT_EQ(refusal_of_file("hosts: []\nlinks:\n  - {from: a.b.c, to: d.e.f}\n")
                .rfind("dir/hosts.yaml:3:5: error: the link has no 'transport'", 0),
            0U);
}

}  // namespace
}  // namespace redag::hosts
