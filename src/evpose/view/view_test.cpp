// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <bit>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "evpose/io/files/atomic_file.h"
#include "evpose/view/pages.h"
#include "evpose/view/picture.h"
#include "evpose/view/recorded_pictures.h"
#include "evpose/view/run_view.h"

namespace evpose {
namespace {

/// A plain connection to a server, as anybody may open it.
class Client {
 public:
  explicit Client(int port) : descriptor_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{20, 0};
    ::setsockopt(descriptor_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    EXPECT_EQ(::connect(descriptor_, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
  }
  ~Client() { ::close(descriptor_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void say(const std::string& words) const { ::send(descriptor_, words.data(), words.size(), MSG_NOSIGNAL); }
  /// What comes until the text has been seen, or the end.
  std::string hear(const std::string& until = "") const {
    std::string out;
    char buffer[4096];
    while (until.empty() || out.find(until) == std::string::npos) {
      const ssize_t got = ::recv(descriptor_, buffer, sizeof buffer, 0);
      if (got <= 0) break;
      out.append(buffer, static_cast<std::size_t>(got));
    }
    return out;
  }

 private:
  int descriptor_;
};

class ViewServer : public testing::Test {
 protected:
  ViewServer() {
    auto started = Server::start({"127.0.0.1", 0});
    EXPECT_TRUE(started);
    server_ = std::move(*started);
    server_->set_page("/", "text/html", "the page");
  }
  std::string host() const { return "127.0.0.1:" + std::to_string(server_->port()); }
  std::string ask(const std::string& request_line, const std::string& more = "", std::string name = "") {
    if (name.empty()) name = host();
    Client client(server_->port());
    const std::string connection = more.empty() ? "Connection: close\r\n" : "";
    client.say(request_line + " HTTP/1.1\r\nHost: " + name + "\r\n" + connection + more + "\r\n");
    return client.hear();
  }
  static std::string upgrade(const std::string& origin) {
    return "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
           "dGhlIHNhbXBsZSBub25jZQ==\r\n" +
           (origin.empty() ? "" : "Origin: " + origin + "\r\n");
  }
  bool wait_for_clients(int count) const {
    for (int i = 0; i < 400 && server_->clients() != count; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return server_->clients() == count;
  }
  std::unique_ptr<Server> server_;
};

TEST_F(ViewServer, GivesItsPagesAndNothingElse) {
  const std::string page = ask("GET /");
  EXPECT_EQ(page.rfind("HTTP/1.1 200", 0), 0u) << page;
  EXPECT_NE(page.find("the page"), std::string::npos);
  EXPECT_NE(page.find("Content-Security-Policy: default-src 'none'"), std::string::npos);
  EXPECT_EQ(ask("HEAD /").find("the page"), std::string::npos);
  for (const char* path : {"/nothing", "/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd",
                           "/./", "*", "http://x/"})
    EXPECT_EQ(ask(std::string("GET ") + path).rfind("HTTP/1.1 404", 0), 0u) << path;
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS"})
    EXPECT_EQ(ask(std::string(method) + " /").rfind("HTTP/1.1 405", 0), 0u) << method;
}

TEST_F(ViewServer, AnswersOnlyToNamesOfThisMachine) {
  EXPECT_EQ(ask("GET /", "", "localhost:1").rfind("HTTP/1.1 200", 0), 0u);
  EXPECT_EQ(ask("GET /", "", "evil.example").rfind("HTTP/1.1 403", 0), 0u)
      << "a name that was bent to this address";
}

TEST_F(ViewServer, TheStreamIsForItsOwnPages) {
  EXPECT_EQ(ask("GET /stream", upgrade("http://evil.example")).rfind("HTTP/1.1 403", 0), 0u);
  EXPECT_EQ(ask("GET /other", upgrade("http://" + host())).rfind("HTTP/1.1 403", 0), 0u);
  Client client(server_->port());
  client.say("GET /stream HTTP/1.1\r\nHost: " + host() + "\r\n" + upgrade("http://" + host()) + "\r\n");
  EXPECT_EQ(client.hear("\r\n\r\n").rfind("HTTP/1.1 101", 0), 0u);
  ASSERT_TRUE(wait_for_clients(1));
  server_->publish({std::make_shared<std::string>("hello"), false});
  const std::string message = client.hear("hello");
  EXPECT_EQ(message, std::string("\x81\x05hello"));
}

TEST_F(ViewServer, GarbageAndHugeRequestsAreRefused) {
  for (const std::string& words :
       {std::string("\x16\x03\x01garbage\r\n\r\n"), "GET /" + std::string(20'000, 'a') + " HTTP/1.1\r\n\r\n",
        std::string("POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n")}) {
    Client client(server_->port());
    client.say(words);
    EXPECT_EQ(client.hear().find(" 200 "), std::string::npos);
  }
  EXPECT_NE(ask("GET /").find("the page"), std::string::npos) << "still there";
}

TEST_F(ViewServer, AClientThatNeverReadsHoldsNothingUp) {
  Client lazy(server_->port()), eager(server_->port());
  for (Client* client : {&lazy, &eager}) {
    client->say("GET /stream HTTP/1.1\r\nHost: " + host() + "\r\n" + upgrade("") + "\r\n");
    client->hear("\r\n\r\n");
  }
  ASSERT_TRUE(wait_for_clients(2));
  const auto big = std::make_shared<std::string>(1 << 20, 'x');
  std::weak_ptr<std::string> watched = big;
  std::thread reader([&] { eager.hear("the last"); });
  for (int i = 0; i < 200; ++i) server_->publish({big, true});
  // Of 200 MB for each only a few wait: the rest was left out, for both.
  for (int i = 0; i < 400 && watched.use_count() > 20; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(25));
  EXPECT_LE(watched.use_count(), 20);
  server_->publish({std::make_shared<std::string>("the last"), false});
  reader.join();
}

TEST_F(ViewServer, APortHasOneOwner) {
  const auto second = Server::start({"127.0.0.1", server_->port()});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().what, "the port is in use");
  EXPECT_FALSE(Server::start({"no address", 0}));
}

TEST(ViewPages, TheMapIsDrawnAlongItsContours) {
  ContourMap map;
  map.anchor = {100, 0, 0};
  map.source = "a/\"map\".ply";
  for (int i = 0; i < 3; ++i) {
    ContourPoint p;
    p.position = {static_cast<float>(i) * (i == 2 ? 5.0f : 0.1f), 0, 0};
    p.tangent = {1, 0, 0};
    map.points.push_back(p);
  }
  const auto scene = nlohmann::json::parse(scene_json(&map));
  EXPECT_EQ(scene["name"], "\"map\".ply");
  EXPECT_EQ(scene["points"].size(), 9u);
  EXPECT_EQ(scene["lines"].size(), 6u) << "the far one is not joined";
  EXPECT_NEAR(scene["points"][3].get<double>(), 100.1, 1e-6);
  EXPECT_TRUE(nlohmann::json::parse(scene_json(nullptr))["points"].empty());
}

TEST(ViewPages, ARowHasAColumnForEachNumber) {
  Update u;
  u.T_map_body.p = {1, 2, 3};
  u.covariance(1, 2) = 7;
  u.health = Health::degraded;
  u.accel_bias = {0, 0, 9};
  const auto history = nlohmann::json::parse(history_json("live", "a <b>", {view_row(u, 0.5, 2, NAN)}));
  const auto at = [&](const char* name) {
    const auto& columns = history["columns"];
    const auto found = std::find(columns.begin(), columns.end(), name);
    return history["rows"][0][static_cast<std::size_t>(found - columns.begin())];
  };
  EXPECT_EQ(at("t"), 0.5);
  EXPECT_EQ(at("z"), 3);
  EXPECT_EQ(at("cyz"), 7);
  EXPECT_EQ(at("health"), 3);
  EXPECT_EQ(at("baz"), 9);
  EXPECT_TRUE(at("latency_ms").is_null());
}

TEST(ViewPicture, HoldsTheNewestEventOfEachBlockAndThePoints) {
  TimeSurface surface(960, 4);  // blocks of 2x2
  surface.insert(5, 3, Polarity::off, 1'000'000);
  surface.insert(4, 2, Polarity::on, 999'000);
  surface.insert(0, 0, Polarity::on, 1'000'000);
  surface.insert(8, 0, Polarity::on, 500'000);
  const std::vector<Snapshot::Point> points{{10, 2, true}, {959, 3, false}};
  const std::string bytes = picture_bytes(surface, 1'000'000, points, 0.5);
  ASSERT_EQ(bytes.size(), 16u + 480 * 2 + 2 * 12);
  const auto word = [&](std::size_t at) {
    std::uint32_t out = 0;
    std::memcpy(&out, bytes.data() + at, sizeof out);
    return out;
  };
  const auto number = [&](std::size_t at) { return std::bit_cast<float>(word(at)); };
  const auto pixel = [&](std::size_t x, std::size_t y) {
    return static_cast<int>(static_cast<unsigned char>(bytes[16 + 480 * y + x]));
  };
  EXPECT_EQ(word(0), 480u);
  EXPECT_EQ(word(4), 2u);
  EXPECT_EQ(word(8), 2u);
  EXPECT_EQ(number(12), 0.5f);
  EXPECT_EQ(pixel(0, 0), 255) << "on, just now";
  EXPECT_EQ(pixel(2, 1), 1) << "off is the newer one";
  EXPECT_EQ(pixel(4, 0), 128) << "long ago";
  EXPECT_EQ(pixel(7, 1), 128) << "never";
  EXPECT_EQ(number(16 + 960), 5);
  EXPECT_EQ(number(16 + 960 + 8), 1) << "matched";
  EXPECT_EQ(number(16 + 960 + 12), 479.5f);
  EXPECT_EQ(number(16 + 960 + 20), 0) << "not matched";
}

TEST_F(ViewServer, SaysWhyARunHasNoPictures) {
  RunFiles live;  // was made from no recording
  live.folder = "a/run";
  live.rows.resize(3);
  for (std::size_t i = 0; i < 3; ++i) live.rows[i].t = static_cast<TimeNs>(i) * 40 * kNsPerMs;
  const RecordedPictures pictures(*server_, live, ContourMap{});
  auto answer = nlohmann::json::object();
  for (int i = 0; i < 400 && answer.value("fault", "").empty(); ++i) {
    const std::string page = ask("GET /pictures.json");
    answer = nlohmann::json::parse(page.substr(page.find("\r\n\r\n") + 4));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(answer["fault"], "a/run: does not say what it was made from; give a run of evpose track");
  EXPECT_EQ(answer["made"], 0);
  EXPECT_EQ(answer["t"], nlohmann::json::parse("[0.0, 0.08]")) << "not nearer than 50 ms";
  EXPECT_EQ(ask("GET /picture/0").rfind("HTTP/1.1 404", 0), 0u);
}

TEST(ViewRun, WhatIsNoRunIsNamed) {
  const auto none = read_run("/no/such/run");
  ASSERT_FALSE(none);
  const auto folder = std::filesystem::temp_directory_path() / ("evpose_view_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  ASSERT_TRUE(write_text_file(folder / "states.csv", "t_s,x_m\n1,2\n"));
  const auto broken = read_run(folder);
  ASSERT_FALSE(broken);
  EXPECT_NE(broken.error().what.find("line 2"), std::string::npos);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace evpose
