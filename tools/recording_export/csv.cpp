// SPDX-License-Identifier: Apache-2.0
// CSV: one table of frames, joined with the rows of the other tables.
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>

#include "physics/problem.h"
#include "physics/unsigned_zero.h"
#include "tools/recording_export/write_tables.h"

namespace stickslip::recording_export {
namespace {

void append(std::string& text, const Column& column, std::size_t row) {
  std::visit(
      [&](const auto& values) {
        using Number = typename std::decay_t<decltype(values)>::value_type;
        if constexpr (std::is_same_v<Number, double>) {
          if (std::isnan(values[row])) return;  // an empty cell
        }
        physics::append_shortest(text, values[row]);
      },
      column.values);
}

/// Appends "# name: value"; further lines of the value become comments too.
void append_comment(std::string& text, const std::string& name, const std::string& value) {
  if (value.empty()) return;
  text += "# " + name + ": ";
  for (const char& c : value) {
    text += c;
    if (c == '\n' && &c != &value.back()) text += "#   ";
  }
  if (value.back() != '\n') text += '\n';
}

/// Joins a table with the frames by time. Its rows belong to some of the frames, in the same order.
class JoinedTable {
 public:
  explicit JoinedTable(const Table& table)
      : table_(table),
        time_ns_(std::get<std::vector<std::int64_t>>(table.find("time_ns")->values)) {}

  void append_names(std::string& text) const {
    each([&](const Column& column) { text += ',' + table_.name + '_' + column.name; });
  }
  void append_units(std::string& text) const {
    each([&](const Column& column) {
      append_comment(text, table_.name + '_' + column.name,
                     column.meaning + " [" + column.unit + "]");
    });
  }
  void append_row(std::string& text, std::int64_t time_ns) {
    while (row_ < time_ns_.size() && time_ns_[row_] < time_ns) ++row_;
    const bool joined = row_ < time_ns_.size() && time_ns_[row_] == time_ns;
    each([&](const Column& column) {
      text += ',';
      if (joined) append(text, column, row_);
    });
  }

 private:
  template <class Do>
  void each(Do action) const {
    for (const Column& column : table_.columns) {
      if (column.name != "time_s" && column.name != "time_ns" && column.name != "sequence") {
        action(column);
      }
    }
  }

  const Table& table_;
  const std::vector<std::int64_t>& time_ns_;
  std::size_t row_ = 0;
};

}  // namespace

void write_tables_csv(const Tables& tables, const std::filesystem::path& out,
                      const protocol::ProgressCallback& done) {
  std::ofstream file(out, std::ios::binary);
  const Table& frames = tables.tables.front();
  std::vector<JoinedTable> others;
  for (std::size_t i = 1; i < tables.tables.size(); ++i) others.emplace_back(tables.tables[i]);
  std::string text;
  for (const auto& [name, value] : description_texts(tables)) append_comment(text, name, value);
  for (const Column& column : frames.columns) {
    append_comment(text, column.name, column.meaning + " [" + column.unit + "]");
  }
  for (const JoinedTable& other : others) other.append_units(text);
  for (const Column& column : frames.columns) {
    text += (&column == frames.columns.data() ? "" : ",") + column.name;
  }
  for (const JoinedTable& other : others) other.append_names(text);
  text += '\n';
  const auto& time_ns = std::get<std::vector<std::int64_t>>(frames.find("time_ns")->values);
  for (std::size_t row = 0; row < frames.rows(); ++row) {
    if (done) done(static_cast<double>(row) / static_cast<double>(frames.rows()));
    for (const Column& column : frames.columns) {
      if (&column != frames.columns.data()) text += ',';
      append(text, column, row);
    }
    for (JoinedTable& other : others) other.append_row(text, time_ns[row]);
    text += '\n';
    if (text.size() > 1U << 16U) {
      file << text;
      text.clear();
    }
  }
  file << text;
  file.close();
  if (!file) {
    throw InputError(
        Problem{out.string(), 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }
}

}  // namespace stickslip::recording_export
