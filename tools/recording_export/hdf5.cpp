// SPDX-License-Identifier: Apache-2.0
// HDF5: a group for each table, a dataset for each column with its unit and meaning as attributes,
// and the description as attributes of the file.
#include <hdf5.h>

#include <type_traits>
#include <utility>

#include "physics/problem.h"
#include "tools/recording_export/write_tables.h"

namespace stickslip::recording_export {
namespace {

/// Owner of an HDF5 identifier.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t), const std::filesystem::path& file)
      : id_(id), close_(close) {
    if (id_ < 0) throw_write_error(file);
  }
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }

  /// Closes and checks the result: the library may write only on closing.
  void close(const std::filesystem::path& file) {
    const hid_t id = std::exchange(id_, -1);
    if (close_(id) < 0) throw_write_error(file);
  }

  [[noreturn]] static void throw_write_error(const std::filesystem::path& file) {
    throw InputError(Problem{file.string(), 0, 0,
                             "cannot be written; does its folder exist, is there free space?"});
  }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

class Writer {
 public:
  explicit Writer(const std::filesystem::path& out)
      : out_(out),
        file_(H5Fcreate(out.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose, out) {}

  void write(const Tables& tables) {
    for (const auto& [name, text] : description_texts(tables)) attribute(file_, name, text);
    for (const Table& table : tables.tables) write(table);
    file_.close(out_);
  }

 private:
  void write(const Table& table) {
    const Handle group(H5Gcreate2(file_, table.name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                       H5Gclose, out_);
    attribute(group, "meaning", "a row is " + table.meaning);
    for (const Column& column : table.columns) {
      const hsize_t rows = column.rows();
      const Handle space(H5Screate_simple(1, &rows, nullptr), H5Sclose, out_);
      std::visit(
          [&](const auto& values) {
            using Number = typename std::decay_t<decltype(values)>::value_type;
            const hid_t type = std::is_same_v<Number, double>         ? H5T_NATIVE_DOUBLE
                               : std::is_same_v<Number, std::int64_t> ? H5T_NATIVE_INT64
                                                                      : H5T_NATIVE_UINT8;
            const Handle data(H5Dcreate2(group, column.name.c_str(), type, space, H5P_DEFAULT,
                                         H5P_DEFAULT, H5P_DEFAULT),
                              H5Dclose, out_);
            if (H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
              Handle::throw_write_error(out_);
            }
            attribute(data, "unit", column.unit);
            attribute(data, "meaning", column.meaning);
          },
          column.values);
    }
  }

  // UTF-8 with a terminating zero, since HDF5 has no strings of length 0. Attributes are limited to
  // 64 kB without dense storage: longer texts are written as a dataset of that name.
  void attribute(hid_t of, const std::string& name, const std::string& text) {
    const Handle type(H5Tcopy(H5T_C_S1), H5Tclose, out_);
    H5Tset_size(type, text.size() + 1);
    H5Tset_cset(type, H5T_CSET_UTF8);
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose, out_);
    if (text.size() < 60000) {
      const Handle attribute(H5Acreate2(of, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT),
                             H5Aclose, out_);
      if (H5Awrite(attribute, type, text.c_str()) < 0) Handle::throw_write_error(out_);
      return;
    }
    const Handle data(
        H5Dcreate2(of, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose,
        out_);
    if (H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.c_str()) < 0) {
      Handle::throw_write_error(out_);
    }
  }

  std::filesystem::path out_;
  Handle file_;
};

}  // namespace

void write_tables_hdf5(const Tables& tables, const std::filesystem::path& out) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // errors are reported by exceptions
  Writer(out).write(tables);
}

}  // namespace stickslip::recording_export
