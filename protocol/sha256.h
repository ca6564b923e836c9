// The SHA-256 of bytes: by which a text is known again.
#pragma once

#include <string>
#include <string_view>

namespace stickslip::protocol {

/// In hexadecimal, 64 digits. Throws std::runtime_error where OpenSSL does not offer it.
std::string sha256_of(std::string_view bytes);

}  // namespace stickslip::protocol
