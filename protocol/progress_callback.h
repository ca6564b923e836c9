// SPDX-License-Identifier: Apache-2.0
// Progress of reading or writing a file.
#pragma once

#include <cstddef>
#include <functional>

namespace stickslip::protocol {

/// Called often with the completed share, 0 to 1, by the working thread; may be empty. Must be
/// cheap.
using ProgressCallback = std::function<void(double)>;

/// Callback for one of `all` equal parts of which `before` are complete. `whole` must outlive it.
ProgressCallback progress_of_part(const ProgressCallback& whole, std::size_t before,
                                  std::size_t all);

}  // namespace stickslip::protocol
