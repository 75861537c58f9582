// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer on the target that EVPOSE_FUZZ_TARGET names.
#include <cstdlib>
#include <iostream>

#include "evpose/core/log.h"
#include "fuzz.h"

// The HDF5 library itself forgets memory when it gives up on a damaged file.
extern "C" const char* __lsan_default_suppressions();   // NOLINT(bugprone-reserved-identifier)
extern "C" const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:libhdf5";
}

namespace {

const evpose::fuzz::Target* chosen() {
  const char* name = std::getenv("EVPOSE_FUZZ_TARGET");
  if (name != nullptr)
    if (const auto* target = evpose::fuzz::find_target(name)) return target;
  std::cerr << "EVPOSE_FUZZ_TARGET names none of:";
  for (const auto& target : evpose::fuzz::targets()) std::cerr << ' ' << target.name;
  std::cerr << '\n';
  std::exit(2);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const evpose::fuzz::Target* target = chosen();
  evpose::set_log_level(evpose::LogLevel::quiet);
  target->run({data, size});
  return 0;
}
