// SPDX-License-Identifier: Apache-2.0
// Outputs of a command: never an input, never a file of others, old content until the new is whole.
#include "tools/files/outputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/xattr.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "config/same_file.h"
#include "physics/problem.h"
#include "tools/files/read_file.h"
#include "tools/files/write_file.h"

namespace stickslip::files {
namespace {

namespace fs = std::filesystem;

class OutputsTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "stickslip-outputs-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    write_file(path("t.csv"), "input");
  }
  void TearDown() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::size_t file_count() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  Outputs outputs(bool force = false) const {
    return {"stickslip diagnose", {path("t.csv"), path("missing")}, force};
  }

  bool has_attributes() const {
    return setxattr(path("t.csv").c_str(), "user.stickslip.test", "", 0, 0) == 0;
  }

  fs::path folder_;
};

TEST_F(OutputsTest, AnInputIsNotAnOutputByWhateverPath) {
  fs::create_directory(folder_ / "sub");
  fs::create_symlink(folder_, folder_ / "sub/up");
  fs::create_symlink("t.csv", folder_ / "symlink");
  fs::create_hard_link(folder_ / "t.csv", folder_ / "hardlink");
  for (const char* name : {"t.csv", "./t.csv", "sub/../t.csv", "sub/up/t.csv", "symlink",
                           "hardlink", "missing", "sub/up/missing"}) {
    for (const bool force : {false, true}) {
      EXPECT_THROW(outputs(force).check(path(name)), InputError) << name;
      EXPECT_THROW(outputs(force).write(path(name), Form::json, "{\n}"), InputError) << name;
    }
  }
  EXPECT_EQ(content_of(path("t.csv")), "input");
  EXPECT_FALSE(fs::exists(path("missing")));
}

TEST_F(OutputsTest, WhatAConfigurationNamesIsAnInput) {
  write_file(path("rig.toml"),
             "[rig]\nname = \"r\"\nmodel = \"m.toml\"\n[driver]\nkind = \"bench\"\n"
             "faults = \"faults.toml\"\n[calibration]\nfile = \"c.toml\"\n"
             "[recording]\nenabled = true\nfile = \"run.log\"\n[[modbus]]\nmap = \"map.toml\"\n");
  const Outputs ours("stickslip figures", {path("rig.toml")}, true);
  for (const std::string name : {"rig.toml", "m.toml", "faults.toml", "c.toml", "map.toml"}) {
    if (name != "rig.toml") write_file(path(name), "schema = 1\n");
    fs::create_hard_link(folder_ / name, folder_ / ("link-to-" + name));
    EXPECT_THROW(ours.check(path(name)), InputError) << name;
    EXPECT_THROW(ours.check(path("link-to-" + name)), InputError) << name;
  }
  EXPECT_NO_THROW(ours.check(path("run.log"))) << "which the daemon writes";
}

TEST_F(OutputsTest, ADanglingLinkToAnotherNameIsTheSameFile) {
  fs::create_symlink("missing", folder_ / "dangling");
  EXPECT_TRUE(config::is_same_file(path("dangling"), path("missing")));
  EXPECT_FALSE(config::is_same_file(path("dangling"), path("other")));
  EXPECT_FALSE(config::is_same_file(path("t.csv"), path("other")));
  outputs().write(path("dangling2"), Form::plain, "x");
}

TEST_F(OutputsTest, AnEarlierResultIsReplacedAndNothingElse) {
  for (const Form form : {Form::toml, Form::json, Form::html}) {
    const std::string file = path("result" + std::to_string(static_cast<int>(form)));
    outputs().write(file, form, "{\n  \"first\": 1\n}");
    outputs().write(file, form, "{\n  \"second\": 2\n}");
    EXPECT_THAT(content_of(file), testing::HasSubstr("second"));
    const Outputs other("stickslip evaluate", {}, false);
    EXPECT_THROW(other.write(file, form, "{\n}"), InputError) << "the result of another command";
  }
  write_file(path("mine"), "by hand");
  EXPECT_THROW(outputs().check(path("mine")), InputError);
  EXPECT_THROW(outputs().write(path("mine"), Form::json, "{\n}"), InputError);
  EXPECT_EQ(content_of(path("mine")), "by hand");
  outputs(true).write(path("mine"), Form::plain, "forced");
  EXPECT_EQ(content_of(path("mine")), "forced");
}

TEST_F(OutputsTest, AFormWithoutRoomForANameHasItAsAnAttribute) {
  if (!has_attributes()) GTEST_SKIP() << "the file system has no extended attributes";
  outputs().write(path("table"), Form::plain, "a,b\n1,2\n");
  EXPECT_EQ(content_of(path("table")), "a,b\n1,2\n");
  outputs().write(path("table"), Form::plain, "a,b\n3,4\n");
  EXPECT_EQ(content_of(path("table")), "a,b\n3,4\n");
  const Outputs other("stickslip evaluate", {}, false);
  EXPECT_THROW(other.check(path("table")), InputError) << "the result of another command";
  write_file(path("table"), "edited");
  fs::last_write_time(path("table"), fs::file_time_type::clock::now() + std::chrono::seconds(2));
  EXPECT_THROW(outputs().check(path("table")), InputError) << "edited since";
  OutputFile measured(path("measured"));
  measured.keep("");
  EXPECT_THROW(outputs().check(path("measured")), InputError) << "a file without an author";
}

