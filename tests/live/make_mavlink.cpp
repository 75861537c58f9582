// SPDX-License-Identifier: BSD-3-Clause
// make_mavlink ADDRESS: sends every message that we know, three times with other values, and prints for each
// a line of JSON with its id and its fields in the order of the wire, numbers as text: for mavlink_test.mjs.
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <type_traits>

#include "evpose/mavlink/link.h"

namespace {

using namespace evpose;
using namespace evpose::mavlink;

template <class T>
std::string number(T value) {
  char out[64];
  if constexpr (std::is_floating_point_v<T>) {
    if (std::isnan(value)) return "\"nan\"";
    std::snprintf(out, sizeof out, "\"%.9g\"", static_cast<double>(value));
  } else {
    std::snprintf(out, sizeof out, "\"%lld\"", static_cast<long long>(value));
  }
  return out;
}

template <class T, std::size_t N>
std::string number(const std::array<T, N>& values) {
  if constexpr (std::is_same_v<T, char>) {
    std::string text = "\"";
    for (const char c : values)
      if (c != 0) text += c;
    return text + "\"";
  } else {
    std::string list = "[";
    for (const T& value : values) list += (list.size() > 1 ? "," : "") + number(value);
    return list + "]";
  }
}

std::mt19937 g_random(7);  // NOLINT: one stream of numbers for all messages

template <class T>
void fill(T& value, int round) {
  std::uniform_real_distribution<double> any(-1000, 1000);
  if constexpr (std::is_floating_point_v<T>)
    value = static_cast<T>(any(g_random));
  else if constexpr (sizeof(T) == 8)
    value = static_cast<T>(g_random()) * 1'000'003;
  else
    value = static_cast<T>(g_random() >> (round == 1 ? 0 : 3));
}

template <class T, std::size_t N>
void fill(std::array<T, N>& values, int round) {
  if constexpr (std::is_same_v<T, char>) {
    for (std::size_t i = 0; i < N; ++i)
      values[i] = static_cast<char>(round == 1 || i < 20 ? 'a' + i % 26 : 0);
  } else {
    for (T& value : values) fill(value, round);
    if (N == 21 && round == 1) values[0] = static_cast<T>(NAN);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const auto link = Link::open(argv[1]);
  if (!link) return 2;
  std::uint8_t sequence = 250;  // over its wrap
  for (int round = 0; round < 3; ++round)
    for_each_message([&](auto message) {
      // The second time with unknown covariances, the third with nothing but zeros.
      using Message = decltype(message);
      Message::fields(message, [&](auto&... field) { (fill(field, round), ...); });
      if (round == 2) Message::fields(message, [](auto&... field) { ((field = {}), ...); });
      (*link)->send(encode(message, sequence, 42, 197).bytes());
      std::string values;
      Message::fields(message, [&](const auto&... field) {
        ((values += (values.empty() ? "" : ",") + number(field)), ...);
      });
      std::printf("{\"id\":%u,\"name\":\"%s\",\"sequence\":%u,\"values\":[%s]}\n", Message::kType.id,
                  Message::kType.name, sequence, values.c_str());
      ++sequence;
    });
  return (*link)->counts().lost == 0 ? 0 : 1;
}
