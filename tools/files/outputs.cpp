// SPDX-License-Identifier: Apache-2.0
#include "tools/files/outputs.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "config/named_files.h"
#include "config/same_file.h"
#include "physics/failure.h"
#include "physics/problem.h"
#include "tools/files/read_file.h"
#include "tools/files/write_file.h"

namespace stickslip::files {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view list_name = ".written-by-stickslip";
constexpr const char* author_attribute = "user.stickslip.written_by";
// A log holds texts of its rig, which may name the command that wrote them.
constexpr std::string_view log_sync_word = "\xed\xa1\xda\x01";

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

[[noreturn]] void refuse(const std::string& name, const std::string& why) {
  throw InputError(Problem{name, 0, 0, why});
}

/// `text` with every occurrence of `from` replaced.
std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
    text.replace(at, from.size(), to);
    at += to.size();
  }
  return text;
}

/// An empty file of that name; the errno of the failure, or 0.
int create(const fs::path& file) {
  const int opened = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (opened < 0) return errno;
  ::close(opened);
  return 0;
}

/// Time of the last change of the content, " 1730000000.000000000", by which a file that was edited
/// since is known.
std::string time_of_content(const fs::path& file) {
  struct stat now {};
  if (::stat(file.c_str(), &now) != 0) return "";
  std::string nanoseconds = std::to_string(now.st_mtim.tv_nsec);
  nanoseconds.insert(0, 9 - nanoseconds.size(), '0');
  return ' ' + std::to_string(now.st_mtim.tv_sec) + '.' + nanoseconds;
}

/// Renames `from` to `to` once its content is on the disk. The errno of the failure, which leaves
/// both as they were, or 0.
int move_durably(const fs::path& from, const fs::path& to) {
  const int opened = ::open(from.c_str(), O_RDONLY | O_CLOEXEC);
  if (opened < 0) return errno;
  const int error = ::fsync(opened) == 0 ? 0 : errno;
  ::close(opened);
  if (error != 0) return error;
  return std::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace

std::string marked(Form form, const std::string& text, const std::string& author) {
  switch (form) {
    case Form::toml:
      return "# Written by " + author + ", which replaces this file when it is run again.\n" + text;
    case Form::html:
      return "<!-- Written by " + author + " -->\n" + text;
    case Form::json:
      if (!text.starts_with("{\n")) throw std::logic_error("JSON without a line for its author");
      return "{\n  \"written_by\": \"" + author + "\",\n" + text.substr(2);
    case Form::plain:
      break;
  }
  return text;
}

bool is_written_by(const fs::path& file, const std::string& author) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return false;
  std::array<char, 256> attribute{};
  const ssize_t size =
      ::getxattr(file.c_str(), author_attribute, attribute.data(), attribute.size());
  if (size > 0) {
    return std::string_view(attribute.data(), static_cast<std::size_t>(size)) ==
           author + time_of_content(file);
  }
  // HDF5 has its first attribute behind the superblock and the root group.
  constexpr std::size_t beginning = 2048;
  constexpr std::size_t farthest = 96;
  std::string text(beginning, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(text.data(), static_cast<std::streamsize>(beginning));
  text.resize(static_cast<std::size_t>(in.gcount()));
  if (text.starts_with(log_sync_word)) return false;
  for (const char* word : {"ritten by ", "ritten_by"}) {
    const std::size_t mark = text.find(word);
    if (mark == std::string::npos) continue;
    const std::string near = text.substr(mark, farthest + author.size());
    const std::size_t at = near.find(author);
    if (at == std::string::npos) continue;
    const char next = at + author.size() < near.size() ? near[at + author.size()] : '\0';
    if (std::isalnum(static_cast<unsigned char>(next)) == 0 && next != '-') return true;
  }
  return false;
}

OutputFile::OutputFile(const std::string& name) : name_(name), target_(name), written_(name) {
  const config::LinkEnd place = config::end_of_links(name);
  struct stat old {};
  const bool exists = ::stat(name.c_str(), &old) == 0;
  direct_ = place.through_descriptor || (exists && !S_ISREG(old.st_mode));
  if (exists && S_ISDIR(old.st_mode)) refuse(name, "cannot be written: it is a folder");
  if (exists && ::access(name.c_str(), W_OK) != 0) {
    refuse(name, std::string("cannot be written: ") + std::strerror(errno));
  }
  if (direct_) return;
  target_ = place.path;
  int error = EEXIST;
  for (int i = 0; i < 100 && error == EEXIST; ++i) {
    std::string hidden(1, '.');
    hidden.append(target_.stem().string()).append(".").append(std::to_string(::getpid()));
    hidden.append("-").append(std::to_string(i)).append(target_.extension().string());
    written_ = folder_of(target_) / hidden;
    error = create(written_);
  }
  if (error != 0) refuse(name, std::string("cannot be written: ") + std::strerror(error));
  if (exists) ::chmod(written_.c_str(), old.st_mode & 07777U);
}

OutputFile::~OutputFile() {
  if (!direct_ && !kept_) ::unlink(written_.c_str());
}

void OutputFile::keep(const std::string& author) {
  if (direct_ || kept_) return;
  if (!author.empty()) {
    // Not every file system has attributes: the file then needs --force to be replaced.
    const std::string value = author + time_of_content(written_);
    (void)::setxattr(written_.c_str(), author_attribute, value.data(), value.size(), 0);
  }
  const int error = move_durably(written_, target_);
  if (error != 0) throw Failure(name_ + ": is unchanged: " + std::strerror(error));
  kept_ = true;
  sync_folder(folder_of(target_));
}

OutputFolder::OutputFolder(fs::path name, const Outputs& outputs)
    : name_(std::move(name)), outputs_(outputs) {
  make_folder(name_);
  written_ = name_ / (".unfinished-" + std::to_string(::getpid()));
  std::error_code error;
  fs::remove_all(written_, error);
  if (!fs::create_directory(written_, error)) {
    refuse(name_.string(), "cannot be written: " + error.message());
  }
}

OutputFolder::~OutputFolder() {
  std::error_code error;
  fs::remove_all(written_, error);
  if (fs::is_empty(name_, error)) fs::remove(name_, error);
}

void OutputFolder::keep() {
  const fs::path list = name_ / list_name;
  std::string listed = content_of(list);
  if (!listed.starts_with(outputs_.author() + "\n")) listed = outputs_.author() + "\n";
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(written_)) {
    names.push_back(entry.path().filename().string());
  }
  for (const std::string& each : names) {
    const bool ours = listed.find("\n" + each + "\n") != std::string::npos;
    outputs_.check_replaced((name_ / each).string(), ours);
    if (!ours) listed += each + "\n";
  }
  for (const std::string& each : names) {
    const int error = move_durably(written_ / each, name_ / each);
    if (error != 0) {
      throw Failure((name_ / each).string() + ": is unchanged: " + std::strerror(error));
    }
  }
  replace_file(list, listed);
}

