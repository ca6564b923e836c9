// SPDX-License-Identifier: Apache-2.0
// Files that a command writes. Each is written beside its place and moved there when it is whole,
// so that a command that fails leaves what was there. A file that the command reads is never
// replaced, nor is, without --force, one that the same command did not write
// (docs/decisions/outputs-replace-only-their-own.md).
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::files {

/// Form of a text, which decides where it names the command that wrote it. `plain` and tables,
/// which other programs read by their first line, do not.
enum class Form { toml, json, html, plain };

/// The text with that name at its beginning; unchanged for Form::plain. JSON must be an object that
/// begins with a line of its own.
std::string marked(Form form, const std::string& text, const std::string& author);

/// True if `author` is the command that wrote the file: by an extended attribute of the file, if
/// its content has not changed since, or, without such an attribute, by its beginning.
bool is_written_by(const std::filesystem::path& file, const std::string& author);

/// A file in progress; it vanishes unless it is kept. Devices and pipes are written directly.
class OutputFile {
 public:
  /// Throws InputError if nothing can be created beside `name`.
  explicit OutputFile(const std::string& name);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Where to write. Has the extension of the final name.
  const std::filesystem::path& path() const { return written_; }
  /// Moves what was written to its place and makes it durable; a file that is open stays so. A
  /// second call does nothing. `author`: the command that may replace the file later, as far as the
  /// file system has extended attributes; none if empty. Throws Failure on failure,
  /// which leaves the old file.
  void keep(const std::string& author);

 private:
  std::string name_;
  std::filesystem::path target_;
  std::filesystem::path written_;
  bool direct_ = false;  ///< a device, a pipe or a descriptor of this process
  bool kept_ = false;
};

class Outputs;

/// A folder of results in progress. A list in the folder names the files of the command, which are
/// those that a later run may replace.
class OutputFolder {
 public:
  /// Creates the folder and its parents unless it exists. Throws InputError if that is impossible.
  OutputFolder(std::filesystem::path name, const Outputs& outputs);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Where to write the files; subfolders are not moved.
  const std::filesystem::path& path() const { return written_; }
  /// Moves all files to their place. Throws InputError, before the first is moved, if one of them
  /// would replace an input of the command or a file that it did not write.
  void keep();

 private:
  std::filesystem::path name_;
  std::filesystem::path written_;
  const Outputs& outputs_;
};

/// The rules for the outputs of one run of a command.
class Outputs {
 public:
  /// `author`: the command, "stickslip diagnose". `inputs`: as in `add_inputs`. `force`: existing
  /// files are replaced, but for inputs.
  Outputs(std::string author, const std::vector<std::string>& inputs, bool force);

  /// Throws InputError if the file must not be or cannot be written; to be called before a long
  /// computation whose result goes there. Accepts "" (no output) and "-" (standard output). Leaves
  /// no trace.
  void check(const std::string& name) const;

  /// Checks, and writes the text with the mark of its form; "-" and "/dev/stdout" are standard
  /// output, without the mark, whose state the caller checks at exit. Throws as `check`, and
  /// Failure if the text could not be written as a whole.
  void write(const std::string& name, Form form, const std::string& text) const;

  /// Checks, and calls `writer` with the path to write to ("-": standard output). Errors that name
  /// that path name the output instead.
  void write(const std::string& name,
             const std::function<void(const std::filesystem::path&)>& writer) const;

  /// Adds files that the command reads, and those that a configuration among them names to be read.
  void add_inputs(const std::vector<std::string>& inputs);

  const std::string& author() const { return author_; }

 private:
  friend class OutputFolder;
  /// Throws InputError if the file is an input, or exists and `ours` is false without --force.
  void check_replaced(const std::string& name, bool ours) const;

  std::string author_;
  std::vector<std::string> inputs_;
  bool force_;
};

}  // namespace stickslip::files
