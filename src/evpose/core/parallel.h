// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace evpose {

/// Runs the chunks of a loop on a fixed set of threads. The chunks depend on the loop alone, never on the
/// number of threads; a sum made per chunk and added in the order of the chunks is therefore the same for any
/// number.
class ThreadPool {
 public:
  /// `threads` >= 1 counts the caller, which works too.
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int threads() const { return static_cast<int>(workers_.size()) + 1; }

  /// Calls body(chunk, begin, end) for each chunk of at most `chunk_size` of the indices 0 .. count-1, each
  /// once, in any order; returns when all are done. Not reentrant. The first exception of a body is thrown
  /// again here.
  void for_chunks(std::size_t count, std::size_t chunk_size,
                  const std::function<void(std::size_t chunk, std::size_t begin, std::size_t end)>& body);

  static std::size_t chunks(std::size_t count, std::size_t chunk_size) {
    return (count + chunk_size - 1) / chunk_size;
  }

 private:
  struct Job;
  void work(Job& job);
  void run();

  std::vector<std::thread> workers_;
  std::mutex mutex_;
  std::condition_variable wake_, done_;
  Job* job_ = nullptr;
  std::uint64_t generation_ = 0;
  int busy_ = 0;
  bool stop_ = false;
};

}  // namespace evpose
