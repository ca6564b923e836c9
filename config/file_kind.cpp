// SPDX-License-Identifier: Apache-2.0
// Kind of a configuration file by the names of its tables.
#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "config/document.h"
#include "config/validation.h"

namespace stickslip::config {

namespace {

/// First name of a line, and whether it is in brackets: a rig has a table [recording], a campaign
/// has one [[recording]] for each.
struct FirstName {
  std::string_view name;
  bool header = false;
  bool list = false;  // in two
};

FirstName first_name(std::string_view line) {
  FirstName out;
  while (!line.empty() && (line.front() == ' ' || line.front() == '\t' || line.front() == '[')) {
    out.list = out.header && line.front() == '[';
    out.header = out.header || line.front() == '[';
    line.remove_prefix(1);
  }
  out.name = line.substr(0, line.find_first_of(".]= \t"));
  return out;
}

/// Names at the top of the files with these keys, except those common to all kinds of files.
class TopNames {
 public:
  explicit TopNames(std::span<const Key> keys) : names_(names_within(keys, "")) {}

  bool has(std::string_view name) const {
    return name != "schema" && std::find(names_.begin(), names_.end(), name) != names_.end();
  }

 private:
  std::vector<std::string> names_;
};

/// Numbers of lines that begin with a name of each kind of file.
struct Counts {
  std::size_t rig = 0;
  std::size_t model = 0;
  std::size_t faults = 0;
  std::size_t calibration = 0;
  std::size_t registers = 0;
  std::size_t candidates = 0;
  std::size_t recordings = 0;
  bool oscillator = false;
  bool seed = false;
};

Counts counts_in(std::string_view text) {
  const TopNames rig(keys_of<Rig>());
  const TopNames model(keys_of<physics::Model>());
  const TopNames calibration(keys_of<CalibrationFile>());
  Counts out;
  while (!text.empty()) {
    const auto end = text.find('\n');
    const FirstName first = first_name(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    if (rig.has(first.name)) ++out.rig;
    if (model.has(first.name)) ++out.model;
    if (first.header && first.name == "candidate") ++out.candidates;
    if (first.list && (first.name == "recording" || first.name == "number")) ++out.recordings;
    if (first.name == "oscillator") out.oscillator = true;
    if (first.name == "fault") ++out.faults;
    if (first.header && first.name == "register") ++out.registers;
    if (first.name == "seed") out.seed = true;  // of a script without faults; rigs have one, too
    // Tables of rigs and models may have keys of these names.
    if (first.header && calibration.has(first.name)) ++out.calibration;
  }
  return out;
}

}  // namespace

std::optional<FileKind> kind_of(std::string_view text) {
  // Line by line, so that a file with a syntax error has a kind, too.
  const Counts n = counts_in(text);
  if (n.recordings > 0) return FileKind::campaign;
  if (n.candidates > 0 && !n.oscillator) return FileKind::candidates;
  const std::size_t most = std::max({n.rig, n.model, n.faults, n.calibration});
  if (n.registers > most) return FileKind::modbus_map;
  if (most == 0) return n.seed ? std::optional(FileKind::fault_script) : std::nullopt;
  if (n.faults > std::max({n.rig, n.model, n.calibration})) return FileKind::fault_script;
  if (n.calibration > n.rig && n.calibration > n.model) return FileKind::calibration;
  return n.rig > n.model ? FileKind::rig : FileKind::model;
}

}  // namespace stickslip::config
