#include "tools/telemetry/lcm_client.h"

#include <poll.h>
#include <sys/mman.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "physics/problem.h"
#include "protocol/channels.h"

namespace stickslip::telemetry {

namespace {

using std::chrono::steady_clock;

// LCM explains itself on standard error over many lines, with a random number for the address that
// has no route. While this lives it speaks into memory instead.
class Overheard {
 public:
  Overheard() : memory_(memfd_create("lcm", MFD_CLOEXEC)) {
    std::fflush(stderr);
    if (memory_ < 0) return;
    before_ = dup(STDERR_FILENO);
    if (before_ >= 0) dup2(memory_, STDERR_FILENO);
  }
  ~Overheard() {
    std::fflush(stderr);
    if (before_ >= 0) {
      dup2(before_, STDERR_FILENO);
      close(before_);
    }
    if (memory_ >= 0) close(memory_);
  }
  Overheard(const Overheard&) = delete;
  Overheard& operator=(const Overheard&) = delete;

  /// The first line of what was said; may be empty.
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
  int before_ = -1;
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

void refuse_lcm(const std::string& what) { throw InputError(Problem{"", 0, 0, "LCM " + what}); }

void add_url_option(CLI::App& command, std::string& url) {
  url = protocol::default_url;
  command.add_option("--url", url, "Where LCM is")
      ->envname("LCM_DEFAULT_URL")
      ->capture_default_str();
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
    throw std::runtime_error(std::string("cannot wait for signals: ") + std::strerror(reason));
  }
}

StopSignals::~StopSignals() {
  // What is pending has been seen; it must not end the program on the way out.
  signalfd_siginfo seen{};
  while (read(file_, &seen, sizeof seen) == sizeof seen) {
  }
  close(file_);
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

std::unique_ptr<lcm::LCM> join_lcm(const std::string& url) {
  std::string said;
  {
    const Overheard lcm_words;
    auto lcm = std::make_unique<lcm::LCM>(url);
    if (lcm->good()) return lcm;
    said = lcm_words.first_line();
  }
  if (said.find("unreachable") != std::string::npos) {
    refuse_lcm("has no route for " + url +
               "; to use it on this host only: ip link set lo up; ip route add 239.255.76.67/32 "
               "dev lo");
  }
  refuse_lcm("does not accept the URL \"" + url + "\"" + (said.empty() ? "" : " (" + said + ")") +
             "; expected for example " + protocol::default_url);
}

void expect_to_hear(lcm::LCM& lcm) {
  const auto nothing = [](const lcm_recv_buf_t*, const char*, void*) {};
  std::string said;
  {
    const Overheard lcm_words;
    lcm_subscription_t* const trial =
        lcm_subscribe(lcm.getUnderlyingLCM(), "STICKSLIP_NOTHING", nothing, nullptr);
    if (trial != nullptr) {
      lcm_unsubscribe(lcm.getUnderlyingLCM(), trial);
      return;
    }
    said = lcm_words.first_line();
  }
  refuse_lcm("does not hear itself" + (said.empty() ? "" : " (" + said + ")") +
             ": another program may have taken its port for itself (ss -ulnp | grep 7667 shows "
             "which), or a firewall keeps multicast away");
}

Woken wait_for(lcm::LCM& lcm, const StopSignals& stop, steady_clock::time_point until) {
  std::array<pollfd, 2> files = {{{stop.file(), POLLIN, 0}, {lcm.getFileno(), POLLIN, 0}}};
  const timespec left = duration_until(until);
  const int ready = ppoll(files.data(), files.size(), &left, nullptr);
  if (ready < 0 && errno != EINTR) {
    throw std::runtime_error(std::string("cannot wait for LCM: ") + std::strerror(errno));
  }
  if (ready <= 0) return Woken::time_out;
  return files[0].revents != 0 ? Woken::stop : Woken::message;
}

bool stopped_before(const StopSignals& stop, steady_clock::time_point until) {
  pollfd file{stop.file(), POLLIN, 0};
  while (true) {
    const timespec left = duration_until(until);
    const int ready = ppoll(&file, 1, &left, nullptr);
    if (ready > 0) return true;
    if (ready == 0) return false;
    if (errno != EINTR) {
      throw std::runtime_error(std::string("cannot wait: ") + std::strerror(errno));
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
