// One configuration file: its TOML, held against a table of keys. Everything that is wrong with it
// is collected; the typed values may be fetched once nothing is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/bench.h"
#include "config/calibration.h"
#include "config/fault_script.h"
#include "config/key.h"
#include "config/rig.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "physics/problem.h"

namespace stickslip::config {

/// The whole text of a configuration file. Throws InputError where it cannot be read or is larger
/// than any configuration.
std::string read_text(const std::filesystem::path& file);

/// A value as it stands in a file.
struct Stated {
  std::string text;  ///< as TOML writes it; equal values have equal texts
  int line = 0;
  int column = 0;
};

class Document {
 public:
  /// Parses and validates; never throws for what the text says. `name` stands for the file.
  Document(std::string_view text, std::string name, std::span<const Key> keys);
  ~Document();
  Document(Document&&) noexcept;
  Document& operator=(Document&&) noexcept;

  bool sound() const { return problems_.empty(); }
  std::size_t problem_count() const { return problems_.size(); }

  /// Adds a problem at the key or table of that path, or at the nearest table around it that is
  /// there. "physics.ID.NAME" leads into the [[physics]] table of that id, a number as in
  /// "history.0.date" into a list.
  void report(std::string_view path, const std::string& message);

  /// Adds a problem at a key of one of the [[fault]] tables, or at the table where the key is not
  /// there. Only for tables that are there.
  void report_fault(std::size_t position, std::string_view key, const std::string& message);

  /// Adds problems of another file that this one names.
  void add(const std::vector<Problem>& problems);

  /// In the order of the file. Leaves the document without any.
  std::vector<Problem> take_problems();

  bool has(std::string_view path) const;
  /// Whether that one of the [[fault]] tables, which is there, has the key.
  bool fault_has(std::size_t position, std::string_view key) const;

  /// What the file says at the path of a key; nothing where it does not.
  std::optional<Stated> stated(std::string_view path) const;

  // Only while the document is sound: the value at a path, nothing where the key is absent.
  std::optional<double> number(std::string_view path) const;
  std::optional<std::int64_t> integer(std::string_view path) const;
  std::optional<bool> boolean(std::string_view path) const;
  std::optional<std::string> text(std::string_view path) const;
  std::optional<physics::Parameter> parameter(std::string_view path) const;
  /// Position of the value in the key's choices, which are in the order of the enumeration.
  std::optional<std::size_t> choice(std::string_view path) const;
  std::vector<physics::Filter> filters(std::string_view path) const;
  std::vector<EnvelopePoint> envelope(std::string_view path) const;
  std::vector<Line> lines(std::string_view path) const;
  std::vector<physics::Term> terms() const;
  std::vector<Fault> faults() const;
  std::optional<ChannelCalibration> calibration(std::string_view path) const;
  std::vector<FormerCalibration> history(std::string_view path) const;
  /// Without their maps: `map_file` is what the file says.
  std::vector<ModbusUnit> modbus_units() const;
  std::vector<GaugeAt> gauges() const;
  std::vector<ModbusRegister> registers() const;

 private:
  struct Contents;
  std::string name_;
  std::span<const Key> keys_;
  std::vector<Problem> problems_;
  std::unique_ptr<Contents> contents_;
};

/// The one of `names` that was probably meant by `name`; empty where none is near.
std::string nearest(std::string_view name, const std::vector<std::string>& names);

/// Which kind of file a text is, from its tables; nothing where it could be none of them.
enum class FileKind { rig, model, fault_script, calibration, modbus_map };
std::optional<FileKind> kind_of(std::string_view text);

}  // namespace stickslip::config
