// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/view/server.h"

#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

namespace evpose {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using Fault = boost::system::error_code;

constexpr int kMostConnections = 64;
constexpr std::size_t kMostWaiting = 8;  // messages for a client that does not keep up
constexpr std::size_t kMostHeader = 8192, kMostFromClient = 4096;
constexpr auto kPatience = std::chrono::seconds(20);

/// The page may load and connect to nothing but this server.
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; connect-src 'self' ws: wss:; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'";

std::string host_of(std::string authority) {
  const auto colon = authority.rfind(':');
  if (colon != std::string::npos && authority.find(']', colon) == std::string::npos) authority.resize(colon);
  return authority;
}

struct Page {
  std::string content_type;
  std::function<std::string()> make;
};

}  // namespace

/// What the connections share; all but the pages and the counts lives on the server's thread.
struct Server::Impl {
  explicit Impl(ServerConfig c) : config(std::move(c)), acceptor(io) {}

  class Stream;
  class Connection;

  bool host_allowed(const std::string& host) const {
    const std::string name = host_of(host);
    if (!loopback) return true;
    return name == "localhost" || name == "127.0.0.1" || name == "[::1]" || name == config.address;
  }
  std::optional<Page> page(const std::string& path) {
    const std::lock_guard lock(mutex);
    const auto found = pages.find(path);
    if (found == pages.end()) return std::nullopt;
    return found->second;
  }
  void accept();

  ServerConfig config;
  bool loopback = true;
  asio::io_context io{1};
  tcp::acceptor acceptor;
  std::mutex mutex;
  std::map<std::string, Page> pages;
  std::set<std::shared_ptr<Stream>> streams;
  std::atomic<int> stream_count{0};
  int connections = 0;
  std::thread thread;
};

/// One client of the stream. Messages wait in a short queue; a client that is behind misses the oldest.
class Server::Impl::Stream : public std::enable_shared_from_this<Stream> {
 public:
  Stream(Impl& server, tcp::socket socket) : server_(server), socket_(std::move(socket)) {}

  void start(const http::request<http::empty_body>& request) {
    auto timeout = websocket::stream_base::timeout::suggested(beast::role_type::server);
    timeout.idle_timeout = kPatience;
    timeout.keep_alive_pings = true;
    socket_.set_option(timeout);
    socket_.read_message_max(kMostFromClient);
    socket_.async_accept(request, [self = shared_from_this()](Fault fault) {
      if (fault) return;
      self->server_.streams.insert(self);
      self->server_.stream_count = static_cast<int>(self->server_.streams.size());
      self->read();
    });
  }

  void send(const Message& message) {
    if (waiting_.size() >= kMostWaiting) waiting_.erase(waiting_.begin() + (writing_ ? 1 : 0));
    waiting_.push_back(message);
    if (!writing_) write();
  }

  void close() {
    beast::get_lowest_layer(socket_).close();
    leave();
  }

 private:
  /// What a client says is not looked at; reading keeps the connection's housekeeping going.
  void read() {
    socket_.async_read(from_client_, [self = shared_from_this()](Fault fault, std::size_t) {
      if (fault) return self->leave();
      self->from_client_.clear();
      self->read();
    });
  }

  void write() {
    writing_ = true;
    socket_.binary(waiting_.front().binary);
    socket_.async_write(asio::buffer(*waiting_.front().bytes),
                        [self = shared_from_this()](Fault fault, std::size_t) {
                          if (fault) return self->leave();
                          self->waiting_.pop_front();
                          self->writing_ = false;
                          if (!self->waiting_.empty()) self->write();
                        });
  }

  void leave() {
    if (server_.streams.erase(shared_from_this()) > 0)
      server_.stream_count = static_cast<int>(server_.streams.size());
  }

  Impl& server_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer from_client_;
  std::deque<Message> waiting_;
  bool writing_ = false;
};

