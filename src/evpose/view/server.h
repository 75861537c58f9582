// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "evpose/core/error.h"

namespace evpose {

struct ServerConfig {
  std::string address = "127.0.0.1";  ///< of this machine, in numbers
  int port = 8088;                    ///< 0: any that is free
};

/// Pages and a stream of messages for browsers: GET and a WebSocket at /stream, nothing else; what a browser
/// sends is not looked at. Pages are those that are set here, so that no path leads to a file. Only pages of
/// this server may open the stream (Origin), and only by a name of this machine (Host) while it is bound to
/// loopback. Clients, requests and what waits for a client that does not read are bounded.
class Server {
 public:
  struct Message {
    std::shared_ptr<const std::string> bytes;
    bool binary = false;
  };
  /// Errors: no address of this machine, the port is in use.
  static Expected<std::unique_ptr<Server>> start(const ServerConfig& config);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// From any thread. `path` begins with a slash.
  void set_page(const std::string& path, const std::string& content_type, std::string content);
  /// Made anew for each request, on the server's thread.
  void set_page(const std::string& path, const std::string& content_type, std::function<std::string()> make);
  /// To all clients; one that is behind misses it.
  void publish(const Message& message);

  int port() const;
  int clients() const;          ///< of the stream
  std::string address() const;  ///< "http://127.0.0.1:8088/"

 private:
  struct Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace evpose
