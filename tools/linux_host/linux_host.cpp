// SPDX-License-Identifier: Apache-2.0
#include "tools/linux_host/linux_host.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <grp.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <pwd.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/time.h>
#include <sys/timex.h>
#include <sys/un.h>
#include <sys/utsname.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <sstream>
#include <system_error>
#include <thread>

#include "physics/problem.h"
#include "tools/telemetry/lcm_client.h"

namespace stickslip::linux_host {

using namespace telemetry;

namespace {

using doctor::Attempt;

/// Owner of a file descriptor.
class Descriptor {
 public:
  explicit Descriptor(int file) : file_(file) {}
  ~Descriptor() {
    if (file_ >= 0) close(file_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return file_; }
  bool open() const { return file_ >= 0; }

 private:
  int file_;
};

Attempt refused(int error) { return {false, error, std::strerror(error)}; }
Attempt granted() { return {true, 0, {}}; }

std::int64_t now_ns(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

/// Offset of the wall clock from the monotonic clock, from the fastest of several readings.
std::int64_t wall_offset_ns() {
  std::int64_t best_width = 0;
  std::int64_t offset = 0;
  for (int i = 0; i < 10; ++i) {
    const std::int64_t before = now_ns(CLOCK_MONOTONIC);
    const std::int64_t wall = now_ns(CLOCK_REALTIME);
    const std::int64_t after = now_ns(CLOCK_MONOTONIC);
    if (i == 0 || after - before < best_width) {
      best_width = after - before;
      offset = wall - before - (after - before) / 2;
    }
  }
  return offset;
}

std::int64_t quantile(const std::vector<std::int64_t>& ordered, double q) {
  if (ordered.empty()) return 0;
  const double rank = std::ceil(q * static_cast<double>(ordered.size()));
  return ordered[std::max<std::size_t>(1, static_cast<std::size_t>(rank)) - 1];
}

std::string user_name(uid_t user) {
  const passwd* entry = getpwuid(user);
  return entry != nullptr ? entry->pw_name : std::to_string(user);
}

std::string group_name(gid_t which) {
  const group* entry = getgrgid(which);
  return entry != nullptr ? entry->gr_name : std::to_string(which);
}

sockaddr_in internet_address(const std::string& address, std::uint16_t port) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(port);
  inet_pton(AF_INET, address.c_str(), &out.sin_addr);
  return out;
}

const sockaddr* as_address(const sockaddr_in& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

/// Interface of the most specific route to an address, from a table in the format of
/// /proc/net/route; empty if there is none.
std::string interface_in(const std::string& table, in_addr address) {
  std::istringstream lines(table);
  std::string best;
  unsigned long best_mask = 0;
  unsigned long best_metric = 0;
  std::string line;
  std::getline(lines, line);  // column names
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::string name;
    std::string gateway;
    unsigned long destination = 0;
    unsigned long flags = 0;
    unsigned long references = 0;
    unsigned long used = 0;
    unsigned long metric = 0;
    unsigned long mask = 0;
    fields >> name >> std::hex >> destination >> gateway >> flags >> std::dec >> references >>
        used >> metric >> std::hex >> mask;
    // Addresses are in network byte order, like s_addr.
    if (!fields || (address.s_addr & mask) != destination) continue;
    const unsigned long width = ntohl(static_cast<std::uint32_t>(mask));
    if (!best.empty() && (width < best_mask || (width == best_mask && metric >= best_metric))) {
      continue;
    }
    best = name;
    best_mask = width;
    best_metric = metric;
  }
  return best;
}

/// Receiver of the probe messages.
struct Echo {
  void take(const lcm::ReceiveBuffer*, const std::string&) { ++received; }
  int received = 0;
};

/// Lateness of each wake-up on a grid of `period_ns`; missed periods are skipped.
std::vector<std::int64_t> lateness_of(std::int64_t period_ns, std::size_t count) {
  std::vector<std::int64_t> late;
  late.reserve(count);
  std::int64_t deadline = now_ns(CLOCK_MONOTONIC) + period_ns;
  while (late.size() < count) {
    const timespec until{deadline / 1'000'000'000, deadline % 1'000'000'000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
    }
    const std::int64_t behind = now_ns(CLOCK_MONOTONIC) - deadline;
    late.push_back(std::max<std::int64_t>(0, behind));
    deadline += period_ns * (1 + std::max<std::int64_t>(0, behind) / period_ns);
  }
  return late;
}

}  // namespace

std::optional<std::string> LinuxHost::read(const std::filesystem::path& file) const {
  const Descriptor in(open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!in.open()) return std::nullopt;
  constexpr std::size_t largest = std::size_t{1} << 16U;
  std::string out(largest, '\0');
  std::size_t size = 0;
  while (size < out.size()) {
    const ssize_t got = ::read(in.get(), out.data() + size, out.size() - size);
    if (got < 0 && size == 0) return std::nullopt;
    if (got <= 0) break;
    size += static_cast<std::size_t>(got);
  }
  out.resize(size);
  out.erase(out.find_last_not_of(" \t\n") + 1);
  return out;
}

std::vector<std::string> LinuxHost::names_in(const std::filesystem::path& folder) const {
  std::vector<std::string> out;
  std::error_code error;
  for (std::filesystem::directory_iterator each(folder, error), end; !error && each != end;
       each.increment(error)) {
    out.push_back(each->path().filename().string());
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::filesystem::path LinuxHost::resolved(const std::filesystem::path& path) const {
  std::error_code error;
  std::filesystem::path out = std::filesystem::canonical(path, error);
  return error ? path : out;
}

doctor::Entry LinuxHost::entry_at(const std::filesystem::path& path) const {
  using Kind = doctor::Entry::Kind;
  doctor::Entry out;
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return out;
  out.kind = S_ISREG(status.st_mode)                              ? Kind::file
             : S_ISDIR(status.st_mode)                            ? Kind::folder
             : S_ISSOCK(status.st_mode)                           ? Kind::socket
             : S_ISCHR(status.st_mode) || S_ISBLK(status.st_mode) ? Kind::device
                                                                  : Kind::other;
  out.mode = status.st_mode & 07777U;
  out.owner = user_name(status.st_uid);
  out.group = group_name(status.st_gid);
  const auto may = [&path](int how) {
    return faccessat(AT_FDCWD, path.c_str(), how, AT_EACCESS) == 0;
  };
  out.readable = may(R_OK);
  out.writable = may(W_OK);
  out.searchable = may(X_OK);
  return out;
}

Attempt LinuxHost::open_for_writing(const std::filesystem::path& path) const {
  const Descriptor out(open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK));
  return out.open() ? granted() : refused(errno);
}

Attempt LinuxHost::connect_to(const std::filesystem::path& socket_path) const {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = socket_path.string();
  if (path.size() >= sizeof address.sun_path) return refused(ENAMETOOLONG);
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  int error = 0;
  for (const int type : {SOCK_STREAM, SOCK_SEQPACKET}) {
    const Descriptor end(socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (!end.open()) return refused(errno);
    if (connect(end.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
      return granted();
    }
    error = errno;
    if (error != EPROTOTYPE) break;
  }
  return refused(error);
}

doctor::Attempt LinuxHost::reach(const std::string& host, int port) const {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int unknown = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (unknown != 0) return {false, 0, std::string("the name is unknown: ") + gai_strerror(unknown)};
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, freeaddrinfo);
  constexpr timeval longest{2, 0};
  int error = EHOSTUNREACH;
  for (const addrinfo* each = found; each != nullptr; each = each->ai_next) {
    const Descriptor end(socket(each->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (!end.open()) return refused(errno);
    setsockopt(end.get(), SOL_SOCKET, SO_SNDTIMEO, &longest, sizeof longest);
    if (connect(end.get(), each->ai_addr, each->ai_addrlen) == 0) return granted();
    error = errno == EINPROGRESS ? ETIMEDOUT : errno;  // the time-out of SO_SNDTIMEO
  }
  return refused(error);
}

doctor::Caller LinuxHost::caller() const {
  doctor::Caller out;
  out.name = user_name(geteuid());
  out.root = geteuid() == 0;
  const int count = getgroups(0, nullptr);
  std::vector<gid_t> groups(static_cast<std::size_t>(std::max(0, count)));
  if (count > 0 && getgroups(count, groups.data()) < 0) groups.clear();
  groups.push_back(getegid());
  for (const gid_t each : groups) out.groups.push_back(group_name(each));
  return out;
}

bool LinuxHost::group_exists(const std::string& name) const {
  return getgrnam(name.c_str()) != nullptr;
}

doctor::Kernel LinuxHost::kernel() const {
  utsname names{};
  if (uname(&names) != 0) return {};
  return {names.release, names.version, names.machine};
}

std::int64_t LinuxHost::limit(doctor::Limit which) const {
  rlimit limit{};
  if (which == doctor::Limit::real_time_priority) {
    getrlimit(RLIMIT_RTPRIO, &limit);
  } else {
    getrlimit(RLIMIT_MEMLOCK, &limit);
  }
  return limit.rlim_cur == RLIM_INFINITY ? -1 : static_cast<std::int64_t>(limit.rlim_cur);
}

std::optional<bool> LinuxHost::interface_up(const std::string& name) const {
  // /sys/class/net may show a different network namespace.
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return std::nullopt;
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> owner(all, freeifaddrs);
  for (const ifaddrs* each = all; each != nullptr; each = each->ifa_next) {
    if (name == each->ifa_name) return (each->ifa_flags & IFF_UP) != 0;
  }
  return std::nullopt;
}

doctor::Route LinuxHost::route_to(const std::string& address) const {
  // Connecting a datagram socket resolves the route and sends nothing.
  const Descriptor probe(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const sockaddr_in to = internet_address(address, 7667);
  if (!probe.open() || connect(probe.get(), as_address(to), sizeof to) != 0) {
    return {false, {}, std::strerror(errno)};
  }
  // /proc/self/net shows the network namespace of this process.
  const std::string interface =
      interface_in(read("/proc/self/net/route").value_or(""), to.sin_addr);
  return {true, interface.empty() ? "an unnamed interface" : interface, {}};
}

std::size_t LinuxHost::receive_buffer_messages(std::size_t bytes, int receive_buffer_bytes) const {
  const Descriptor in(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const Descriptor out(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (!in.open() || !out.open()) return 0;
  if (receive_buffer_bytes > 0) {
    setsockopt(in.get(), SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
  }
  sockaddr_in address = internet_address("127.0.0.1", 0);
  socklen_t size = sizeof address;
  int buffer = 0;
  socklen_t buffer_size = sizeof buffer;
  if (bind(in.get(), as_address(address), size) != 0 ||
      getsockname(in.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0 ||
      getsockopt(in.get(), SOL_SOCKET, SO_RCVBUF, &buffer, &buffer_size) != 0) {
    return 0;
  }
  // Loopback delivers before sendto returns. The kernel accounts for more than the bytes of a
  // message, so this number exceeds the capacity.
  const std::vector<char> message(bytes);
  const std::size_t too_many =
      static_cast<std::size_t>(buffer) / std::max<std::size_t>(1, bytes) + 16;
  for (std::size_t i = 0; i < too_many; ++i) {
    if (sendto(out.get(), message.data(), bytes, MSG_DONTWAIT, as_address(address), size) < 0)
      break;
  }
  std::size_t held = 0;
  char first = 0;
  while (recv(in.get(), &first, 1, MSG_DONTWAIT | MSG_TRUNC) >= 0) ++held;
  return held;
}

doctor::RoundTrip LinuxHost::lcm_round_trip(const std::string& url, std::size_t bytes) const {
  doctor::RoundTrip out;
  try {
    const std::unique_ptr<lcm::LCM> lcm = join_lcm(url);
    const std::string channel = "STICKSLIP_DOCTOR_" + std::to_string(getpid());
    Echo echo;
    listen<&Echo::take>(*lcm, channel, &echo);
    const std::vector<std::uint8_t> message(bytes);
    constexpr int messages = 20;
    std::vector<std::int64_t> times;
    for (out.sent = 0; out.sent < messages; ++out.sent) {
      const int before = echo.received;
      const std::int64_t start = now_ns(CLOCK_MONOTONIC);
      if (lcm->publish(channel, message.data(), static_cast<unsigned>(message.size())) != 0)
        continue;
      pollfd file{lcm->getFileno(), POLLIN, 0};
      // At most two missing messages are waited for at length.
      const int timeout_ms = out.sent - static_cast<int>(times.size()) < 2 ? 500 : 20;
      if (poll(&file, 1, timeout_ms) > 0) lcm->handle();
      if (echo.received > before) times.push_back(now_ns(CLOCK_MONOTONIC) - start);
    }
    std::sort(times.begin(), times.end());
    out.done = true;
    out.received = static_cast<int>(times.size());
    out.median_ns = quantile(times, 0.5);
    out.longest_ns = times.empty() ? 0 : times.back();
  } catch (const InputError& error) {
    out.reason = error.problems().front().message;
  }
  return out;
}

Attempt LinuxHost::take_real_time_priority(int priority) const {
  int error = 0;
  std::thread([&error, priority] {
    sched_param parameter{};
    parameter.sched_priority = priority;
    error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
  }).join();
  return error == 0 ? granted() : refused(error);
}

Attempt LinuxHost::lock_memory() const {
  // The daemon allocates this reserve too: under a limit the lock may succeed and a later
  // allocation fail.
  constexpr std::size_t reserve_bytes = 64UL << 20U;
  const pid_t child = fork();
  if (child < 0) return refused(errno);
  if (child == 0) {
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) _exit(errno);
    const void* more =
        mmap(nullptr, reserve_bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    _exit(more == MAP_FAILED ? errno : 0);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return refused(errno);
  }
  // The child was killed for lack of memory.
  const int error = WIFEXITED(status) ? WEXITSTATUS(status) : ENOMEM;
  return error == 0 ? granted() : refused(error);
}

doctor::Wakeups LinuxHost::measure_wakeups(double rate_hz, double duration_s) const {
  constexpr int priority = 50;
  constexpr double max_count = 1e7;
  doctor::Wakeups out;
  const auto count = static_cast<std::size_t>(std::clamp(rate_hz * duration_s, 1.0, max_count));
  const auto period_ns = static_cast<std::int64_t>(std::llround(1e9 / rate_hz));
  std::vector<std::int64_t> late;
  const std::int64_t offset = wall_offset_ns();
  {
    // As the daemon does.
    const Descriptor awake(open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC));
    const std::int32_t microseconds = 0;
    const bool written = awake.open() && write(awake.get(), &microseconds, sizeof microseconds) > 0;
    static_cast<void>(written);  // check_processor_sleep reports a refusal
    std::thread([&] {
      sched_param parameter{};
      parameter.sched_priority = priority;
      out.real_time = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0;
      late = lateness_of(period_ns, count);
    }).join();
  }
  out.clock_step_ns = wall_offset_ns() - offset;
  std::sort(late.begin(), late.end());
  out.count = late.size();
  out.p50_ns = quantile(late, 0.5);
  out.p99_ns = quantile(late, 0.99);
  out.longest_ns = late.empty() ? 0 : late.back();
  return out;
}

std::optional<std::uint64_t> LinuxHost::free_bytes(const std::filesystem::path& folder) const {
  struct statvfs status {};
  if (statvfs(folder.c_str(), &status) != 0) return std::nullopt;
  return std::uint64_t{status.f_bavail} * status.f_frsize;
}

doctor::WriteSpeed LinuxHost::measure_writing(const std::filesystem::path& folder) const {
  doctor::WriteSpeed out;
  // Unlinked immediately, so that no exit path leaves it behind.
  std::string name = (folder / ".stickslip-doctor-XXXXXX").string();
  const Descriptor file(mkostemp(name.data(), O_CLOEXEC));
  if (!file.open()) {
    out.attempt = refused(errno);
    return out;
  }
  unlink(name.c_str());
  constexpr int blocks = 16;
  const std::vector<char> block(std::size_t{1} << 20U, 'x');
  const std::int64_t start = now_ns(CLOCK_MONOTONIC);
  for (int i = 0; i < blocks; ++i) {
    std::size_t written = 0;
    while (written < block.size()) {
      const ssize_t some = write(file.get(), block.data() + written, block.size() - written);
      if (some < 0 && errno == EINTR) continue;
      if (some <= 0) {
        out.attempt = refused(some < 0 ? errno : ENOSPC);
        return out;
      }
      written += static_cast<std::size_t>(some);
    }
    const std::int64_t before = now_ns(CLOCK_MONOTONIC);
    if (fdatasync(file.get()) != 0) {
      out.attempt = refused(errno);
      return out;
    }
    out.longest_sync_ns = std::max(out.longest_sync_ns, now_ns(CLOCK_MONOTONIC) - before);
  }
  const auto taken_ns = static_cast<double>(now_ns(CLOCK_MONOTONIC) - start);
  out.attempt = granted();
  out.bytes_per_s = blocks * static_cast<double>(block.size()) / (taken_ns * 1e-9);
  return out;
}

std::optional<doctor::WallClock> LinuxHost::wall_clock() const {
  timex state{};  // modes = 0: read only
  const int status = adjtimex(&state);
  if (status < 0) return std::nullopt;
  return doctor::WallClock{status != TIME_ERROR && (state.status & STA_UNSYNC) == 0,
                           std::int64_t{state.maxerror}};
}

}  // namespace stickslip::linux_host
