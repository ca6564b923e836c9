// SPDX-License-Identifier: Apache-2.0
// One configuration file: its TOML, validated by a table of keys. All problems are collected; the
// values can be read once there are none.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/key.h"
#include "config/key_tables.h"
#include "config/named_files.h"
#include "physics/problem.h"

namespace stickslip::config {

/// The whole text of a configuration file. Throws InputError if it cannot be read or is larger than
/// 1 MiB.
std::string read_text(const std::filesystem::path& file);

/// A value as written in a file.
struct Stated {
  std::string text;  ///< as TOML; equal values have equal texts
  int line = 0;
  int column = 0;
};

class Document {
 public:
  /// Parses and validates; never throws for the content of the text. Messages name the file as
  /// `name`; paths in the text are relative to its folder.
  Document(std::string_view text, std::string name, std::span<const Key> keys);
  ~Document();
  Document(Document&&) noexcept;
  Document& operator=(Document&&) noexcept;

  bool sound() const { return problems_.empty(); }
  std::size_t problem_count() const { return problems_.size(); }

  /// Adds a problem at the key or table of that path, or at the nearest table around it that is
  /// present. "physics.ID.NAME" leads into the [[physics]] table of that id, "candidate.ID" into
  /// that of a candidate, a number as in "history.0.date" into a list.
  void report(std::string_view path, const std::string& message);

  /// Adds a problem at a key of an existing [[fault]] table, or at the table if the key is absent.
  void report_fault(std::size_t position, std::string_view key, const std::string& message);

  /// Adds a warning, at the place that report() would give it: the file is valid in spite of it.
  void warn(std::string_view path, const std::string& message);

  /// Adds problems of another file that this one names.
  void add(const std::vector<Problem>& problems);

  /// The problems in the order of the file; the document has none afterwards.
  std::vector<Problem> take_problems();

  /// In the order in which they were added.
  const std::vector<Problem>& warnings() const { return warnings_; }

  bool has(std::string_view path) const;

  /// The value at the path of a key, as written; empty if absent.
  std::optional<Stated> stated(std::string_view path) const;

  /// The text at a path; empty if absent or of another type.
  std::optional<std::string> text(std::string_view path) const;

  /// The path at a path, relative to the folder of the file; empty if absent or of another type.
  std::filesystem::path file_at(std::string_view path) const;

  /// The files at all keys for files, relative to the folder of the file, also with problems.
  std::vector<NamedFile> named_files() const;

  /// Sets the members of `object` that the file has keys for. Only for a valid document with the
  /// keys of that object.
  template <class Object>
  void read(Object& object) const {
    read_into(keys_of<Object>(), &object);
  }

 private:
  void read_into(std::span<const Key> keys, void* object) const;
  const void* term_node(std::string_view path) const;
  Problem problem_near(std::string_view path, const std::string& message) const;
  Problem problem_at(const void* node, const std::string& message) const;

  struct Contents;
  std::string name_;
  std::filesystem::path folder_;
  std::span<const Key> keys_;
  std::vector<Problem> problems_;
  std::vector<Problem> warnings_;
  std::unique_ptr<Contents> contents_;
};

/// Kind of a file.
enum class FileKind { rig, model, candidates, fault_script, calibration, modbus_map, campaign };

/// Kind of a text by the names of its tables, even with syntax errors; empty if it is none of them.
std::optional<FileKind> kind_of(std::string_view text);

}  // namespace stickslip::config
