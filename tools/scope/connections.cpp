// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/connections.h"

#include <algorithm>

namespace stickslip::scope {

namespace {

bool is_of(const Connection& connection, const std::string* peer) {
  return peer == nullptr || connection.peer == *peer;
}

bool is_overdue(const Connection& connection, const TimeLimits& limits, Clock::time_point now) {
  const auto age = now - connection.since;
  switch (connection.stage) {
    case Stage::requesting:
      return age > limits.request;
    case Stage::answering:
      return age > limits.answer;
    case Stage::streaming:
      return connection.backlog.losing_for(now) > limits.losing;
  }
  return true;
}

}  // namespace

void Connections::add(lws* wsi, Connection connection) {
  map_.insert_or_assign(wsi, std::move(connection));
}

Connection* Connections::find(lws* wsi) {
  const auto found = map_.find(wsi);
  return found == map_.end() ? nullptr : &found->second;
}

void Connections::erase(lws* wsi) { map_.erase(wsi); }

std::size_t Connections::streams(const std::string* peer) const {
  return static_cast<std::size_t>(std::count_if(map_.begin(), map_.end(), [peer](const auto& each) {
    return each.second.stage == Stage::streaming && is_of(each.second, peer);
  }));
}

std::size_t Connections::requests(const std::string* peer) const {
  return static_cast<std::size_t>(std::count_if(map_.begin(), map_.end(), [peer](const auto& each) {
    return each.second.stage != Stage::streaming && is_of(each.second, peer);
  }));
}

lws* Connections::oldest_request(const std::string* peer) const {
  const Map::value_type* oldest = nullptr;
  for (const auto& each : map_) {
    if (each.second.stage != Stage::requesting || !is_of(each.second, peer)) continue;
    if (oldest == nullptr || each.second.since < oldest->second.since) oldest = &each;
  }
  return oldest == nullptr ? nullptr : oldest->first;
}

std::vector<lws*> Connections::overdue(const TimeLimits& limits, Clock::time_point now) const {
  std::vector<lws*> out;
  for (const auto& [wsi, connection] : map_) {
    if (is_overdue(connection, limits, now)) out.push_back(wsi);
  }
  return out;
}

}  // namespace stickslip::scope
