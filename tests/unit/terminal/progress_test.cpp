// SPDX-License-Identifier: Apache-2.0
// Progress without a terminal. On a pseudo terminal it is tested in tests/end_to_end/terminal.py.
#include "tools/terminal/progress.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace {

using stickslip::terminal::Progress;

TEST(Progress, IsThreadSafe) {
  Progress progress("counting");
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&progress, t] {
        for (std::size_t i = 0; i < 10000; ++i) {
          progress.at(i, 10000);
          if (i % 1000 == 0) progress.set_label("thread " + std::to_string(t));
        }
      });
    }
  }
  progress.finish();
  progress.finish();
  progress.at(0.5);  // ignored after the end
  progress.set_label("nothing");
}

TEST(Progress, AcceptsATotalOfZero) {
  Progress progress("nothing at all");
  progress.at(0, 0);
}

}  // namespace
