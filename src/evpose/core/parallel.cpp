// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>

#include "evpose/core/error.h"

namespace evpose {

struct ThreadPool::Job {
  std::size_t count, chunk_size;
  const std::function<void(std::size_t, std::size_t, std::size_t)>* body;
  std::atomic<std::size_t> next{0};
  std::mutex error_mutex;
  std::exception_ptr error;
};

ThreadPool::ThreadPool(int threads) {
  EVPOSE_CHECK(threads >= 1);
  for (int i = 1; i < threads; ++i) workers_.emplace_back([this] { run(); });
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  for (auto& w : workers_) w.join();
}

void ThreadPool::work(Job& job) {
  const std::size_t total = chunks(job.count, job.chunk_size);
  for (std::size_t c = job.next++; c < total; c = job.next++) {
    try {
      (*job.body)(c, c * job.chunk_size, std::min(job.count, (c + 1) * job.chunk_size));
    } catch (...) {
      const std::lock_guard lock(job.error_mutex);
      if (!job.error) job.error = std::current_exception();
    }
  }
}

void ThreadPool::run() {
  std::uint64_t seen = 0;
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [&] { return stop_ || (job_ != nullptr && generation_ != seen); });
    if (stop_) return;
    seen = generation_;
    Job& job = *job_;
    ++busy_;
    lock.unlock();
    work(job);
    lock.lock();
    if (--busy_ == 0) done_.notify_all();
  }
}

void ThreadPool::for_chunks(std::size_t count, std::size_t chunk_size,
                            const std::function<void(std::size_t, std::size_t, std::size_t)>& body) {
  EVPOSE_CHECK(chunk_size > 0);
  Job job;
  job.count = count;
  job.chunk_size = chunk_size;
  job.body = &body;
  if (workers_.empty() || count <= chunk_size) {
    work(job);
  } else {
    {
      const std::lock_guard lock(mutex_);
      job_ = &job;
      ++generation_;
    }
    wake_.notify_all();
    work(job);
    std::unique_lock lock(mutex_);
    job_ = nullptr;  // a worker that wakes only now finds nothing to do
    done_.wait(lock, [&] { return busy_ == 0; });
  }
  if (job.error) std::rethrow_exception(job.error);
}

}  // namespace evpose
