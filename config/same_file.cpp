// SPDX-License-Identifier: Apache-2.0
#include "config/same_file.h"

#include <sys/stat.h>

#include <string>
#include <system_error>

namespace stickslip::config {

namespace fs = std::filesystem;

namespace {

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

bool same_inode(const struct stat& a, const struct stat& b) {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

}  // namespace

LinkEnd end_of_links(const fs::path& name) {
  constexpr int most_links = 40;  // as in the kernel
  LinkEnd out{name, false};
  for (int i = 0; i < most_links; ++i) {
    const std::string text = out.path.string();
    if (text.starts_with("/dev/fd/") || text.starts_with("/proc/")) out.through_descriptor = true;
    std::error_code error;
    const fs::path next = fs::read_symlink(out.path, error);
    if (error) break;
    out.path = next.is_absolute() ? next : out.path.parent_path() / next;
  }
  return out;
}

bool is_same_file(const fs::path& one, const fs::path& other) {
  struct stat a {};
  struct stat b {};
  const bool exists_a = ::stat(one.c_str(), &a) == 0;
  const bool exists_b = ::stat(other.c_str(), &b) == 0;
  if (exists_a != exists_b) return false;
  if (exists_a) return (S_ISREG(a.st_mode) || S_ISDIR(a.st_mode)) && same_inode(a, b);
  const fs::path at_a = end_of_links(one).path;
  const fs::path at_b = end_of_links(other).path;
  if (at_a.filename() != at_b.filename()) return false;
  if (::stat(folder_of(at_a).c_str(), &a) != 0 || ::stat(folder_of(at_b).c_str(), &b) != 0) {
    return at_a.lexically_normal() == at_b.lexically_normal();
  }
  return same_inode(a, b);
}

}  // namespace stickslip::config
