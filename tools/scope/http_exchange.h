// Requests out of libwebsockets, and answers into it.
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

/// The headers that every answer has, whatever it is, as libwebsockets wants them: a list that it
/// keeps pointers into.
class FixedHeaders {
 public:
  FixedHeaders();
  FixedHeaders(const FixedHeaders&) = delete;
  FixedHeaders& operator=(const FixedHeaders&) = delete;
  const lws_protocol_vhost_options* first() const { return list_.data(); }

 private:
  std::vector<lws_protocol_vhost_options> list_;
};

/// A request's parts, copied out.
struct ReceivedRequest {
  explicit ReceivedRequest(lws* wsi);
  Request view() const { return {method, path, host, origin, token}; }

  std::string method;
  std::string path;
  std::string host;
  std::string origin;
  std::string token;
  std::string subprotocol;    ///< of a WebSocket
  std::string if_none_match;  ///< the tag of what the browser has
};

struct Answer {
  unsigned status = 200;
  std::string_view content_type = "text/plain; charset=utf-8";
  std::string tag;  ///< by which a browser finds that it has this already; empty: never kept
  std::string body;
};

/// An answer that says why there is none.
Answer answer_for(const Refusal& refusal);

/// The files of the page, each with its tag.
class PageFiles {
 public:
  PageFiles();
  /// The file at that path, or that the browser has it, or that there is none.
  Answer answer_to(const ReceivedRequest& request) const;

 private:
  struct TaggedFile {
    const PageFile* file = nullptr;
    std::string tag;
  };
  std::map<std::string_view, TaggedFile> files_;
};

/// Writes status and headers; false where the connection is gone.
bool write_head(lws* wsi, const Answer& answer);

}  // namespace stickslip::scope
