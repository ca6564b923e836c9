// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/gnuplot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>

#include "physics/problem.h"

namespace stickslip::figures {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using testing::ThrowsMessage;

class Draw : public testing::Test {
 protected:
  Draw() {
    std::string name = testing::TempDir() + "figures-XXXXXX";
    folder_ = mkdtemp(name.data());
  }
  ~Draw() override { std::filesystem::remove_all(folder_); }

  std::string content(const std::string& name) const {
    std::ifstream in(folder_ / name, std::ios::binary);
    std::ostringstream out;
    out << in.rdbuf();
    return out.str();
  }

  std::filesystem::path folder_;
};

Picture line() {
  Picture picture;
  picture.stem = "line";
  picture.tables = {{"data", {{0, 1}, {1, 2}, {}, {2, std::numeric_limits<double>::quiet_NaN()}}}};
  picture.commands = "plot $data using 1:2 with lines title 'a line'";
  return picture;
}

TEST_F(Draw, WritesSvgPngAndScript) {
  draw(line(), folder_);
  EXPECT_THAT(content("line.svg"), HasSubstr("</svg>"));
  EXPECT_THAT(content("line.svg"), HasSubstr("a line"));
  EXPECT_THAT(content("line.png"), StartsWith("\x89PNG"));
  EXPECT_THAT(content("line.gp"), HasSubstr("$data << EOD\n0 1\n1 2\n\n2 NaN\nEOD\n"));
  // No other files remain.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 3);
}

TEST_F(Draw, ReportsTheErrorOfGnuplot) {
  Picture picture = line();
  picture.commands = "plot nothing that is there";
  EXPECT_THAT([&] { draw(picture, folder_); },
              ThrowsMessage<std::runtime_error>(HasSubstr("line.gp")));
}

TEST_F(Draw, NamesThePackageIfGnuplotIsMissing) {
  const char* before = std::getenv("PATH");
  const std::string path = before != nullptr ? before : "";
  setenv("PATH", folder_.c_str(), 1);
  EXPECT_THAT([&] { draw(line(), folder_); }, ThrowsMessage<InputError>(HasSubstr("gnuplot-nox")));
  setenv("PATH", path.c_str(), 1);
}

TEST_F(Draw, NamesTheFileThatCannotBeWritten) {
  EXPECT_THAT([&] { draw(line(), folder_ / "nowhere"); },
              ThrowsMessage<InputError>(HasSubstr("nowhere/line.gp")));
}

}  // namespace
}  // namespace stickslip::figures
