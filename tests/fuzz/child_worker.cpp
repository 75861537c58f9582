// SPDX-License-Identifier: BSD-3-Clause
// child_survives() for millions of files. A child of a process under the address sanitizer costs 12 ms, so
// one child tries file after file, and is replaced where it breaks down.
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "evpose/core/error.h"
#include "evpose/io/files/child_process.h"

namespace {

bool is_child = false;

constexpr int kFiles = 5000;  // by one child: what the library forgets to give back stays bounded

/// Of processor time. Small files take 1 to 5 ms, and up to one in forty sends the library into an endless
/// loop, which elsewhere ends after ten seconds or a gigabyte.
constexpr timeval kPatience{0, 12'000};  // s, us

class Worker {
 public:
  ~Worker() { end(); }

  bool survives(bool (*work)(const std::string&), const std::string& path) {
    if (files_ == kFiles) end();
    if (child_ < 0) start(work, path);
    ++files_;
    char byte = 0;
    if (::write(ask_, &byte, 1) == 1 && ::read(answer_, &byte, 1) == 1) return byte != 0;
    end();
    return false;
  }

 private:
  /// All files have the same name.
  void start(bool (*work)(const std::string&), const std::string& path) {
    int ask[2], answer[2];
    EVPOSE_CHECK(::pipe(ask) == 0 && ::pipe(answer) == 0);
    child_ = ::fork();
    EVPOSE_CHECK(child_ >= 0);
    const int theirs[] = {ask[0], answer[1]}, ours[] = {ask[1], answer[0]};
    for (const int end : child_ == 0 ? ours : theirs) ::close(end);
    if (child_ == 0) serve(work, path, theirs[0], theirs[1]);
    ask_ = ours[0];
    answer_ = ours[1];
    files_ = 0;
  }

  [[noreturn]] static void serve(bool (*work)(const std::string&), const std::string& path, int asked,
                                 int answer) noexcept {
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGINT, SIGTERM})
      std::signal(signal, SIG_DFL);
    is_child = true;
    const itimerval once{{}, kPatience};
    for (char byte = 0; ::read(asked, &byte, 1) == 1;) {
      ::setitimer(ITIMER_PROF, &once, nullptr);
      byte = work(path) ? 1 : 0;
      if (::write(answer, &byte, 1) != 1) break;
    }
    ::_exit(0);
  }

  void end() {
    if (child_ < 0) return;
    ::close(ask_);
    ::close(answer_);
    ::waitpid(child_, nullptr, 0);
    child_ = -1;
  }

  pid_t child_ = -1;
  int ask_ = -1, answer_ = -1, files_ = 0;
};

}  // namespace

/// Called before a report is written: the parent's own are the only ones to keep.
extern "C" void __asan_on_error();   // NOLINT(bugprone-reserved-identifier)
extern "C" void __asan_on_error() {  // NOLINT(bugprone-reserved-identifier)
  if (is_child) ::_exit(1);
}

namespace evpose {

bool child_survives(bool (*work)(const std::string& path), const std::string& path) {
  std::signal(SIGPIPE, SIG_IGN);
  static Worker worker;
  return worker.survives(work, path);
}

}  // namespace evpose
