// SPDX-License-Identifier: Apache-2.0
// Every bad file in tests/data/config is refused with exactly the lines of its NAME.expected. To
// accept new wording: run with STICKSLIP_ACCEPT=1 and review the difference.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "config/document.h"
#include "config/fault_script.h"
#include "config/modbus_map.h"
#include "config/model_file.h"
#include "config/rig.h"
#include "physics/problem.h"

namespace stickslip::config {
namespace {

const std::filesystem::path folder = std::filesystem::path(STICKSLIP_TEST_DATA) / "config";

std::string content_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

std::vector<Problem> problems_of(const std::filesystem::path& file) {
  try {
    const auto kind = kind_of(read_text(file));
    if (kind == FileKind::rig) {
      (void)load_rig(file);
    } else if (kind == FileKind::fault_script) {
      (void)load_fault_script(file);
    } else if (kind == FileKind::modbus_map) {
      (void)load_modbus_map(file);
    } else {
      (void)load_model(file);
    }
  } catch (const InputError& error) {
    return error.problems();
  }
  return {};
}

/// Output of `stickslip check`, without the path of the source tree.
std::string lines_of(const std::vector<Problem>& problems) {
  std::string out;
  for (const Problem& problem : problems) out += problem.text() + '\n';
  const std::string prefix = folder.string() + '/';
  for (auto at = out.find(prefix); at != std::string::npos; at = out.find(prefix, at)) {
    out.erase(at, prefix.size());
  }
  return out;
}

std::vector<std::string> bad_files() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() == ".toml" &&
        (name.starts_with("model_") || name.starts_with("rig_") || name.starts_with("faults_") ||
         name.starts_with("map_"))) {
      names.push_back(name);
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

class BadFile : public testing::TestWithParam<std::string> {};

TEST_P(BadFile, IsRefusedWithTheExpectedLines) {
  const auto problems = problems_of(folder / (GetParam() + ".toml"));
  ASSERT_FALSE(problems.empty()) << "was accepted";
  const std::filesystem::path expected = folder / (GetParam() + ".expected");
  if (std::getenv("STICKSLIP_ACCEPT") != nullptr) std::ofstream(expected) << lines_of(problems);
  EXPECT_EQ(lines_of(problems), content_of(expected));
}

TEST_P(BadFile, HasEveryProblemOnceInOrderOnOneLine) {
  const auto problems = problems_of(folder / (GetParam() + ".toml"));
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const Problem& problem = problems[i];
    EXPECT_GT(problem.line, 0) << problem.message;
    EXPECT_GT(problem.column, 0) << problem.message;
    EXPECT_EQ(problem.message.find('\n'), std::string::npos) << problem.message;
    for (std::size_t j = 0; j < i; ++j) EXPECT_FALSE(problems[j] == problem) << problem.text();
    if (i > 0 && problems[i - 1].file == problem.file) {
      EXPECT_LE(problems[i - 1].line, problem.line) << problem.text();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Golden, BadFile, testing::ValuesIn(bad_files()),
                         [](const auto& each) { return each.param; });

TEST(Warnings, AreTheExpectedLines) {
  const std::string lines = lines_of(load_rig(folder / "warned_bench.toml").warnings);
  const std::filesystem::path expected = folder / "warned_bench.expected";
  if (std::getenv("STICKSLIP_ACCEPT") != nullptr) std::ofstream(expected) << lines;
  EXPECT_EQ(lines, content_of(expected));
}

/// A temporary file for one test.
class Scratch {
 public:
  explicit Scratch(const std::string& content)
      : file_(std::filesystem::path(testing::TempDir()) /
              (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) +
               ".toml")) {
    std::ofstream(file_, std::ios::binary) << content;
  }
  ~Scratch() {
    std::error_code error;
    std::filesystem::remove(file_, error);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
};

TEST(Unreadable, AbsentFile) {
  const auto problems = problems_of(folder / "there-is-none.toml");
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_EQ(lines_of(problems), "there-is-none.toml: there is no such file\n");
}

TEST(Unreadable, Folder) {
  EXPECT_EQ(lines_of(problems_of(folder / ".")), ".: is a folder, expected a TOML file\n");
}

TEST(Unreadable, LargerThanAnyConfiguration) {
  const Scratch scratch(std::string((1U << 20U) + 1, '#'));
  const auto problems = problems_of(scratch.file());
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_THAT(problems[0].message, testing::HasSubstr("larger than 1 MiB"));
}

TEST(Unreadable, NoText) {
  const Scratch scratch(std::string("schema = 1\n\0\0\xff\xfe", 15));
  const auto problems = problems_of(scratch.file());
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_EQ(problems[0].line, 2);
}

TEST(KindOf, DistinguishesRigsModelsAndFaultScriptsEvenWithErrors) {
  EXPECT_EQ(kind_of("schema = 1\n[rig]\nname = \"x\"\n"), FileKind::rig);
  EXPECT_EQ(kind_of("schema = 1\n[oscillator]\nmass_kg = = 1\n"), FileKind::model);
  EXPECT_EQ(kind_of("oscillator.mass_kg = 1\n"), FileKind::model);
  EXPECT_EQ(kind_of("schema = 1\n[[fault]]\nkind = = \n"), FileKind::fault_script);
  EXPECT_EQ(kind_of("schema = 1\nseed = 3\n"), FileKind::fault_script);
  EXPECT_EQ(kind_of("[rig]\nname = \"x\"\n[driver.simulated]\nseed = 1\n"), FileKind::rig);
  EXPECT_EQ(kind_of("schema = 1\n"), std::nullopt);
  EXPECT_EQ(kind_of("time_s,displacement_m\n0.0,1.0\n"), std::nullopt);
  EXPECT_EQ(kind_of(""), std::nullopt);
}

}  // namespace
}  // namespace stickslip::config
