// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"

namespace evpose {

/// A folder that appears under its name when all of it is written: until then it has a name of its own beside
/// it. Unless committed, it is removed again.
class NewFolder {
 public:
  /// `mark`: a file by which a folder that may be replaced is known. Errors: something without it stands at
  /// `target`; the place cannot be written. Missing parents are made.
  static Expected<NewFolder> create(const std::string& target, const std::string& mark);
  NewFolder(NewFolder&& other) noexcept;
  NewFolder& operator=(NewFolder&& other) noexcept;
  ~NewFolder();

  /// Of a file in the folder.
  std::string path(const std::string& name) const { return path_ + "/" + name; }
  Status make_folder(const std::string& name) const;
  Status commit();

 private:
  NewFolder(std::string target, std::string path);
  void remove();

  std::string target_, path_;  ///< path_ is empty once committed or moved from
};

}  // namespace evpose
