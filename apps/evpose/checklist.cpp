// SPDX-License-Identifier: BSD-3-Clause
#include "checklist.h"

#include <cstdio>

namespace evpose {
namespace {

void print(const char* state, const std::string& thing, const std::string& words) {
  std::printf("%-8s %-12s %s\n", state, thing.c_str(), words.c_str());
  std::fflush(stdout);
}

}  // namespace

void Checklist::ok(const std::string& thing, const std::string& words) { print("ok", thing, words); }

void Checklist::note(const std::string& thing, const std::string& words) { print("note", thing, words); }

void Checklist::problem(const std::string& thing, const Error& error) {
  ++problems_;
  const Error what{error.where, error.what, ""};
  print("PROBLEM", thing, what.line());
  print("", "", "do: " + Error{"", error.fix, ""}.line());
}

void Checklist::skipped(const std::string& thing) { print("skipped", thing, "see the problem above"); }

}  // namespace evpose