/// One connection: requests for pages, until it becomes a stream.
class Server::Impl::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Impl& server, tcp::socket socket) : server_(server), socket_(std::move(socket)) {
    ++server_.connections;
  }
  ~Connection() { --server_.connections; }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void read() {
    parser_.emplace();
    parser_->header_limit(kMostHeader);
    parser_->body_limit(0);
    socket_.expires_after(kPatience);
    http::async_read(socket_, buffer_, *parser_, [self = shared_from_this()](Fault fault, std::size_t) {
      if (!fault) self->answer();
    });
  }

 private:
  void answer() {
    const auto& request = parser_->get();
    const std::string host(request[http::field::host]);
    if (!server_.host_allowed(host))
      return reply(http::status::forbidden, "text/plain", "not by this name\n");
    if (websocket::is_upgrade(request)) {
      const std::string origin(request[http::field::origin]);
      if (request.target() != "/stream" || (!origin.empty() && origin != "http://" + host))
        return reply(http::status::forbidden, "text/plain", "only for this server's own pages\n");
      socket_.expires_never();
      std::make_shared<Stream>(server_, socket_.release_socket())
          ->start(http::request<http::empty_body>(request));
      return;
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return reply(http::status::method_not_allowed, "text/plain", "only for reading\n");
    std::string path(request.target());
    path.resize(std::min(path.find('?'), path.size()));
    const auto page = server_.page(path);
    if (!page) return reply(http::status::not_found, "text/plain", "no such page\n");
    reply(http::status::ok, page->content_type, page->make());
  }

  void reply(http::status status, const std::string& content_type, std::string content) {
    const auto& request = parser_->get();
    response_ = {status, request.version()};
    response_.set(http::field::content_type, content_type);
    response_.set(http::field::cache_control, "no-store");
    response_.set("Content-Security-Policy", kPolicy);
    response_.set("X-Content-Type-Options", "nosniff");
    response_.keep_alive(request.keep_alive() && status == http::status::ok);
    response_.content_length(content.size());
    if (request.method() != http::verb::head) response_.body() = std::move(content);
    socket_.expires_after(kPatience);
    http::async_write(socket_, response_, [self = shared_from_this()](Fault fault, std::size_t) {
      if (fault) return;
      if (self->response_.keep_alive()) return self->read();
      self->socket_.socket().shutdown(tcp::socket::shutdown_send, fault);
    });
  }

  Impl& server_;
  beast::tcp_stream socket_;
  beast::flat_buffer buffer_{2 * kMostHeader};
  std::optional<http::request_parser<http::empty_body>> parser_;
  http::response<http::string_body> response_;
};

void Server::Impl::accept() {
  acceptor.async_accept([this](Fault fault, tcp::socket socket) {
    if (!acceptor.is_open()) return;
    if (!fault && connections + static_cast<int>(streams.size()) < kMostConnections)
      std::make_shared<Connection>(*this, std::move(socket))->read();
    accept();
  });
}

Expected<std::unique_ptr<Server>> Server::start(const ServerConfig& config) {
  Fault fault;
  const auto address = asio::ip::make_address(config.address, fault);
  const std::string where = config.address + ":" + std::to_string(config.port);
  if (fault || config.port < 0 || config.port > 65535)
    return Error{where, "no address of a viewer", "give one of this machine in numbers, such as 127.0.0.1"};
  auto impl = std::make_unique<Impl>(config);
  impl->loopback = address.is_loopback();
  const tcp::endpoint end(address, static_cast<std::uint16_t>(config.port));
  impl->acceptor.open(end.protocol(), fault);
  if (!fault) impl->acceptor.set_option(asio::socket_base::reuse_address(true), fault);
  if (!fault) impl->acceptor.bind(end, fault);
  if (!fault) impl->acceptor.listen(asio::socket_base::max_listen_connections, fault);
  if (fault == asio::error::address_in_use)
    return Error{where, "the port is in use", "end the program that has it, or give another one"};
  if (fault) return Error{where, fault.message(), "give an address of this machine"};
  impl->accept();
  impl->thread = std::thread([raw = impl.get()] { raw->io.run(); });
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Server::~Server() {
  asio::post(impl_->io, [impl = impl_.get()] {
    Fault ignored;
    impl->acceptor.close(ignored);
    while (!impl->streams.empty()) (*impl->streams.begin())->close();
  });
  asio::post(impl_->io, [impl = impl_.get()] { impl->io.stop(); });
  impl_->thread.join();
}

void Server::set_page(const std::string& path, const std::string& content_type, std::string content) {
  set_page(path, content_type, [content = std::move(content)] { return content; });
}

void Server::set_page(const std::string& path, const std::string& content_type,
                      std::function<std::string()> make) {
  const std::lock_guard lock(impl_->mutex);
  impl_->pages[path] = {content_type, std::move(make)};
}

void Server::publish(const Message& message) {
  if (clients() == 0) return;
  asio::post(impl_->io, [impl = impl_.get(), message] {
    for (const auto& stream : impl->streams) stream->send(message);
  });
}

int Server::port() const {
  Fault fault;
  return impl_->acceptor.local_endpoint(fault).port();
}

int Server::clients() const { return impl_->stream_count; }

std::string Server::address() const {
  const bool v6 = impl_->config.address.find(':') != std::string::npos;
  return "http://" + (v6 ? "[" + impl_->config.address + "]" : impl_->config.address) + ":" +
         std::to_string(port()) + "/";
}

}  // namespace evpose
