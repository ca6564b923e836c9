// SPDX-License-Identifier: Apache-2.0
// Whole commands in one process, with any bytes as their model and recording: each ends with status
// 0 or 2, or with 1 for a foreseen reason, and says why in words of its own.
//   input: a character that selects the command, the model up to a line "%%", the recording
#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tools/command_line/run.h"
#include "tools/commands/commands.h"

namespace {

namespace fs = std::filesystem;
using namespace stickslip;

// M, R, O: the model, the recording, the folder for results. commands_seeds.cpp selects by letter.
constexpr std::array command_lines = {
    "estimate R --model M --json O/summary.json --out O/estimates.csv",  // a
    "evaluate R --model M --free-run --jobs 1 --json O/score.json",      // b
    "reduce R --model M --samples 24 --out O/reduced --no-pictures",     // c
    "reduce R --model M --method paper --samples 24",                    // d
    "simulate --model M --drive R --out O/simulated.csv",                // e
    "log check R",                                                       // f
    "log info R",                                                        // g
    "log info --json R",                                                 // h
    "log export R O/export.csv",                                         // i
    "log export R O/export.mat",                                         // j
    "log repair R --out O/repaired.log",                                 // k
    "convert R O/converted.log",                                         // l
    "convert R O/converted.csv",                                         // m
    "check M",                                                           // n
    "poincare --model M --frequency-hz 4 --amplitude 0.01 --transient 1 --periods 2 --out O/p.csv",
    "lyapunov --model M --frequency-hz 4 --amplitude 0.01 --transient 1 --periods 20",     // p
    "diagnose R --model M --jobs 1 --json O/report.json --html O/report.html",             // q
    "calibration fit R --channel friction_force --reference w --file O/c.toml --dry-run",  // r
    "config M --json",                                                                     // s
    "calibration show M",                                                                  // t
};

/// A folder of this process, and its standard error in a file of it.
class Workplace {
 public:
  Workplace() {
    std::string name = (fs::temp_directory_path() / "commands_fuzz.XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder");
    folder_ = name;
    fs::create_directory(folder_ / "out");
    errors_ = (folder_ / "errors").string();
    kept_ = {::dup(STDOUT_FILENO), ::dup(STDERR_FILENO)};
  }
  ~Workplace() { fs::remove_all(folder_); }
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;

  std::string path(const char* name) const { return (folder_ / name).string(); }

  /// Status of a command, and what it printed on standard error.
  std::pair<int, std::string> run(const std::vector<std::string>& arguments) {
    fs::remove_all(folder_ / "out");
    fs::create_directory(folder_ / "out");
    redirect(::open("/dev/null", O_WRONLY), STDOUT_FILENO);
    redirect(::open(errors_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDERR_FILENO);
    command_line::Program program{"Tools.", "stickslip"};
    command_line::Action action;
    commands::add_subcommands(program, action);
    const int status = command_line::run(program, action, arguments);
    std::fflush(stdout);
    std::fflush(stderr);
    ::dup2(kept_[0], STDOUT_FILENO);
    ::dup2(kept_[1], STDERR_FILENO);
    std::ifstream in(errors_);
    return {status, {std::istreambuf_iterator<char>(in), {}}};
  }

 private:
  static void redirect(int file, int standard) {
    ::dup2(file, standard);
    ::close(file);
  }

  fs::path folder_;
  std::string errors_;
  std::array<int, 2> kept_{};
};

std::vector<std::string> arguments_of(const char* command, const Workplace& workplace) {
  std::istringstream words(command);
  std::vector<std::string> out;
  for (std::string word; words >> word;) {
    if (word == "M") word = workplace.path("model.toml");
    if (word == "R") word = workplace.path("recording");
    if (word.starts_with("O/")) word = workplace.path("out") + word.substr(1);
    out.push_back(word);
  }
  return out;
}

void require(bool holds, const char* what, const char* command, const std::string& said) {
  if (!holds) throw std::logic_error(std::string(command) + ": " + what + ": " + said);
}

void check(const char* command, int status, const std::string& said) {
  // Texts of exceptions and of the request for a report.
  for (const char* foreign : {"is an error in", "internal", "exception", "std::", "what()",
                              "basic_", "vector", "terminate", "_M_", "Eigen", "toml::"}) {
    require(said.find(foreign) == said.npos, "words of a programmer", command, said);
  }
  require(status >= 0 && status <= 2, "status of no meaning", command, std::to_string(status));
  const bool verdict = std::string_view(command).starts_with("log check");
  require(status == 0 || verdict || said.size() > 20, "silent refusal", command, said);
  require(status != 2 || said.find(": ") != said.npos, "refusal without its object", command, said);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Workplace workplace;
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const char* command =
      command_lines[static_cast<std::size_t>(bytes[0] - 'a') % command_lines.size()];
  constexpr std::string_view between = "\n%%\n";
  const std::size_t cut = bytes.find(between);
  const bool both = cut != bytes.npos;
  std::ofstream(workplace.path("model.toml"), std::ios::binary)
      << bytes.substr(1, both ? cut : bytes.npos);
  std::ofstream(workplace.path("recording"), std::ios::binary)
      << (both ? bytes.substr(cut + between.size()) : std::string_view());
  const auto [status, said] = workplace.run(arguments_of(command, workplace));
  check(command, status, said);
  return 0;
}
