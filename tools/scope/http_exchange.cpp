// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/http_exchange.h"

#include <array>

#include "protocol/sha256.h"

namespace stickslip::scope {

namespace {

/// A page may load from this server only, and may not be embedded.
constexpr const char* content_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

struct Header {
  const char* name;
  const char* value;
};
constexpr std::array<Header, 7> fixed_headers = {{
    {"content-security-policy:", content_policy},
    {"x-content-type-options:", "nosniff"},
    // The page's URL contains the token.
    {"referrer-policy:", "no-referrer"},
    {"x-frame-options:", "DENY"},
    {"cross-origin-opener-policy:", "same-origin"},
    {"cross-origin-embedder-policy:", "require-corp"},
    {"cross-origin-resource-policy:", "same-origin"},
}};

std::string header_of(lws* wsi, lws_token_indexes which) {
  const int size = lws_hdr_total_length(wsi, which);
  if (size <= 0) return {};
  std::string out(static_cast<std::size_t>(size) + 1, '\0');
  const int copied = lws_hdr_copy(wsi, out.data(), static_cast<int>(out.size()), which);
  out.resize(copied > 0 ? static_cast<std::size_t>(copied) : 0);
  return out;
}

/// The unescaped value of `name` in the query.
std::string argument_of(lws* wsi, std::string_view name) {
  std::array<char, 1024> text{};
  for (int i = 0; i < 16; ++i) {
    const int size = lws_hdr_copy_fragment(wsi, text.data(), static_cast<int>(text.size()),
                                           WSI_TOKEN_HTTP_URI_ARGS, i);
    if (size < 0) break;
    const std::string_view argument(text.data(), static_cast<std::size_t>(size));
    if (argument.starts_with(name) && argument.substr(name.size()).starts_with('=')) {
      return std::string(argument.substr(name.size() + 1));
    }
  }
  return {};
}

struct MethodToken {
  lws_token_indexes token;
  std::string_view method;
};
constexpr std::array<MethodToken, 8> methods = {{{WSI_TOKEN_GET_URI, "GET"},
                                                 {WSI_TOKEN_HEAD_URI, "HEAD"},
                                                 {WSI_TOKEN_POST_URI, "POST"},
                                                 {WSI_TOKEN_PUT_URI, "PUT"},
                                                 {WSI_TOKEN_PATCH_URI, "PATCH"},
                                                 {WSI_TOKEN_DELETE_URI, "DELETE"},
                                                 {WSI_TOKEN_OPTIONS_URI, "OPTIONS"},
                                                 {WSI_TOKEN_CONNECT, "CONNECT"}}};

}  // namespace

FixedHeaders::FixedHeaders() {
  for (const Header& each : fixed_headers) {
    list_.push_back({nullptr, nullptr, each.name, each.value});
  }
  for (std::size_t i = 0; i + 1 < list_.size(); ++i) list_[i].next = &list_[i + 1];
}

ReceivedRequest::ReceivedRequest(lws* wsi)
    : host(header_of(wsi, WSI_TOKEN_HOST)),
      origin(header_of(wsi, WSI_TOKEN_ORIGIN)),
      token(argument_of(wsi, "token")),
      source(argument_of(wsi, "source")),
      subprotocol(header_of(wsi, WSI_TOKEN_PROTOCOL)),
      if_none_match(header_of(wsi, WSI_TOKEN_HTTP_IF_NONE_MATCH)) {
  for (const MethodToken& each : methods) {
    if (lws_hdr_total_length(wsi, each.token) <= 0) continue;
    method = each.method;
    path = header_of(wsi, each.token);
  }
}

Answer answer_for(const Refusal& refusal) {
  Answer answer;
  answer.status = static_cast<unsigned>(refusal.status);
  answer.body = refusal.reason + "\n";
  return answer;
}

PageFiles::PageFiles() {
  for (const PageFile& file : page_files()) {
    const std::string_view text(reinterpret_cast<const char*>(file.content.data()),
                                file.content.size());
    files_[file.path] = {&file, '"' + protocol::sha256_of(text).substr(0, 32) + '"'};
  }
}

Answer PageFiles::answer_to(const ReceivedRequest& request) const {
  const auto found = files_.find(request.path == "/index.html" ? "/" : request.path);
  if (found == files_.end()) return answer_for({404, "no such file"});
  Answer answer;
  answer.content_type = found->second.file->content_type;
  answer.tag = found->second.tag;
  if (request.if_none_match == answer.tag) {
    answer.status = 304;
    return answer;
  }
  const auto content = found->second.file->content;
  answer.body.assign(reinterpret_cast<const char*>(content.data()), content.size());
  return answer;
}

bool write_head(lws* wsi, const Answer& answer) {
  std::array<unsigned char, LWS_PRE + 2048> buffer{};
  unsigned char* const start = buffer.data() + LWS_PRE;
  unsigned char* at = start;
  unsigned char* const end = buffer.data() + buffer.size();
  const auto add = [&](lws_token_indexes name, std::string_view value) {
    return lws_add_http_header_by_token(wsi, name,
                                        reinterpret_cast<const unsigned char*>(value.data()),
                                        static_cast<int>(value.size()), &at, end) == 0;
  };
  const bool has_length = answer.status != 304;
  return lws_add_http_header_status(wsi, answer.status, &at, end) == 0 &&
         add(WSI_TOKEN_HTTP_CONTENT_TYPE, answer.content_type) &&
         (!has_length ||
          lws_add_http_header_content_length(wsi, answer.body.size(), &at, end) == 0) &&
         // Revalidated on every load.
         add(WSI_TOKEN_HTTP_CACHE_CONTROL, answer.tag.empty() ? "no-store" : "no-cache") &&
         (answer.tag.empty() || add(WSI_TOKEN_HTTP_ETAG, answer.tag)) &&
         (answer.status != 405 || add(WSI_TOKEN_HTTP_ALLOW, "GET, HEAD")) &&
         lws_finalize_write_http_header(wsi, start, &at, end) == 0;
}

}  // namespace stickslip::scope
