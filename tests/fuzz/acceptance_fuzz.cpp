// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes as the record of an acceptance: refused as InputError, or read, written and read
// again without a change, and shown as a page.
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "physics/problem.h"
#include "tools/commissioning/page.h"
#include "tools/commissioning/record.h"

using namespace stickslip::commissioning;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  Record record;
  try {
    record = parse_record(text, "commissioned.json");
  } catch (const stickslip::InputError&) {
    return 0;
  }
  const std::string written = json_of(record);
  if (json_of(parse_record(written, "commissioned.json")) != written) {
    throw std::logic_error("a record is read as it was written");
  }
  if (page_of(record).empty() || summary_of(record).empty()) {
    throw std::logic_error("every record has a page");
  }
  static_cast<void>(delays_toml(record));
  return 0;
}
