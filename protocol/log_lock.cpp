// SPDX-License-Identifier: Apache-2.0
#include "protocol/log_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

#include "physics/problem.h"

namespace stickslip::protocol {
namespace {

/// Process id in /proc/locks that has locked the file; empty if unknown, as in another container.
std::string process_with(const struct stat& file) {
  std::array<char, 32> device{};
  std::snprintf(device.data(), device.size(), "%02x:%02x:", major(file.st_dev), minor(file.st_dev));
  const std::string inode = std::to_string(file.st_ino);
  std::string found;
  std::ifstream locks("/proc/locks");
  for (std::string line; std::getline(locks, line);) {
    std::istringstream words(line);
    std::string number, kind, advisory, mode, process, place;
    words >> number >> kind >> advisory >> mode >> process >> place;
    if (kind != "FLOCK" || process == "0" || process.starts_with('-')) continue;
    if (place == device.data() + inode) return process;
    // Some file systems have another device number for the kernel than for programs.
    if (place.ends_with(':' + inode)) found = process;
  }
  return found;
}

// Empty if unknown.
std::string holder_of(int descriptor) {
  struct stat file {};
  if (::fstat(descriptor, &file) != 0) return {};
  const std::string process = process_with(file);
  if (process.empty()) return {};
  std::string program;
  std::ifstream comm("/proc/" + process + "/comm");
  std::getline(comm, program);
  return "process " + process + (program.empty() ? "" : " (" + program + ')');
}

// False if another one has locked the file.
bool locked(int descriptor) {
  int result = 0;
  do {
    result = ::flock(descriptor, LOCK_EX | LOCK_NB);
  } while (result != 0 && errno == EINTR);
  return result == 0 || errno != EWOULDBLOCK;
}

}  // namespace

void lock_log(int descriptor, const std::filesystem::path& file) {
  struct stat status {};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) return;
  // A lock without a holder has mostly been released meanwhile, as of a log's part that is
  // complete.
  constexpr int attempts = 100;
  std::string holder;
  for (int attempt = 0; attempt < attempts && holder.empty(); ++attempt) {
    if (locked(descriptor)) return;
    holder = holder_of(descriptor);
  }
  throw InputError(Problem{file.string(), 0, 0,
                           "is being written by " + (holder.empty() ? "another process" : holder) +
                               ": stop that, or choose another file; nothing was changed"});
}

void require_free_log(const std::filesystem::path& file) {
  // Without waiting for the other end of a pipe.
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) return;
  try {
    lock_log(descriptor, file);
  } catch (...) {
    ::close(descriptor);
    throw;
  }
  ::close(descriptor);
}

}  // namespace stickslip::protocol
