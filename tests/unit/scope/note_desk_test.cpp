// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/note_desk.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <future>

namespace stickslip::scope {
namespace {

using namespace std::chrono_literals;

std::vector<NoteDesk::Answered> wait_for(NoteDesk& desk, std::size_t count) {
  std::vector<NoteDesk::Answered> out;
  while (out.size() < count) {
    pollfd file{desk.file(), POLLIN, 0};
    if (poll(&file, 1, 30000) <= 0) break;
    for (auto& each : desk.answered()) out.push_back(std::move(each));
  }
  return out;
}

TEST(NoteDesk, PassesNotesOnInTheirOrderAndReturnsTheAnswers) {
  std::vector<std::string> passed;
  NoteDesk desk([&passed](const Note& note) {
    passed.push_back(note.rig + ": " + note.text);
    return note.text == "b" ? std::string("no") : std::string();
  });
  const auto now = NoteDesk::Clock::now();
  EXPECT_EQ(desk.submit({7, "a", "rig"}, now), "");
  EXPECT_EQ(desk.submit({8, "b", "rig"}, now), "");
  const auto answers = wait_for(desk, 2);
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(passed, (std::vector<std::string>{"rig: a", "rig: b"}));
  EXPECT_EQ(answers[0].page, 7U);
  EXPECT_EQ(answers[0].refusal, "");
  EXPECT_EQ(answers[1].page, 8U);
  EXPECT_EQ(answers[1].refusal, "no");
}

TEST(NoteDesk, ADaemonThatDoesNotAnswerDelaysNoPage) {
  std::promise<void> release;
  auto released = release.get_future().share();
  NoteDesk desk([released](const Note&) {
    released.wait();
    return std::string();
  });
  const auto now = NoteDesk::Clock::now();
  EXPECT_EQ(desk.submit({1, "waits", ""}, now), "");
  EXPECT_TRUE(desk.answered().empty());
  release.set_value();
  EXPECT_EQ(wait_for(desk, 1).size(), 1U);
}

TEST(NoteDesk, TakesTenAtOnceAndThenOnePerSecond) {
  NoteDesk desk([](const Note&) { return std::string(); });
  auto now = NoteDesk::Clock::now();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(desk.submit({1, "note", ""}, now), "");
  EXPECT_NE(desk.submit({1, "note", ""}, now), "");
  now += 900ms;
  EXPECT_NE(desk.submit({2, "note", ""}, now), "");
  EXPECT_EQ(wait_for(desk, 10).size(), 10U);
  now += 200ms;
  EXPECT_EQ(desk.submit({2, "note", ""}, now), "");
}

}  // namespace
}  // namespace stickslip::scope
