// SPDX-License-Identifier: Apache-2.0
// Reading, writing and replacing whole files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "physics/problem.h"
#include "tools/files/read_file.h"
#include "tools/files/write_file.h"

namespace stickslip::files {
namespace {

namespace fs = std::filesystem;

class Files : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "stickslip-files-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  std::string path(const char* name) const { return (folder_ / name).string(); }
  std::size_t file_count() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  fs::path folder_;
};

const std::string binary("a\0b\r\n\xff", 6);

TEST_F(Files, ContentIsReadAsWritten) {
  write_file(path("a"), binary);
  EXPECT_EQ(content_of(path("a")), binary);
  write_file(path("a"), "short");
  EXPECT_EQ(content_of(path("a")), "short");
}

TEST_F(Files, ContentOfAnUnreadableFileIsEmpty) { EXPECT_EQ(content_of(path("missing")), ""); }

TEST_F(Files, CannotBeWrittenIntoAMissingFolder) {
  EXPECT_THROW(write_file(path("missing/a"), "x"), InputError);
  EXPECT_THROW(replace_file(path("missing/a"), "x"), InputError);
}

TEST_F(Files, FullDeviceIsARuntimeError) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full";
  EXPECT_THROW(write_file("/dev/full", "x"), std::runtime_error);
}

TEST_F(Files, MakeFolderCreatesParentsAndAcceptsAnExistingFolder) {
  make_folder(folder_ / "a/b");
  EXPECT_TRUE(fs::is_directory(folder_ / "a/b"));
  make_folder(folder_ / "a/b");
  write_file(path("file"), "");
  EXPECT_THROW(make_folder(folder_ / "file"), InputError);
  EXPECT_THROW(make_folder(folder_ / "file/below"), InputError);
}

TEST_F(Files, ReplaceFileCreatesAndReplaces) {
  replace_file(path("a"), "first");
  EXPECT_EQ(content_of(path("a")), "first");
  replace_file(path("a"), binary);
  EXPECT_EQ(content_of(path("a")), binary);
  EXPECT_EQ(file_count(), 1U) << "no temporary file remains";
}

TEST_F(Files, ReplaceFileKeepsPermissions) {
  replace_file(path("a"), "x");
  EXPECT_EQ(fs::status(path("a")).permissions(), static_cast<fs::perms>(0644));
  fs::permissions(path("a"), static_cast<fs::perms>(0640));
  replace_file(path("a"), "y");
  EXPECT_EQ(fs::status(path("a")).permissions(), static_cast<fs::perms>(0640));
}

TEST_F(Files, ReplaceFileFollowsLinks) {
  write_file(path("target"), "old");
  fs::create_symlink("target", folder_ / "link");
  replace_file(path("link"), "new");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(content_of(path("target")), "new");
}

TEST_F(Files, ReplaceFileLeavesNothingBehindIfItFails) {
  make_folder(folder_ / "folder/content");
  EXPECT_THROW(replace_file(folder_ / "folder", "x"), std::runtime_error);
  EXPECT_EQ(file_count(), 1U);
  EXPECT_TRUE(fs::is_directory(folder_ / "folder/content"));
}

}  // namespace
}  // namespace stickslip::files
