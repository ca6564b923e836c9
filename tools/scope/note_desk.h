// SPDX-License-Identifier: Apache-2.0
// Notes from pages on their way to the daemon.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace stickslip::scope {

struct Note {
  std::uint64_t page = 0;  ///< the stream that it came from
  std::string text;
  std::string rig;  ///< that the page shows; empty: unknown
};

/// Passes notes on, one after another, in a thread of its own: a daemon that does not answer delays
/// no page. `submit` and `answered` are for one thread.
class NoteDesk {
 public:
  using Clock = std::chrono::steady_clock;
  /// Passes a note on; empty if it was taken, else why not. Called in the desk's thread.
  using Pass = std::function<std::string(const Note&)>;

  struct Answered {
    std::uint64_t page = 0;
    std::string refusal;  ///< empty: the note was taken
  };

  explicit NoteDesk(Pass pass);
  /// Waits for the note that is being passed on.
  ~NoteDesk();
  NoteDesk(const NoteDesk&) = delete;
  NoteDesk& operator=(const NoteDesk&) = delete;

  /// Empty if the note will be passed on; else why not: more than ten at once, or more than one per
  /// second.
  std::string submit(Note note, Clock::time_point now);

  /// Readable when there is something in `answered`.
  int file() const { return file_; }
  std::vector<Answered> answered();

 private:
  void work();

  Pass pass_;
  int file_;
  double credit_;
  std::optional<Clock::time_point> credited_at_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Note> waiting_;
  std::vector<Answered> answered_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace stickslip::scope
