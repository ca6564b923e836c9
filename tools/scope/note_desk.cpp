// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/note_desk.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "physics/failure.h"

namespace stickslip::scope {

namespace {

constexpr double most_at_once = 10.0;

}  // namespace

NoteDesk::NoteDesk(Pass pass)
    : pass_(std::move(pass)), file_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)), credit_(most_at_once) {
  if (file_ < 0) throw Failure("no file for the answers to notes");
  thread_ = std::thread([this] { work(); });
}

NoteDesk::~NoteDesk() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
  close(file_);
}

std::string NoteDesk::submit(Note note, Clock::time_point now) {
  if (credited_at_) {
    const double seconds = std::chrono::duration<double>(now - *credited_at_).count();
    credit_ = std::min(most_at_once, credit_ + seconds);
  }
  credited_at_ = now;
  if (credit_ < 1.0) return "too many notes; wait a second";
  credit_ -= 1.0;
  {
    const std::lock_guard lock(mutex_);
    if (static_cast<double>(waiting_.size()) >= most_at_once) return "the daemon does not answer";
    waiting_.push_back(std::move(note));
  }
  changed_.notify_one();
  return {};
}

std::vector<NoteDesk::Answered> NoteDesk::answered() {
  eventfd_t count = 0;
  static_cast<void>(eventfd_read(file_, &count));
  const std::lock_guard lock(mutex_);
  return std::exchange(answered_, {});
}

void NoteDesk::work() {
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
    if (ending_) return;
    const Note note = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    std::string refusal = pass_(note);
    lock.lock();
    answered_.push_back({note.page, std::move(refusal)});
    lock.unlock();
    static_cast<void>(eventfd_write(file_, 1));
  }
}

}  // namespace stickslip::scope