Outputs::Outputs(std::string author, const std::vector<std::string>& inputs, bool force)
    : author_(std::move(author)), force_(force) {
  add_inputs(inputs);
}

void Outputs::check_replaced(const std::string& name, bool ours) const {
  for (const std::string& input : inputs_) {
    if (!config::is_same_file(name, input)) continue;
    refuse(name, (name == input ? "is an input of " + author_
                                : "is the same file as " + input + ", an input of " + author_) +
                     ": expected another file to write to");
  }
  struct stat old {};
  if (force_ || ours || ::stat(name.c_str(), &old) != 0 || !S_ISREG(old.st_mode)) return;
  if (config::end_of_links(name).through_descriptor) return;
  refuse(name, "exists, and is no earlier result of " + author_ +
                   ": expected a new file, or --force to replace it");
}

void Outputs::add_inputs(const std::vector<std::string>& inputs) {
  for (const std::string& each : inputs) {
    inputs_.push_back(each);
    for (const fs::path& named : config::files_read_with(each)) inputs_.push_back(named.string());
  }
}

void Outputs::check(const std::string& name) const {
  if (name.empty() || name == "-") return;
  check_replaced(name, is_written_by(name, author_));
  const OutputFile possible(name);
}

namespace {

// A second opening of /dev/stdout would overwrite what is printed, if it is a file.
bool is_standard_output(const std::string& name) { return name == "-" || name == "/dev/stdout"; }

}  // namespace

void Outputs::write(const std::string& name, Form form, const std::string& text) const {
  if (is_standard_output(name)) {
    std::fwrite(text.data(), 1, text.size(), stdout);
    return;
  }
  write(name,
        [&](const fs::path& path) { write_file(path.string(), marked(form, text, author_)); });
}

void Outputs::write(const std::string& name,
                    const std::function<void(const fs::path&)>& writer) const {
  if (name.empty()) return;
  if (is_standard_output(name)) return writer("-");
  check_replaced(name, is_written_by(name, author_));
  OutputFile file(name);
  const auto with_its_name = [&](const std::string& text) {
    return replaced(text, file.path().string(), name);
  };
  try {
    writer(file.path());
  } catch (const InputError& error) {
    std::vector<Problem> problems = error.problems();
    for (Problem& each : problems) {
      each.file = with_its_name(each.file);
      each.message = with_its_name(each.message);
    }
    throw InputError(std::move(problems));
  } catch (const Failure& error) {
    throw Failure(with_its_name(error.what()));
  }
  file.keep(author_);
}

}  // namespace stickslip::files