TEST_F(OutputsTest, ALogIsNeverAnEarlierResult) {
  write_file(path("run.log"), "\xed\xa1\xda\x01 # Written by stickslip diagnose, in its model");
  EXPECT_FALSE(is_written_by(path("run.log"), "stickslip diagnose"));
  EXPECT_THROW(outputs().check(path("run.log")), InputError);
}

TEST_F(OutputsTest, TheNameOfAnotherCommandIsNoMark) {
  write_file(path("a"), "# Written by stickslip diagnose2\n");
  EXPECT_FALSE(is_written_by(path("a"), "stickslip diagnose"));
  write_file(path("a"), "# Made for stickslip diagnose\n");
  EXPECT_FALSE(is_written_by(path("a"), "stickslip diagnose"));
  EXPECT_FALSE(is_written_by(path("none"), "stickslip diagnose"));
}

TEST_F(OutputsTest, AFailureLeavesTheOldResultAndNoTrace) {
  outputs().write(path("result"), Form::toml, "old\n");
  const auto fails = [](const fs::path& file) {
    write_file(file.string(), "half");
    throw InputError(Problem{file.string(), 0, 0, "the disk is full"});
  };
  try {
    outputs().write(path("result"), fails);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.what(), path("result") + ": the disk is full");
  }
  EXPECT_THAT(content_of(path("result")), testing::HasSubstr("old"));
  EXPECT_EQ(file_count(), 2U);
}

TEST_F(OutputsTest, CheckLeavesNoTrace) {
  outputs().check("");
  outputs().check("-");
  outputs().check(path("new"));
  EXPECT_EQ(file_count(), 1U);
  EXPECT_THROW(outputs().check(path("no/folder")), InputError);
  EXPECT_THROW(outputs().check(folder_.string()), InputError);
}

TEST_F(OutputsTest, KeepsLinksPermissionsAndExtensions) {
  outputs().write(path("target.csv"), Form::toml, "old");
  fs::create_symlink("target.csv", folder_ / "link.csv");
  fs::permissions(path("target.csv"), static_cast<fs::perms>(0640));
  outputs().write(path("link.csv"), [](const fs::path& file) {
    EXPECT_EQ(file.extension(), ".csv");
    write_file(file.string(), "new");
  });
  EXPECT_TRUE(fs::is_symlink(folder_ / "link.csv"));
  EXPECT_EQ(content_of(path("target.csv")), "new");
  EXPECT_EQ(fs::status(path("target.csv")).permissions(), static_cast<fs::perms>(0640));
}

TEST_F(OutputsTest, DevicesPipesAndDescriptorsAreWrittenDirectly) {
  outputs().write("/dev/null", Form::json, "{\n}");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  const fs::path described = folder_ / "by-descriptor";
  write_file(described.string(), "of the shell, before");
  std::FILE* const opened = std::fopen(described.c_str(), "w");
  ASSERT_NE(opened, nullptr);
  outputs().write("/proc/self/fd/" + std::to_string(fileno(opened)), Form::plain, "through it");
  std::fclose(opened);
  EXPECT_EQ(content_of(described), "through it");
  EXPECT_EQ(file_count(), 2U);
  const Outputs reader("stickslip diagnose", {"/dev/null"}, false);
  reader.check("/dev/null");
}

TEST_F(OutputsTest, StandardOutputHasNoMark) {
  testing::internal::CaptureStdout();
  outputs().write("-", Form::plain, "a,b\n");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "a,b\n");
}

TEST_F(OutputsTest, AFolderReplacesOnlyItsOwnFiles) {
  const fs::path results = folder_ / "deep/results";
  const auto write = [&](const Outputs& rules, const char* name, const std::string& text) {
    OutputFolder folder(results, rules);
    write_file((folder.path() / name).string(), text);
    folder.keep();
  };
  write(outputs(), "a.csv", "first");
  write(outputs(), "b.csv", "first");
  write(outputs(), "a.csv", "second");
  EXPECT_EQ(content_of(results / "a.csv"), "second");
  EXPECT_EQ(content_of(results / "b.csv"), "first");
  write_file((results / "mine.csv").string(), "by hand");
  EXPECT_THROW(write(outputs(), "mine.csv", "x"), InputError);
  const Outputs other("stickslip reduce", {}, false);
  EXPECT_THROW(write(other, "a.csv", "x"), InputError);
  const Outputs reading("stickslip diagnose", {(results / "a.csv").string()}, true);
  EXPECT_THROW(write(reading, "a.csv", "x"), InputError);
  EXPECT_EQ(content_of(results / "a.csv"), "second");
  write(outputs(true), "mine.csv", "forced");
  EXPECT_EQ(content_of(results / "mine.csv"), "forced");
}

TEST_F(OutputsTest, AFolderThatFailsLeavesNoTrace) {
  const Outputs rules = outputs();
  {
    const OutputFolder folder(folder_ / "results", rules);
    write_file((folder.path() / "a.csv").string(), "half");
  }
  EXPECT_FALSE(fs::exists(folder_ / "results"));
  EXPECT_THROW(OutputFolder(folder_ / "t.csv", rules), InputError);
}

}  // namespace
}  // namespace stickslip::files
