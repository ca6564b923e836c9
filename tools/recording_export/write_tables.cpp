// SPDX-License-Identifier: Apache-2.0
#include "tools/recording_export/write_tables.h"

#include <string>

#include "physics/problem.h"

namespace stickslip::recording_export {

void write_tables(const Tables& tables, const std::filesystem::path& out,
                  const protocol::ProgressCallback& done) {
  const std::string ending = out.extension().string();
  if (ending == ".csv") return write_tables_csv(tables, out, done);
  if (ending == ".mat") return write_tables_mat(tables, out);
  if (ending == ".h5" || ending == ".hdf5") return write_tables_hdf5(tables, out);
  throw InputError(
      Problem{out.string(), 0, 0, "has no known extension; expected .csv, .mat or .h5"});
}

}  // namespace stickslip::recording_export
