// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

namespace evpose {

/// A fault of the input, told to the user in one line: "WHERE: WHAT; FIX".
struct Error {
  std::string where;  ///< file, with line or byte where known; or the option or key at fault
  std::string what;   ///< what is wrong
  std::string fix;    ///< what to do about it

  std::string line() const;
};

/// Joins its arguments' text.
template <class... Args>
std::string text(const Args&... args) {
  std::ostringstream out;
  out.precision(10);
  (out << ... << args);
  return out.str();
}

/// A value, or the Error that kept it from being made. Reading the absent one is our own fault and throws.
template <class T>
class [[nodiscard]] Expected {
 public:
  Expected(T value) : state_(std::move(value)) {}      // NOLINT(google-explicit-constructor): `return value;`
  Expected(Error error) : state_(std::move(error)) {}  // NOLINT(google-explicit-constructor): `return error;`

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }
  T& value() & { return std::get<0>(state_); }
  const T& value() const& { return std::get<0>(state_); }
  T&& value() && { return std::get<0>(std::move(state_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  const Error& error() const { return std::get<1>(state_); }

 private:
  std::variant<T, Error> state_;
};

/// Success, or an Error.
template <>
class [[nodiscard]] Expected<void> {
 public:
  Expected() = default;
  Expected(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor): `return error;`

  bool ok() const { return !error_; }
  explicit operator bool() const { return ok(); }
  const Error& error() const { return error_.value(); }

 private:
  std::optional<Error> error_;
};

using Status = Expected<void>;

/// A broken promise between our own functions.
[[noreturn]] void check_failed(const char* expression, const char* file, int line);

}  // namespace evpose

/// For faults of ours, in every build type; faults of the input are an Error.
#define EVPOSE_CHECK(expression) \
  ((expression) ? static_cast<void>(0) : ::evpose::check_failed(#expression, __FILE__, __LINE__))
