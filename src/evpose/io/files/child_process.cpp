// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/child_process.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>

namespace evpose {
namespace {

template <class Resource>
void limit(Resource resource, rlim_t most) {
  rlimit now{};
  if (::getrlimit(resource, &now) != 0) return;
  now.rlim_cur = std::min(most, now.rlim_max);
  ::setrlimit(resource, &now);
}

/// Of this process, bytes; 0: unknown.
rlim_t address_space() {
  long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%ld", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

/// An exception would leave the child going on as if it were its parent.
int verdict(bool (*work)(const std::string& path), const std::string& path) {
  try {
    return work(path) ? 0 : 1;
  } catch (...) {
    return 1;
  }
}

}  // namespace

bool child_survives(bool (*work)(const std::string& path), const std::string& path) {
  const pid_t child = ::fork();
  if (child < 0) return true;
  if (child == 0) {
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) std::signal(signal, SIG_DFL);
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_CPU, 10);
    if (const rlim_t now = address_space(); now > 0) limit(RLIMIT_AS, now + (rlim_t{1} << 30));
    ::_exit(verdict(work, path));
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return true;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace evpose
