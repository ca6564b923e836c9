// SPDX-License-Identifier: Apache-2.0
#include "protocol/sha256.h"

#include <openssl/evp.h>

#include <array>

#include "physics/failure.h"

namespace stickslip::protocol {

std::string sha256_of(std::string_view bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1) {
    throw Failure("SHA-256 is not available: is the installation of OpenSSL complete?");
  }
  constexpr std::string_view digits = "0123456789abcdef";
  std::string text;
  for (unsigned i = 0; i < length; ++i) {
    text += digits[digest[i] >> 4U];
    text += digits[digest[i] & 15U];
  }
  return text;
}

}  // namespace stickslip::protocol
