// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/fed_program.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

extern char** environ;

namespace evpose {
namespace {

/// 0, or why it could not be started.
int spawn(const std::vector<std::string>& command, int input, pid_t* process) {
  std::vector<char*> words;
  for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  if (const int error = ::posix_spawn_file_actions_init(&actions)) return error;
  ::posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  for (const int output : {STDOUT_FILENO, STDERR_FILENO})
    ::posix_spawn_file_actions_addopen(&actions, output, "/dev/null", O_WRONLY, 0);
  const int error = ::posix_spawnp(process, words[0], &actions, nullptr, words.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  return error;
}

}  // namespace

Expected<FedProgram> FedProgram::start(const std::vector<std::string>& command) {
  // A socket, not a pipe: writing to a program that has ended is then an error and no signal.
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    return Error{command[0], std::string("cannot be fed: ") + std::strerror(errno), "free some files"};
  pid_t process = -1;
  const int error = spawn(command, ends[0], &process);
  ::close(ends[0]);
  if (error == 0) return FedProgram(command[0], ends[1], process);
  ::close(ends[1]);
  if (error == ENOENT) return Error{command[0], "is not installed", "install the package " + command[0]};
  return Error{command[0], std::string("cannot be started: ") + std::strerror(error), "check the program"};
}

FedProgram::FedProgram(FedProgram&& other) noexcept
    : name_(std::move(other.name_)),
      input_(std::exchange(other.input_, -1)),
      process_(std::exchange(other.process_, -1)) {}

FedProgram::~FedProgram() { end(); }

Status FedProgram::write(std::span<const std::byte> data) {
  while (!data.empty()) {
    const ssize_t sent = ::send(input_, data.data(), data.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return Error{name_, "has ended before all was written", "check the free space of the disk"};
    data = data.subspan(static_cast<std::size_t>(sent));
  }
  return {};
}

int FedProgram::end() {
  if (input_ >= 0) ::close(std::exchange(input_, -1));
  if (process_ < 0) return 0;
  int status = 0;
  while (::waitpid(process_, &status, 0) < 0)
    if (errno != EINTR) break;
  process_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

Status FedProgram::finish() {
  if (const int status = end(); status != 0)
    return Error{name_, text("failed with status ", status), "check the free space of the disk"};
  return {};
}

}  // namespace evpose
