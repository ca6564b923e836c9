// SPDX-License-Identifier: Apache-2.0
#include "tools/telemetry/network_of.h"

#include <sched.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "physics/failure.h"
#include "physics/problem.h"

namespace stickslip::telemetry {

namespace {

/// Inode number that identifies a namespace; 0 if it is not accessible.
ino_t namespace_of(const std::string& process, const char* kind) {
  struct stat found {};
  return stat(("/proc/" + process + "/ns/" + kind).c_str(), &found) == 0 ? found.st_ino : 0;
}

bool is_shared(const std::string& process, const char* kind) {
  return namespace_of(process, kind) == namespace_of("self", kind);
}

}  // namespace

void enter_network_of(int pid) {
  const std::string process = std::to_string(pid);
  // glibc 2.36 declares pidfd_open for C only.
  const int file = static_cast<int>(syscall(SYS_pidfd_open, pid, 0U));
  if (file < 0) {
    throw InputError(Problem{"", 0, 0, "--network-of " + process + ": there is no such process"});
  }
  // A user namespace that is shared already must not be entered again.
  int wanted = is_shared(process, "net") ? 0 : CLONE_NEWNET;
  if (wanted != 0 && !is_shared(process, "user")) wanted |= CLONE_NEWUSER;
  const int failed = wanted == 0 ? 0 : setns(file, wanted);
  const int error = errno;
  close(file);
  if (failed != 0) {
    throw Failure("cannot enter the network of process " + process + ": " + std::strerror(error) +
                  "; this requires root or the owner of the process");
  }
}

}  // namespace stickslip::telemetry
