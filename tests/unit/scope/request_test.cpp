// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/request.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "physics/problem.h"

namespace stickslip::scope {
namespace {

using testing::HasSubstr;

TEST(ListenAddress, IsANumericAddressAndAPort) {
  EXPECT_EQ(parse_listen_address("127.0.0.1:8088"), (ListenAddress{"127.0.0.1", 8088}));
  EXPECT_EQ(parse_listen_address("0.0.0.0:0"), (ListenAddress{"0.0.0.0", 0}));
  EXPECT_EQ(parse_listen_address("[::1]:65535"), (ListenAddress{"::1", 65535}));
  EXPECT_EQ(text_of({"::1", 80}), "[::1]:80");
  EXPECT_EQ(text_of({"127.0.0.1", 80}), "127.0.0.1:80");
}

TEST(ListenAddress, RejectsOtherTextWithAnExample) {
  for (const char* text : {"", "8088", ":8088", "localhost:8088", "127.0.0.1", "127.0.0.1:",
                           "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:80 ", "127.1:80", "::1:80",
                           "[::1]", "[127.0.0.1]:80", "[::1:80", "127.0.0.1:0x50"}) {
    try {
      parse_listen_address(text);
      ADD_FAILURE() << text << " was accepted";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("for example 127.0.0.1:8088")) << text;
    }
  }
}

TEST(Addresses, AreLoopbackOrNot) {
  EXPECT_TRUE(is_loopback("127.0.0.1"));
  EXPECT_TRUE(is_loopback("127.3.2.1"));
  EXPECT_TRUE(is_loopback("::1"));
  EXPECT_TRUE(is_loopback("::ffff:127.0.0.1"));
  for (const char* address :
       {"0.0.0.0", "::", "10.0.0.1", "128.0.0.1", "::2", "fe80::1", "x", ""}) {
    EXPECT_FALSE(is_loopback(address)) << address;
  }
  EXPECT_TRUE(is_every_address("0.0.0.0"));
  EXPECT_TRUE(is_every_address("::"));
  EXPECT_FALSE(is_every_address("127.0.0.1"));
}

TEST(Host, IsParsedStrictly) {
  EXPECT_EQ(parse_host("Rig.Lab:80")->host, "rig.lab");
  EXPECT_EQ(parse_host("Rig.Lab:80")->port, "80");
  EXPECT_EQ(parse_host("[::1]:80")->host, "::1");
  for (const char* header :
       {"", ":80", "a b", "rig.lab:", "rig.lab:x", "rig.lab:99999", "rig.lab:80:80", "a/b", "a@b",
        "[::1", "[]", "[::1]80", "[g::1]", "rig.lab\r\nX: y", "<script>"}) {
    EXPECT_FALSE(parse_host(header)) << header;
  }
}

TEST(Host, OnlyOwnNamesAreAllowed) {
  Admission admission;
  admission.host_names = {"Rig.lab"};
  for (const char* host : {"localhost", "localhost:9000", "LOCALHOST", "127.0.0.1:8088",
                           "127.9.9.9", "[::1]:1", "rig.lab", "RIG.LAB:443"}) {
    EXPECT_TRUE(is_host_allowed(host, admission)) << host;
  }
  for (const char* host :
       {"", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "rig.lab.evil",
        "xrig.lab", "10.0.0.1", "0.0.0.0", "localhost,evil", "2130706433", "0x7f.1"}) {
    EXPECT_FALSE(is_host_allowed(host, admission)) << host;
  }
}

TEST(Host, TheListenAddressIsAllowed) {
  Admission admission;
  admission.listen_address = "10.0.0.1";
  EXPECT_TRUE(is_host_allowed("10.0.0.1:8088", admission));
  EXPECT_FALSE(is_host_allowed("10.0.0.2:8088", admission));
  admission.listen_address = "0.0.0.0";
  EXPECT_TRUE(is_host_allowed("10.0.0.2:8088", admission));
  EXPECT_FALSE(is_host_allowed("evil.example", admission)) << "DNS rebinding";
}

TEST(Origin, IsThePagesOwnOrAllowed) {
  Admission admission;
  admission.allowed_origins = {"https://notes.lab"};
  EXPECT_TRUE(is_origin_allowed("", "localhost:8088", admission)) << "no browser";
  EXPECT_TRUE(is_origin_allowed("http://localhost:8088", "localhost:8088", admission));
  EXPECT_TRUE(is_origin_allowed("https://RIG.lab", "rig.lab", admission)) << "behind TLS";
  EXPECT_TRUE(is_origin_allowed("https://notes.lab", "localhost:8088", admission));
  for (const char* origin :
       {"null", "http://evil.example", "http://localhost:8089", "http://localhost",
        "http://localhost:8088.evil.example", "http://localhost:8088@evil.example",
        "file://localhost:8088", "http://notes.lab", "https://notes.lab.evil", "http://"}) {
    EXPECT_FALSE(is_origin_allowed(origin, "localhost:8088", admission)) << origin;
  }
  EXPECT_FALSE(is_origin_allowed("http://", "", admission));
}

TEST(Secret, IsComparedCompletely) {
  EXPECT_TRUE(is_same_secret("abc", "abc"));
  EXPECT_TRUE(is_same_secret("", ""));
  for (const char* given : {"", "a", "ab", "abd", "abcabc", "abc ", "ABC"}) {
    EXPECT_FALSE(is_same_secret(given, "abc")) << given;
  }
}

Request good() { return {"GET", "/stream", "localhost:8088", "http://localhost:8088", ""}; }

TEST(Stream, IsOpenedByAGoodRequestOnly) {
  const Admission admission;
  EXPECT_FALSE(refuse_stream(good(), admission));
  Request request = good();
  request.method = "POST";
  EXPECT_EQ(refuse_stream(request, admission)->status, 405);
  request = good();
  request.path = "/streams";
  EXPECT_EQ(refuse_stream(request, admission)->status, 404);
  request = good();
  request.host = "evil.example";
  EXPECT_EQ(refuse_stream(request, admission)->status, 403);
  request = good();
  request.origin = "http://evil.example";
  EXPECT_THAT(refuse_stream(request, admission)->reason, HasSubstr("--allow-origin"));
}

TEST(Token, IsRequiredForPageAndStreamButNotForStaticFiles) {
  Admission admission;
  admission.token = "s3cret";
  Request request = good();
  EXPECT_THAT(refuse_stream(request, admission)->reason, HasSubstr("token"));
  request.token = "S3cret";
  EXPECT_TRUE(refuse_stream(request, admission));
  request.token = "s3cret";
  EXPECT_FALSE(refuse_stream(request, admission));
  request.path = "/";
  EXPECT_FALSE(refuse_page(request, admission));
  request.token = "";
  EXPECT_EQ(refuse_page(request, admission)->status, 403);
  request.path = "/index.html";
  EXPECT_EQ(refuse_page(request, admission)->status, 403);
  request.path = "/scope.js";
  EXPECT_FALSE(refuse_page(request, admission));
}

TEST(Page, IsForGetAndHeadOfItsOwnHost) {
  const Admission admission;
  EXPECT_FALSE(refuse_page({"HEAD", "/", "localhost", "", ""}, admission));
  EXPECT_EQ(refuse_page({"POST", "/", "localhost", "", ""}, admission)->status, 405);
  EXPECT_EQ(refuse_page({"", "/", "localhost", "", ""}, admission)->status, 405);
  const auto refusal = refuse_page({"GET", "/", "<b>evil</b>", "", ""}, admission);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->reason.find('<'), std::string::npos) << "input is not echoed";
}

TEST(TokenWord, NeedsNoEscapingInAUrl) {
  EXPECT_TRUE(is_token("aB3-._~"));
  for (const char* word : {"", "a b", "a&b", "a%20", "a/b", "a?b", "\xc3\xa9"}) {
    EXPECT_FALSE(is_token(word)) << word;
  }
}

}  // namespace
}  // namespace stickslip::scope
