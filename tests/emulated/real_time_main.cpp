// SPDX-License-Identifier: Apache-2.0
// main of tests that keep real time: emulated devices send when it is time to, whether or not the
// host lets the driver run. A test that fails while its threads waited for a processor shows
// nothing, and is repeated; one that fails on a host that kept up has failed.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <thread>

namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::steady_clock;

constexpr int most_attempts = 10;
// Delays above which a failure shows nothing: drivers and emulated devices act every millisecond.
constexpr milliseconds tolerated_delay{5};
constexpr milliseconds tolerated_wait{20};
constexpr milliseconds tolerated_line_delay{10};

/// Longest time for which a byte has been on its way through a pseudo-terminal: the kernel carries
/// it by a worker of its own, which waits for a processor as well.
class LineDelay {
 public:
  LineDelay() : master_(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    if (master_ < 0 || ::grantpt(master_) != 0 || ::unlockpt(master_) != 0) return;
    slave_ = ::open(::ptsname(master_), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    termios raw{};
    ::tcgetattr(slave_, &raw);
    ::cfmakeraw(&raw);
    ::tcsetattr(slave_, TCSANOW, &raw);
  }
  LineDelay(const LineDelay&) = delete;
  LineDelay& operator=(const LineDelay&) = delete;
  ~LineDelay() {
    if (slave_ >= 0) ::close(slave_);
    if (master_ >= 0) ::close(master_);
  }

  /// Takes the byte that is on its way, or sends the next one.
  void watch() {
    char byte = 'x';
    if (!sent_) {
      if (slave_ >= 0 && ::write(master_, &byte, 1) == 1) sent_ = steady_clock::now();
      return;
    }
    longest_ = std::max<nanoseconds>(longest_, steady_clock::now() - *sent_);
    if (::read(slave_, &byte, 1) == 1) sent_.reset();
  }
  nanoseconds longest() const { return longest_; }

 private:
  int master_;
  int slave_ = -1;
  std::optional<steady_clock::time_point> sent_;
  nanoseconds longest_{0};
};

/// Delays of a process by its host, as seen from its parent.
class HostDelays {
 public:
  explicit HostDelays(pid_t process) : tasks_("/proc/" + std::to_string(process) + "/task") {}

  /// Sleeps for a millisecond.
  void watch() {
    const auto wanted = steady_clock::now() + milliseconds(1);
    std::this_thread::sleep_until(wanted);
    longest_ = std::max<nanoseconds>(longest_, steady_clock::now() - wanted);
    line_.watch();
    if (++count_ % 20 == 0) read_waits();
  }
  nanoseconds of_line() const { return line_.longest(); }
  /// The longest delay of a sleeping process: none of its processors was free, or the whole machine
  /// stood still.
  nanoseconds longest() const { return longest_; }
  /// Sum over threads of the time in which they were ready and did not run. Of threads that lived
  /// less than 20 ms only a part is known.
  nanoseconds waited() const {
    nanoseconds sum{0};
    for (const auto& each : waited_) sum += each.second;
    return sum;
  }

 private:
  // The second number of schedstat; absent in kernels without scheduler statistics.
  void read_waits() {
    std::error_code ended;
    for (fs::directory_iterator task(tasks_, ended), end; !ended && task != end;
         task.increment(ended)) {
      std::ifstream file(task->path() / "schedstat");
      long long ran = 0;
      long long waited = 0;
      if (file >> ran >> waited) waited_[task->path().filename().string()] = nanoseconds(waited);
    }
  }

  fs::path tasks_;
  LineDelay line_;
  int count_ = 0;
  nanoseconds longest_{0};
  std::map<std::string, nanoseconds> waited_;
};

double in_ms(nanoseconds time) { return 1.0e-6 * static_cast<double>(time.count()); }

int run_tests(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  return RUN_ALL_TESTS();
}

// Exit status of the tests in a process of their own, and whether the host kept up with them.
struct Attempt {
  int status = 1;
  bool kept_up = true;
};

Attempt attempt(int argc, char** argv) {
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child < 0) return {run_tests(argc, argv), true};
  if (child == 0) {
    const int status = run_tests(argc, argv);
    std::fflush(nullptr);
    std::exit(status);
  }
  HostDelays delays(child);
  int ended = 0;
  while (::waitpid(child, &ended, WNOHANG) == 0) delays.watch();
  const Attempt out{WIFEXITED(ended) ? WEXITSTATUS(ended) : 128 + WTERMSIG(ended),
                    delays.longest() < tolerated_delay && delays.waited() < tolerated_wait &&
                        delays.of_line() < tolerated_line_delay};
  if (out.status != 0) {
    std::printf(
        "[   HOST   ] longest delay %.1f ms, of a line %.1f ms, threads waited %.1f ms for a "
        "processor\n",
        in_ms(delays.longest()), in_ms(delays.of_line()), in_ms(delays.waited()));
  }
  return out;
}

int run_in_real_time(int argc, char** argv) {
  for (int count = 1;; ++count) {
    const Attempt last = attempt(argc, argv);
    if (last.status == 0 || last.kept_up || count == most_attempts) return last.status;
    std::printf("[   HOST   ] the host was too busy for real time: attempt %d of %d\n", count + 1,
                most_attempts);
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run_in_real_time(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
