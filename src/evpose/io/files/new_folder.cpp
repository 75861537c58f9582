// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/new_folder.h"

#include <unistd.h>

#include <filesystem>

namespace evpose {

namespace fs = std::filesystem;

Expected<NewFolder> NewFolder::create(const std::string& target, const std::string& mark) {
  std::error_code failed;
  fs::path place = fs::path(target).lexically_normal();
  if (place.filename().empty()) place = place.parent_path();  // "name/"
  if (place.empty()) return Error{target, "is no name of a folder", "choose another"};
  const bool empty = fs::is_directory(place, failed) && fs::is_empty(place, failed);
  if (fs::exists(place, failed) && !empty && !fs::exists(place / mark, failed))
    return Error{target, text("is there already and has no ", mark), "choose another name, or remove it"};
  if (place.has_parent_path()) fs::create_directories(place.parent_path(), failed);
  std::string path = place.string() + ".part-" + std::to_string(::getpid());
  fs::remove_all(path, failed);
  if (!fs::create_directory(path, failed) || failed)
    return Error{target, text("cannot be made: ", failed ? failed.message() : "the name is taken"),
                 "choose a folder that can be written"};
  return NewFolder(place.string(), std::move(path));
}

NewFolder::NewFolder(std::string target, std::string path)
    : target_(std::move(target)), path_(std::move(path)) {}

NewFolder::NewFolder(NewFolder&& other) noexcept
    : target_(std::move(other.target_)), path_(std::exchange(other.path_, {})) {}

NewFolder& NewFolder::operator=(NewFolder&& other) noexcept {
  if (this != &other) {
    remove();
    target_ = std::move(other.target_);
    path_ = std::exchange(other.path_, {});
  }
  return *this;
}

NewFolder::~NewFolder() { remove(); }

void NewFolder::remove() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
  path_.clear();
}

Status NewFolder::make_folder(const std::string& name) const {
  std::error_code failed;
  fs::create_directory(path(name), failed);
  if (failed) return Error{path(name), text("cannot be made: ", failed.message()), "check the disk"};
  return {};
}

Status NewFolder::commit() {
  // The old one goes aside first: a folder that is not empty cannot be replaced in one step.
  const std::string old = path_ + ".old";
  std::error_code failed;
  if (fs::exists(target_, failed)) {
    fs::rename(target_, old, failed);
    if (failed) return Error{target_, text("cannot be replaced: ", failed.message()), "choose another name"};
  }
  fs::rename(path_, target_, failed);
  if (failed) {
    std::error_code ignored;
    fs::rename(old, target_, ignored);
    return Error{target_, text("cannot be written: ", failed.message()), "choose another name"};
  }
  path_.clear();
  fs::remove_all(old, failed);
  return {};
}

}  // namespace evpose
