// SPDX-License-Identifier: Apache-2.0
// MATLAB 5: a struct of columns and a struct of their units for each table, and the description.
#include <matio.h>

#include <array>
#include <memory>

#include "physics/failure.h"
#include "physics/problem.h"
#include "tools/recording_export/write_tables.h"

namespace stickslip::recording_export {
namespace {

struct CloseFile {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using File = std::unique_ptr<mat_t, CloseFile>;
using Variable = std::unique_ptr<matvar_t, FreeVariable>;

// Maximum size of a variable of a MATLAB 5 file, including all fields of a struct.
constexpr std::uint64_t max_bytes = (1ULL << 31U) - (1U << 20U);

matvar_t* variable_of(const char* name, const Column& column) {
  const auto make = [&](matio_classes kind, matio_types type, const void* data) {
    std::array<std::size_t, 2> size = {column.rows(), 1};
    // matio copies the data; its interface lacks const.
    return Mat_VarCreate(name, kind, type, 2, size.data(),
                         const_cast<void*>(data),  // NOLINT(cppcoreguidelines-pro-type-const-cast)
                         0);
  };
  if (const auto* d = std::get_if<std::vector<double>>(&column.values)) {
    return make(MAT_C_DOUBLE, MAT_T_DOUBLE, d->data());
  }
  if (const auto* i = std::get_if<std::vector<std::int64_t>>(&column.values)) {
    return make(MAT_C_INT64, MAT_T_INT64, i->data());
  }
  return make(MAT_C_UINT8, MAT_T_UINT8, std::get<std::vector<std::uint8_t>>(column.values).data());
}

matvar_t* text_of(const char* name, const std::string& text) {
  std::array<std::size_t, 2> size = {text.empty() ? 0U : 1U, text.size()};
  // UTF-8, which matio preserves and MATLAB and Octave read.
  return Mat_VarCreate(
      name, MAT_C_CHAR, MAT_T_UTF8, 2, size.data(),
      const_cast<char*>(text.data()),  // NOLINT(cppcoreguidelines-pro-type-const-cast)
      0);
}

Variable struct_of(const std::string& name, const std::vector<std::string>& fields) {
  std::vector<const char*> names;
  for (const std::string& field : fields) names.push_back(field.c_str());
  std::array<std::size_t, 2> one = {1, 1};
  Variable out(Mat_VarCreateStruct(name.c_str(), 2, one.data(), names.data(),
                                   static_cast<unsigned>(names.size())));
  if (!out) throw Failure("not enough memory for a MATLAB struct");
  return out;
}

/// Passes ownership of the value to the struct.
void set_field(matvar_t* into, std::size_t field, matvar_t* value) {
  Mat_VarSetStructFieldByIndex(into, field, 0, value);
}

void write(mat_t* file, const Variable& variable, const std::filesystem::path& out) {
  if (Mat_VarWrite(file, variable.get(), MAT_COMPRESSION_ZLIB) != 0) {
    throw InputError(Problem{out.string(), 0, 0, "cannot be written: is there free space?"});
  }
}

void write_table(mat_t* file, const Table& table, const std::filesystem::path& out) {
  std::uint64_t bytes = 0;
  std::vector<std::string> names;
  for (const Column& column : table.columns) {
    names.push_back(column.name);
    bytes += 8 * static_cast<std::uint64_t>(column.rows());
  }
  if (bytes > max_bytes) {
    throw InputError(Problem{out.string(), 0, 0,
                             "a variable of a MATLAB 5 file is limited to 2 GiB, which " +
                                 table.name + " exceed: export to .h5, which MATLAB reads too"});
  }
  const Variable values = struct_of(table.name, names);
  const Variable units = struct_of(table.name + "_units", names);
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const Column& column = table.columns[i];
    set_field(values.get(), i, variable_of(column.name.c_str(), column));
    set_field(units.get(), i, text_of(column.name.c_str(), column.unit));
  }
  write(file, values, out);
  write(file, units, out);
}

}  // namespace

void write_tables_mat(const Tables& tables, const std::filesystem::path& out) {
  const std::string heading = "MATLAB 5.0 MAT-file, written by " +
                              (tables.written_by.empty() ? "stickslip" : tables.written_by);
  const File file(Mat_CreateVer(out.c_str(), heading.c_str(), MAT_FT_MAT5));
  if (!file) {
    throw InputError(Problem{out.string(), 0, 0,
                             "cannot be written; does its folder exist, is there free space?"});
  }
  for (const Table& table : tables.tables) write_table(file.get(), table, out);
  const auto texts = description_texts(tables);
  std::vector<std::string> names;
  for (const auto& [name, text] : texts) names.push_back(name);
  const Variable description = struct_of("description", names);
  for (std::size_t i = 0; i < texts.size(); ++i) {
    set_field(description.get(), i, text_of(texts[i].first.c_str(), texts[i].second));
  }
  write(file.get(), description, out);
}

}  // namespace stickslip::recording_export
