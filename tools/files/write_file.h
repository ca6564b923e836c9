// SPDX-License-Identifier: Apache-2.0
// Writing whole files. Results of commands are written through Outputs (outputs.h).
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>

#include "physics/failure.h"
#include "physics/problem.h"

namespace stickslip::files {

/// Creates the folder and its parents unless it exists. Throws InputError if that is impossible.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw InputError(Problem{folder.string(), 0, 0,
                             "cannot be created as a folder: " +
                                 (error ? error.message() : std::string("the file exists"))});
  }
}

/// Throws InputError if the file cannot be opened for writing, Failure if not all of the
/// content could be written.
inline void write_file(const std::string& path, const std::string& content) {
  std::ofstream file(path, std::ios::binary);
  if (!file) {
    throw InputError(
        Problem{path, 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }
  file << content;
  file.close();
  if (!file) {
    throw Failure(path + ": is incomplete: " + std::strerror(errno));
  }
}

/// Writes all of the content, sets the permissions and syncs. The errno of the failure, or 0.
inline int write_and_sync(int file, std::string_view content, mode_t mode) {
  if (::fchmod(file, mode) != 0) return errno;
  while (!content.empty()) {
    const ssize_t count = ::write(file, content.data(), content.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    content.remove_prefix(static_cast<std::size_t>(count));
  }
  return ::fsync(file) == 0 ? 0 : errno;
}

/// Makes the name durable, as far as the folder can be synced.
inline void sync_folder(const std::filesystem::path& folder) {
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory < 0) return;
  ::fsync(directory);
  ::close(directory);
}

/// Replaces the content of a file atomically: after a crash either the old or the new content is
/// there as a whole. Follows symbolic links, keeps the permissions. Throws InputError if no
/// temporary file can be created next to it, Failure if writing fails, which leaves the
/// old file.
inline void replace_file(const std::filesystem::path& path, const std::string& content) {
  std::error_code error;
  std::filesystem::path target = std::filesystem::weakly_canonical(path, error);
  if (error) target = path;
  const std::filesystem::path folder =
      target.has_parent_path() ? target.parent_path() : std::filesystem::path(".");
  std::string name = target.filename().string() + ".XXXXXX";
  name.insert(name.begin(), '.');
  name = (folder / name).string();
  const int file = ::mkstemp(name.data());
  if (file < 0) {
    throw InputError(
        Problem{path.string(), 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }
  struct stat old {};
  const mode_t mode = ::stat(target.c_str(), &old) == 0 ? old.st_mode & 07777U : 0644U;
  int error_number = write_and_sync(file, content, mode);
  if (::close(file) != 0 && error_number == 0) error_number = errno;
  if (error_number == 0 && std::rename(name.c_str(), target.c_str()) != 0) error_number = errno;
  if (error_number != 0) {
    ::unlink(name.c_str());
    throw Failure(path.string() + ": is unchanged: " + std::strerror(error_number));
  }
  sync_folder(folder);
}

}  // namespace stickslip::files
