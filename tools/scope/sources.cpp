// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/sources.h"

#include <algorithm>
#include <utility>

#include "tools/scope/wire.h"

namespace stickslip::scope {

namespace {

constexpr auto replaced_after = std::chrono::milliseconds(1200);  // longer than between statuses
constexpr auto forgotten_after = std::chrono::seconds(60);
constexpr std::size_t most_senders = 16;  // one after another of one source

std::string_view address_of(std::string_view sender) { return sender.substr(0, sender.rfind(':')); }

}  // namespace

bool Sources::Source::has(std::string_view sender) const {
  return std::find(senders.begin(), senders.end(), sender) != senders.end();
}

Sources::Sources(FeedSettings settings, Send send)
    : settings_(std::move(settings)), send_(std::move(send)) {
  current_ = &add();
  list_ = list();
}

Sources::Source& Sources::add() {
  auto source = std::make_unique<Source>();
  const Source* const self = source.get();
  source->feed = std::make_unique<LiveFeed>(settings_, [this, self](const SharedMessage& message) {
    send_(message, [this, self](std::string_view wanted) { return &shown_for(wanted) == self; });
  });
  sources_.push_back(std::move(source));
  return *sources_.back();
}

Sources::Source* Sources::source_of(const std::string& sender, Clock::time_point now) {
  for (const auto& source : sources_) {
    if (!source->senders.empty() && source->senders.back() == sender) return source.get();
  }
  const auto replaced = std::find_if(sources_.begin(), sources_.end(), [&](const auto& source) {
    if (source->senders.empty()) return true;
    return address_of(source->senders.back()) == address_of(sender) && !source->feed->connected() &&
           now - source->heard_at > replaced_after;
  });
  if (replaced == sources_.end() && sources_.size() >= most) return nullptr;
  Source& source = replaced == sources_.end() ? add() : **replaced;
  source.senders.push_back(sender);
  if (source.senders.size() > most_senders) source.senders.erase(source.senders.begin());
  show(
      source, [&sender](std::string_view wanted) { return wanted == sender; }, now);
  return &source;
}

void Sources::take(const std::string& sender, std::string_view channel,
                   std::span<const std::uint8_t> bytes, double received_unix_ms,
                   Clock::time_point now) {
  Source* const source = source_of(sender, now);
  if (source == nullptr) return;
  if (source->begun_at == Clock::time_point{}) source->begun_at = now;
  source->heard_at = now;
  source->feed->take(channel, bytes, received_unix_ms, now);
  choose_current(now);
  send_list_if_changed();
}

void Sources::tick(Clock::time_point now) {
  for (const auto& source : sources_) source->feed->tick(now);
  replace_restarted(now);
  choose_current(now);
  forget_silent(now);
  send_list_if_changed();
}

const Sources::Source& Sources::shown_for(std::string_view wanted) const {
  const auto found = std::find_if(sources_.begin(), sources_.end(),
                                  [&](const auto& source) { return source->has(wanted); });
  return found == sources_.end() ? *current_ : **found;
}

void Sources::show(const Source& source, const Wants& pages, Clock::time_point now) const {
  send_(shared_message(encode_restart()), pages);
  for (const SharedMessage& message : source.feed->greeting(now)) send_(message, pages);
}

void Sources::choose_current(Clock::time_point now) {
  if (current_->feed->connected()) return;
  const auto live = std::find_if(sources_.begin(), sources_.end(),
                                 [](const auto& source) { return source->feed->connected(); });
  if (live == sources_.end()) return;
  const Source& next = **live;
  current_ = &next;
  // Pages that chose it see it already.
  show(
      next,
      [&](std::string_view wanted) { return &shown_for(wanted) == &next && !next.has(wanted); },
      now);
}

void Sources::replace_restarted(Clock::time_point now) {
  for (std::size_t i = sources_.size(); i-- > 0;) {
    const Source& old = *sources_[i];
    if (old.senders.empty() || old.feed->connected() || now - old.heard_at <= replaced_after) {
      continue;
    }
    const std::string& rig = old.feed->rig();
    const auto next = std::find_if(sources_.begin(), sources_.end(), [&](const auto& source) {
      return source->feed->connected() && source->begun_at > old.heard_at &&
             (rig.empty() || source->feed->rig() == rig) &&
             address_of(source->senders.back()) == address_of(old.senders.back());
    });
    if (next == sources_.end()) continue;
    Source& successor = **next;
    const Wants pages = [&](std::string_view wanted) {
      return old.has(wanted) || (&shown_for(wanted) == &old && !successor.has(wanted));
    };
    show(successor, pages, now);
    successor.senders.insert(successor.senders.begin(), old.senders.begin(), old.senders.end());
    if (&old == current_) current_ = &successor;
    sources_.erase(sources_.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

void Sources::forget_silent(Clock::time_point now) {
  for (std::size_t i = sources_.size(); i-- > 0;) {
    if (sources_[i].get() == current_ || now - sources_[i]->heard_at < forgotten_after) continue;
    const std::unique_ptr<Source> gone = std::move(sources_[i]);
    sources_.erase(sources_.begin() + static_cast<std::ptrdiff_t>(i));
    show(
        *current_, [&](std::string_view wanted) { return gone->has(wanted); }, now);
  }
}

SharedMessage Sources::list() const {
  std::vector<ListedSource> listed;
  for (const auto& source : sources_) {
    if (source->senders.empty()) continue;
    listed.push_back({source->senders, source->feed->rig(), source->feed->connected()});
  }
  const std::string current = current_->senders.empty() ? "" : current_->senders.back();
  return shared_message(encode_sources(current, listed));
}

void Sources::send_list_if_changed() {
  SharedMessage now = list();
  if (std::ranges::equal(now->payload(), list_->payload())) return;
  list_ = std::move(now);
  send_(list_, [](std::string_view) { return true; });
}

std::vector<SharedMessage> Sources::greeting(std::string_view wanted, Clock::time_point now) const {
  std::vector<SharedMessage> out = shown_for(wanted).feed->greeting(now);
  out.insert(out.begin() + 1, list_);
  return out;
}

}  // namespace stickslip::scope
