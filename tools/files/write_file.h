// Writing a whole file, or saying why not.
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

#include "physics/problem.h"

namespace stickslip::files {

/// Makes the folder, and those above it, unless it is there. Throws InputError where it cannot be.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw InputError(
        Problem{folder.string(), 0, 0,
                "is no folder and cannot be made one: " +
                    (error ? error.message() : std::string("something else bears the name"))});
  }
}

/// Throws InputError where `path` (unless empty) cannot be opened for writing: before the work
/// whose result shall go there. Changes no file, and leaves none behind.
inline void expect_writable(const std::string& path) {
  if (path.empty()) return;
  const bool there = std::filesystem::exists(path);
  const bool opened = std::ofstream(path, std::ios::binary | std::ios::app).is_open();
  const int error = errno;
  if (!opened) {
    throw InputError(
        Problem{path, 0, 0, std::string("cannot be written: ") + std::strerror(error)});
  }
  if (!there) std::filesystem::remove(path);
}

/// Throws InputError where the file cannot be opened for writing, and std::runtime_error where it
/// cannot hold all of the content.
inline void write_file(const std::string& path, const std::string& content) {
  std::ofstream file(path, std::ios::binary);
  if (!file) {
    throw InputError(
        Problem{path, 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }
  file << content;
  file.close();
  if (!file) {
    throw std::runtime_error(path + ": is not complete: " + std::strerror(errno));
  }
}

/// Puts the content in the place of the file so that, whatever happens, either the old or the new
/// one is there as a whole: a file beside it, on the disk before it takes the name. Follows a link,
/// keeps the permissions. Throws InputError where no file can be made there, and std::runtime_error
/// where it cannot hold all of the content; the old file is then as it was.
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
  std::string_view rest = content;
  bool written = ::fchmod(file, mode) == 0;
  while (written && !rest.empty()) {
    const ssize_t count = ::write(file, rest.data(), rest.size());
    if (count < 0 && errno == EINTR) continue;
    written = count >= 0;
    if (written) rest.remove_prefix(static_cast<std::size_t>(count));
  }
  written = written && ::fsync(file) == 0;
  int cause = errno;
  if (::close(file) != 0 && written) {
    written = false;
    cause = errno;
  }
  if (written && std::rename(name.c_str(), target.c_str()) != 0) {
    written = false;
    cause = errno;
  }
  if (!written) {
    ::unlink(name.c_str());
    throw std::runtime_error(path.string() + ": is as it was: " + std::strerror(cause));
  }
  // The name itself has to be on the disk as well; where a folder cannot be synced, it is not lost.
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory >= 0) {
    ::fsync(directory);
    ::close(directory);
  }
}

/// As write_file, but "-" is standard output, which main() looks at in the end.
inline void write_table(const std::string& file, const std::string& text) {
  if (file == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
  } else {
    write_file(file, text);
  }
}

}  // namespace stickslip::files
