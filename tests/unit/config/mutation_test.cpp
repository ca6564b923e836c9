// SPDX-License-Identifier: Apache-2.0
// Randomly altered files: the loader returns a model or problems, in a short time.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <random>

#include "config/document.h"
#include "config/fault_script.h"
#include "config/model_file.h"
#include "physics/problem.h"

namespace stickslip::config {
namespace {

std::string content_of(const char* file) {
  std::ifstream in(std::string(STICKSLIP_SOURCE_DIR "/") + file);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

class Mutation {
 public:
  explicit Mutation(std::uint64_t seed) : random_(seed) {}

  std::string of(std::string text) {
    const int count = 1 + below(4);
    for (int i = 0; i < count && !text.empty(); ++i) once(text);
    return text;
  }

 private:
  int below(std::size_t n) {
    return static_cast<int>(std::uniform_int_distribution<std::size_t>(0, n - 1)(random_));
  }
  std::size_t place(const std::string& text) {
    return static_cast<std::size_t>(below(text.size()));
  }

  void once(std::string& text) {
    static constexpr std::array<const char*, 24> pieces = {"[",
                                                           "]",
                                                           "[[",
                                                           "{",
                                                           "}",
                                                           "=",
                                                           "\"",
                                                           "'''",
                                                           "\n",
                                                           ".",
                                                           "nan",
                                                           "-inf",
                                                           "1e999",
                                                           "-1",
                                                           "0x10",
                                                           "1979-05-27T07:32:00Z",
                                                           "true",
                                                           ",",
                                                           "a.b.c = 1",
                                                           "\\u0000",
                                                           "\xff\xfe",
                                                           "\"\"\"",
                                                           "[[physics]]\n",
                                                           "= { value = "};
    const std::size_t at = place(text);
    switch (below(6)) {
      case 0:
        text[at] = static_cast<char>(below(256));
        break;
      case 1:
        text.erase(at, static_cast<std::size_t>(1 + below(12)));
        break;
      case 2:
        text.insert(at, pieces[static_cast<std::size_t>(below(pieces.size()))]);
        break;
      case 3:
        text.resize(at);
        break;
      case 4: {
        const std::string part = text.substr(at, static_cast<std::size_t>(1 + below(60)));
        text.insert(place(text), part);
        break;
      }
      default: {                                      // A line is moved, as in editing.
        const auto begin = text.rfind('\n', at) + 1;  // npos + 1 is 0
        const auto end = std::min(text.find('\n', at), text.size() - 1) + 1;
        const std::string line = text.substr(begin, end - begin);
        text.erase(begin, end - begin);
        if (text.empty()) break;
        text.insert(text.rfind('\n', place(text)) + 1, line);
      }
    }
  }

  std::mt19937_64 random_;
};

TEST(MutatedModel, GivesAModelOrProblems) {
  const std::string original = content_of("config/models/simulated-truth.toml");
  ASSERT_FALSE(original.empty());
  std::size_t refused = 0;
  constexpr std::uint64_t cases = 4000;
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    const std::string text = Mutation(seed).of(original);
    try {
      const physics::Model model = parse_model(text, "mutated");
      EXPECT_EQ(parse_model(model_text(model), "written"), model) << "seed " << seed;
    } catch (const InputError& error) {
      ++refused;
      ASSERT_FALSE(error.problems().empty()) << "seed " << seed;
      for (const Problem& problem : error.problems()) {
        EXPECT_GT(problem.line, 0) << "seed " << seed << ": " << problem.text();
        EXPECT_EQ(problem.message.find('\n'), std::string::npos) << "seed " << seed;
      }
    } catch (const std::exception& error) {
      ADD_FAILURE() << "seed " << seed << ": " << error.what();
    }
  }
  EXPECT_GT(refused, cases / 4) << "most mutations should cause problems";
  EXPECT_LT(refused, cases);
}

TEST(MutatedRig, GivesValuesOrProblems) {
  const std::string original = content_of("config/simulated.toml");
  ASSERT_FALSE(original.empty());
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    Document document(Mutation(seed).of(original), "mutated", rig_keys());
    for (const Problem& problem : document.take_problems()) {
      EXPECT_GT(problem.line, 0) << "seed " << seed << ": " << problem.text();
    }
  }
}

TEST(MutatedFaultScript, GivesAScriptOrProblems) {
  const std::string original = content_of("config/faults/everything.toml");
  ASSERT_FALSE(original.empty());
  std::size_t refused = 0;
  constexpr std::uint64_t cases = 2000;
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    try {
      for (const Fault& fault : parse_fault_script(Mutation(seed).of(original), "mutated").faults) {
        EXPECT_FALSE(in_words(fault).empty());
      }
    } catch (const InputError& error) {
      ++refused;
      ASSERT_FALSE(error.problems().empty()) << "seed " << seed;
      for (const Problem& problem : error.problems()) {
        EXPECT_GT(problem.line, 0) << "seed " << seed << ": " << problem.text();
        EXPECT_EQ(problem.message.find('\n'), std::string::npos) << "seed " << seed;
      }
    } catch (const std::exception& error) {
      ADD_FAILURE() << "seed " << seed << ": " << error.what();
    }
  }
  EXPECT_GT(refused, cases / 4) << "most mutations should cause problems";
  EXPECT_LT(refused, cases);
}

TEST(DeeplyNested, IsRefusedWithoutRecursion) {
  const std::string deep(100000, '[');
  EXPECT_THROW(parse_model("schema = " + deep, "deep"), InputError);
  std::string dotted = "a";
  for (int i = 0; i < 20000; ++i) dotted += ".a";
  EXPECT_THROW(parse_model(dotted + " = 1", "dotted"), InputError);
}

}  // namespace
}  // namespace stickslip::config
