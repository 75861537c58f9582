// SPDX-License-Identifier: BSD-3-Clause
// A short run of a target with any compiler: its seeds, each cut at every byte (large ones at every few), and
// seeds changed at random.
//   evpose_fuzz_smoke TARGET FOLDER_OF_SEEDS COUNT
//   evpose_fuzz_smoke               lists the targets
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <random>
#include <string>

#include "evpose/core/log.h"
#include "evpose/io/files/atomic_file.h"
#include "fuzz.h"

namespace {

using evpose::fuzz::Bytes;

constexpr std::size_t kMostCuts = 4000;

Bytes bytes_of(const std::string& s) { return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()}; }

/// One to four changes: a bit, a byte, a stretch taken out, doubled or made of one byte.
std::string changed(std::string s, std::mt19937& random) {
  for (unsigned n = 1 + random() % 4; n > 0 && !s.empty(); --n) {
    const std::size_t at = random() % s.size(),
                      length = std::min<std::size_t>(1 + random() % 16, s.size() - at);
    switch (random() % 5) {
      case 0:
        s[at] = static_cast<char>(s[at] ^ 1 << random() % 8);
        break;
      case 1:
        s[at] = static_cast<char>(random());
        break;
      case 2:
        s.erase(at, length);
        break;
      case 3:
        s.insert(at, s.substr(at, length));
        break;
      default:
        std::fill_n(s.begin() + static_cast<std::ptrdiff_t>(at), length, random() % 2 == 0 ? '\0' : '\xFF');
    }
  }
  return s;
}

int run(const evpose::fuzz::Target& target, const std::filesystem::path& folder, int count) {
  std::vector<std::string> seeds;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none))
    seeds.push_back(evpose::read_text_file(entry.path()).value());
  if (seeds.empty()) seeds.emplace_back(64, '\0');
  std::sort(seeds.begin(), seeds.end());  // folders have no order
  std::mt19937 random(1);
  for (const std::string& seed : seeds)
    for (std::size_t n = 0; n <= seed.size(); n += 1 + seed.size() / kMostCuts)
      target.run(bytes_of(seed.substr(0, n)));
  for (int i = 0; i < count; ++i) target.run(bytes_of(changed(seeds[random() % seeds.size()], random)));
  std::cout << target.name << ": " << seeds.size() << " seeds, " << count << " changed ones\n";
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  evpose::set_log_level(evpose::LogLevel::quiet);
  if (argc == 1) {
    for (const auto& target : evpose::fuzz::targets()) std::cout << target.name << '\n';
    return 0;
  }
  const auto* target = evpose::fuzz::find_target(argv[1]);
  if (argc != 4 || target == nullptr) {
    std::cerr << "usage: evpose_fuzz_smoke TARGET FOLDER_OF_SEEDS COUNT\n";
    return 2;
  }
  return run(*target, argv[2], std::stoi(argv[3]));
}
