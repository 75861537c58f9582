// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>

#include "evpose/core/error.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// Of more events a second than are wanted, every k-th.
class EvenShare {
 public:
  explicit EvenShare(double most_mev_s) : most_mev_s_(most_mev_s) {}
  EventPacket of(const EventPacket& packet);
  TimeNs newest() const { return newest_; }  ///< event that came; 0: none has

 private:
  double most_mev_s_;
  TimeNs newest_ = 0;
  double allowed_ = 0;  ///< events that may be taken now
};

/// Finds a lost pose while another tracker, or none, goes on: a tracker that searches, or aligns its first
/// view, runs on a thread of its own behind a queue of all that comes, falls behind meanwhile, and catches up
/// on what has waited.
/// The queue is bounded: of more events than kMost_mev_s an even share is taken.
class Recovery {
 public:
  static constexpr double kMost_mev_s = 3;
  static constexpr std::size_t kMostWaiting = 30'000'000;  ///< events; ten seconds of search

  using Make = std::function<Expected<std::unique_ptr<Tracker>>()>;
  /// `make` is called on the thread; events that come before it is done are left out. `waits`: add_...()
  /// return when all is tracked, so that what comes out does not depend on the machine.
  Recovery(Make make, bool waits);
  ~Recovery();
  Recovery(const Recovery&) = delete;
  Recovery& operator=(const Recovery&) = delete;

  void add_events(const EventPacket& packet);
  void add_imu(const ImuSample& sample);

  /// The tracker once its pose is `tracking` and it has caught up; null before. Ends the search.
  std::unique_ptr<Tracker> take();
  /// The data time that its tracker has come to; lowest before its first update.
  TimeNs reached() const;
  /// Its tracker has the pose, and catches up if it has not been taken.
  bool tracks() const;
  /// Its tracker does not search, and has to.
  bool needs_search() const;
  /// The poses that explain the events alike, in words, once each time there are several; else empty.
  std::string take_ambiguous();
  /// It cannot be made, or too much waits.
  bool failed() const;
  /// Asks the thread to end, which it does when its tracker returns from what it does.
  void give_up();
  /// The thread has ended: the destructor does not wait.
  bool ended() const;

 private:
  using Item = std::variant<ImuSample, EventPacket>;
  void run(const Make& make);
  void feed(const Item& item, TimeNs newest);
  void push(std::unique_lock<std::mutex>& lock, Item item);

  const bool waits_;
  mutable std::mutex mutex_;
  std::condition_variable filled_, emptied_;
  std::deque<Item> items_;
  std::size_t waiting_ = 0;  ///< events
  bool made_ = false, failed_ = false, stopped_ = false, ended_ = false, busy_ = false, needs_search_ = false;
  EvenShare share_{kMost_mev_s};
  std::optional<Update> last_;        ///< of the tracker
  std::string ambiguous_;             ///< not taken yet
  std::unique_ptr<Tracker> tracker_;  ///< the thread's until it has ended
  std::thread thread_;
};

}  // namespace evpose
