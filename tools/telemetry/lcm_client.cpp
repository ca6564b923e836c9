// SPDX-License-Identifier: Apache-2.0
#include "tools/telemetry/lcm_client.h"

#include <poll.h>
#include <sys/mman.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "config/lcm_url.h"
#include "physics/failure.h"
#include "physics/problem.h"
#include "protocol/channels.h"

namespace stickslip::telemetry {

namespace {

using std::chrono::steady_clock;

constexpr const char* url_variable = "LCM_DEFAULT_URL";

// LCM reports errors on standard error, in many lines. During the lifetime of this object standard
// error is redirected to memory.
class CapturedStderr {
 public:
  CapturedStderr() : memory_(memfd_create("lcm", MFD_CLOEXEC)) {
    std::fflush(stderr);
    if (memory_ < 0) return;
    previous_ = dup(STDERR_FILENO);
    if (previous_ >= 0) dup2(memory_, STDERR_FILENO);
  }
  ~CapturedStderr() {
    std::fflush(stderr);
    if (previous_ >= 0) {
      dup2(previous_, STDERR_FILENO);
      close(previous_);
    }
    if (memory_ >= 0) close(memory_);
  }
  CapturedStderr(const CapturedStderr&) = delete;
  CapturedStderr& operator=(const CapturedStderr&) = delete;

  /// First line of the captured text; may be empty.
  std::string first_line() const {
    std::fflush(stderr);
    std::array<char, 400> text{};
    const ssize_t size = memory_ < 0 ? 0 : pread(memory_, text.data(), text.size(), 0);
    std::string line(text.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
    line.resize(std::min(line.size(), line.find('\n')));
    return line;
  }

 private:
  int memory_ = -1;
  int previous_ = -1;
};

timespec duration_until(steady_clock::time_point until) {
  const auto left = std::max(until - steady_clock::now(), steady_clock::duration::zero());
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
  timespec out{};
  out.tv_sec = seconds.count();
  out.tv_nsec = std::chrono::nanoseconds(left - seconds).count();
  return out;
}

}  // namespace

void throw_lcm_error(const std::string& problem) {
  throw InputError(Problem{"", 0, 0, "LCM " + problem});
}

void add_url_option(CLI::App& command, std::string& url) {
  url = protocol::default_url;
  command.add_option("--url", url, "LCM URL")->envname(url_variable)->capture_default_str();
  // Not a check of the option, which would refuse even --help while the variable is wrong.
  command.parse_complete_callback([&url] {
    const std::string wrong = config::wrong_with_lcm_url(url);
    if (wrong.empty()) return;
    const char* variable = std::getenv(url_variable);
    const bool from_variable = variable != nullptr && url == variable;
    throw CLI::ValidationError((from_variable ? std::string(url_variable) + '=' : "--url ") + url,
                               wrong);
  });
}

StopSignals::StopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, &before_);
  file_ = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
  if (file_ < 0) {
    const int reason = errno;
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    throw Failure(std::string("cannot wait for signals: ") + std::strerror(reason));
  }
}

StopSignals::~StopSignals() {
  // Pending signals have been handled; unblocking must not deliver them.
  signalfd_siginfo signal{};
  while (read(file_, &signal, sizeof signal) == sizeof signal) {
  }
  close(file_);
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

std::unique_ptr<lcm::LCM> join_lcm(const std::string& url) {
  std::string error;
  {
    const CapturedStderr captured;
    auto lcm = std::make_unique<lcm::LCM>(url);
    if (lcm->good()) return lcm;
    error = captured.first_line();
  }
  if (error.find("unreachable") != std::string::npos) {
    throw_lcm_error(
        "has no route for " + url +
        "; to use it on this host only: ip link set lo up; ip route add 239.255.76.67/32 "
        "dev lo");
  }
  throw_lcm_error("does not accept the URL \"" + url + "\"" +
                  (error.empty() ? "" : " (" + error + ")") + "; expected for example " +
                  protocol::default_url);
}

void check_reception(lcm::LCM& lcm) {
  const auto nothing = [](const lcm_recv_buf_t*, const char*, void*) {};
  std::string error;
  {
    const CapturedStderr captured;
    lcm_subscription_t* const trial =
        lcm_subscribe(lcm.getUnderlyingLCM(), "STICKSLIP_NOTHING", nothing, nullptr);
    if (trial != nullptr) {
      lcm_unsubscribe(lcm.getUnderlyingLCM(), trial);
      return;
    }
    error = captured.first_line();
  }
  throw_lcm_error(
      "does not receive its own messages" + (error.empty() ? "" : " (" + error + ")") +
      ": another program may hold its port exclusively (see ss -ulnp | grep 7667), or a "
      "firewall may drop multicast");
}

Wake wait_for(lcm::LCM& lcm, const StopSignals& stop, steady_clock::time_point until) {
  std::array<pollfd, 2> files = {{{stop.file(), POLLIN, 0}, {lcm.getFileno(), POLLIN, 0}}};
  const timespec left = duration_until(until);
  const int ready = ppoll(files.data(), files.size(), &left, nullptr);
  if (ready < 0 && errno != EINTR) {
    throw Failure(std::string("cannot wait for LCM: ") + std::strerror(errno));
  }
  if (ready <= 0) return Wake::time_out;
  return files[0].revents != 0 ? Wake::stop : Wake::message;
}

bool stopped_before(const StopSignals& stop, steady_clock::time_point until) {
  pollfd file{stop.file(), POLLIN, 0};
  while (true) {
    const timespec left = duration_until(until);
    const int ready = ppoll(&file, 1, &left, nullptr);
    if (ready > 0) return true;
    if (ready == 0) return false;
    if (errno != EINTR) {
      throw Failure(std::string("cannot wait: ") + std::strerror(errno));
    }
  }
}

steady_clock::time_point after(steady_clock::time_point from, double seconds) {
  constexpr double century_s = 3.0e9;
  if (!(seconds > 0.0) || seconds > century_s) return from + std::chrono::hours(24 * 365 * 100);
  return from +
         std::chrono::duration_cast<steady_clock::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace stickslip::telemetry
