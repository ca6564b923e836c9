// SPDX-License-Identifier: Apache-2.0
// Requests from and answers to libwebsockets.
#pragma once

#include <libwebsockets.h>

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/scope/page.h"
#include "tools/scope/request.h"

namespace stickslip::scope {

/// The headers of every answer, as the linked list that libwebsockets keeps pointers into.
class FixedHeaders {
 public:
  FixedHeaders();
  FixedHeaders(const FixedHeaders&) = delete;
  FixedHeaders& operator=(const FixedHeaders&) = delete;
  const lws_protocol_vhost_options* first() const { return list_.data(); }

 private:
  std::vector<lws_protocol_vhost_options> list_;
};

/// A copy of the parts of a request.
struct ReceivedRequest {
  explicit ReceivedRequest(lws* wsi);
  Request view() const { return {method, path, host, origin, token}; }

  std::string method;
  std::string path;
  std::string host;
  std::string origin;
  std::string token;
  std::string source;         ///< that the page wants to see; empty: none
  std::string subprotocol;    ///< of a WebSocket
  std::string if_none_match;  ///< the tag of the browser's copy
};

struct Answer {
  unsigned status = 200;
  std::string_view content_type = "text/plain; charset=utf-8";
  std::string tag;  ///< ETag; empty: not cached
  std::string body;
};

/// The answer to a rejected request.
Answer answer_for(const Refusal& refusal);

/// The files of the page, each with its tag.
class PageFiles {
 public:
  PageFiles();
  /// 200 with the file, 304 or 404.
  Answer answer_to(const ReceivedRequest& request) const;

 private:
  struct TaggedFile {
    const PageFile* file = nullptr;
    std::string tag;
  };
  std::map<std::string_view, TaggedFile> files_;
};

/// Writes status and headers; false if the connection is closed.
bool write_head(lws* wsi, const Answer& answer);

}  // namespace stickslip::scope
