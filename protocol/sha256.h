// SPDX-License-Identifier: Apache-2.0
// SHA-256 digests.
#pragma once

#include <string>
#include <string_view>

namespace stickslip::protocol {

/// Digest in hexadecimal, 64 digits. Throws Failure if OpenSSL does not provide it.
std::string sha256_of(std::string_view bytes);

}  // namespace stickslip::protocol
