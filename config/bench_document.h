// The bench of real devices in a rig's file.
#pragma once

#include <filesystem>

#include "config/bench.h"
#include "config/document.h"
#include "config/rig.h"

namespace stickslip::config {

/// What the file of a rig with driver.kind = "bench" says of its devices, register maps included.
/// Paths are relative to `folder`. Only while the document is sound; what does not fit together is
/// reported in it.
Bench read_bench(Document& document, const std::filesystem::path& folder);

/// What the bench's keys mean together with the rest of the rig.
void check_bench(Document& document, const Rig& rig);

/// The file of a rig on another driver says something of a bench: reported.
void refuse_bench(Document& document);

}  // namespace stickslip::config
