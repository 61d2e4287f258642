// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/serve/access.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <string>

namespace redag::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

TEST(Access, TokensAreLongAndDiffer) {
  const Result<std::string> first = make_token();
  const Result<std::string> second = make_token();
  ASSERT_TRUE(first && second);
  EXPECT_THAT(*first, MatchesRegex("[0-9a-f]{64}"));
  EXPECT_NE(*first, *second);
}

TEST(Access, ATokenIsReadFromAFileThatFewMayRead) {
  const std::string path = ::testing::TempDir() + "token";
  const auto read = [&](const std::string &content, ::mode_t mode) {
    (void)::unlink(path.c_str());
    std::ofstream(path) << content;
    EXPECT_EQ(::chmod(path.c_str(), mode), 0);
    const Result<std::string> token = read_token(path);
    return token ? *token : to_string(token.error());
  };
  const std::string good(32, 'a');
  EXPECT_EQ(read(good + "\n", 0600), good);
  EXPECT_EQ(read(good, 0640), good);
  EXPECT_THAT(read(good, 0604), HasSubstr("every user of this machine can read the token"));
  for (const std::string &bad : {std::string(), std::string(31, 'a'), std::string(257, 'a'), good + "&x=1"}) {
    EXPECT_THAT(read(bad, 0600), HasSubstr(path + ":1: a token has 32 to 256 letters and digits")) << bad;
  }
  EXPECT_FALSE(read_token(path + ".none"));
  EXPECT_FALSE(read_token(::testing::TempDir()));
}

TEST(Access, SecretsAreComparedAsAWhole) {
  EXPECT_TRUE(is_same_secret("abc", "abc"));
  for (const char *other : {"", "ab", "abcd", "abd", "xbc", "ABC"}) EXPECT_FALSE(is_same_secret(other, "abc")) << other;
  EXPECT_FALSE(is_same_secret("", "")) << "no secret is no permission";
}

TEST(Access, CookiesAreFoundByTheirWholeName) {
  const std::string header = "other=1; redag-80=two;redag-8=three; xredag-8=four; redag-8x=five";
  EXPECT_EQ(cookie_value(header, "redag-8"), "three");
  EXPECT_EQ(cookie_value(header, "redag-80"), "two");
  EXPECT_EQ(cookie_value(header, "other"), "1");
  EXPECT_EQ(cookie_value(header, "redag"), "");
  EXPECT_EQ(cookie_value("", "redag"), "");
  EXPECT_EQ(cookie_value("redag-8", "redag-8"), "");
  EXPECT_EQ(cookie_value(";;; ;", "redag-8"), "");
}

class Judged : public ::testing::Test {
 protected:
  Credentials request_ = {.method = "GET", .path = "/live.js", .hosts = 1, .host = "127.0.0.1:8642"};
  Gate gate_{"secret", 8642};

  [[nodiscard]] Access judged() const { return gate_.judge(request_); }
};

TEST_F(Judged, ATokenOpensOnlyThePageItself) {
  EXPECT_EQ(judged(), Access::Denied);
  request_.token = "secret";
  EXPECT_EQ(judged(), Access::Denied) << "tokens belong into no other address";
  request_.path = "/";
  EXPECT_EQ(judged(), Access::Introduced);
  request_.token = "Secret";
  EXPECT_EQ(judged(), Access::Denied);
  request_.token = "";
  EXPECT_EQ(judged(), Access::Denied);
}

TEST_F(Judged, ACookieOrAHeaderOpensAll) {
  request_.cookie = "a=b; redag-8642=secret";
  EXPECT_EQ(judged(), Access::Granted);
  request_.cookie = "redag-8643=secret";
  EXPECT_EQ(judged(), Access::Denied) << "of another server";
  request_.cookie = "redag-8642=secret2";
  EXPECT_EQ(judged(), Access::Denied);
  request_.authorization = "Bearer secret";
  EXPECT_EQ(judged(), Access::Granted);
  request_.authorization = "Basic secret";
  EXPECT_EQ(judged(), Access::Denied);
}

TEST_F(Judged, NothingCanBeChanged) {
  request_.cookie = "redag-8642=secret";
  for (const char *method : {"POST", "PUT", "DELETE", "PATCH", "OPTIONS", "CONNECT", "TRACE", "get", ""}) {
    request_.method = method;
    EXPECT_EQ(judged(), Access::WrongMethod) << method;
  }
  request_.method = "HEAD";
  EXPECT_EQ(judged(), Access::Granted);
}

// A page of another site can have its name point to 127.0.0.1. Its requests then name that site.
TEST_F(Judged, OnlyItsOwnNamesAreAnswered) {
  request_.cookie = "redag-8642=secret";
  request_.host = "localhost:8642";
  EXPECT_EQ(judged(), Access::Granted);
  for (const char *host :
       {"", "127.0.0.1", "localhost", "127.0.0.1:80", "evil.example:8642", "127.0.0.1:8642.evil.example",
        "evil127.0.0.1:8642", "localhost.:8642", "0.0.0.0:8642", "[::1]:8642"}) {
    request_.host = host;
    EXPECT_EQ(judged(), Access::WrongHost) << host;
  }
  request_.host = "127.0.0.1:8642";
  request_.hosts = 2;
  EXPECT_EQ(judged(), Access::WrongHost);
  request_.hosts = 0;
  EXPECT_EQ(judged(), Access::WrongHost);
}

TEST(Access, TheCookieIsForThisServersPagesOnly) {
  const std::string cookie = Gate("secret", 99).cookie();
  EXPECT_THAT(cookie, HasSubstr("redag-99=secret;"));
  EXPECT_THAT(cookie, HasSubstr("HttpOnly"));
  EXPECT_THAT(cookie, HasSubstr("SameSite=Strict"));
}

}  // namespace
}  // namespace redag::cli
