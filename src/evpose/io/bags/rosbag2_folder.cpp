// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <filesystem>

#include "evpose/core/log.h"
#include "evpose/io/bags/rosbag2.h"
#include "evpose/io/files/yaml_document.h"

namespace evpose {
namespace {

namespace fs = std::filesystem;

struct Metadata {
  std::vector<std::string> files;  ///< paths
  bool messages_are_zstd = false;
};

Expected<std::string> storage_path(const YamlDocument& document, const YamlNode& node,
                                   const fs::path& folder) {
  const auto name = document.string(node, "relative_file_paths");
  if (!name) return name.error();
  const fs::path relative(*name);
  const bool leaves =
      relative.is_absolute() || std::find(relative.begin(), relative.end(), "..") != relative.end();
  if (leaves)
    return document.error(node, "the file '" + *name + "' lies outside of the bag",
                          "name files of the folder");
  // Old bags name the folder as well.
  for (const fs::path& path : {folder / relative, folder / relative.filename()})
    if (fs::is_regular_file(path)) return path.string();
  return Error{(folder / relative).string(), "no such file, but the bag's metadata.yaml names it",
               "copy the whole folder"};
}

Expected<Metadata> read_metadata(const fs::path& folder) {
  const auto document = YamlDocument::read((folder / "metadata.yaml").string());
  if (!document) return document.error();
  const YamlNode* top = document->root.find("rosbag2_bagfile_information");
  const YamlNode* files = top != nullptr ? top->find("relative_file_paths") : nullptr;
  if (files == nullptr || files->kind != YamlNode::Kind::list || files->items.empty())
    return document->error(document->root, "names no files: relative_file_paths is missing",
                           "write the metadata anew by `ros2 bag reindex`");
  Metadata out;
  for (const YamlNode& node : files->items) {
    auto path = storage_path(*document, node, folder);
    if (!path) return path.error();
    out.files.push_back(*std::move(path));
  }
  const YamlNode* mode = top->find("compression_mode");
  const YamlNode* format = top->find("compression_format");
  if (mode != nullptr && (mode->scalar == "MESSAGE" || mode->scalar == "message")) {
    if (format != nullptr && format->scalar != "zstd")
      return document->error(*format, "messages compressed by '" + format->scalar + "' cannot be read",
                             "convert the bag by `ros2 bag convert`");
    out.messages_are_zstd = true;
  }
  return out;
}

/// For a recording that was not closed. Names end in a number: the shorter comes first.
std::vector<std::string> storage_files(const fs::path& folder) {
  std::vector<std::string> out;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (entry.is_regular_file(ignored) && is_rosbag2_storage(entry.path().filename().string()))
      out.push_back(entry.path().string());
  std::sort(out.begin(), out.end(), [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  return out;
}

/// Files of one bag, one after another.
class FolderReader : public BagReader {
 public:
  Status add(std::unique_ptr<BagReader> file);
  Status select(const std::vector<std::size_t>& topics) override;
  Expected<bool> next(BagMessage& message) override;
  Status rewind() override;
  Status go_to_last(std::size_t topic) override;
  Status count_messages() override;

 private:
  struct Part {
    std::unique_ptr<BagReader> reader;
    std::vector<std::size_t> topic_of;  ///< our number of each of its topics
  };
  std::vector<Part> parts_;
  std::size_t current_ = 0;
};

Status FolderReader::add(std::unique_ptr<BagReader> file) {
  Part part{std::move(file), {}};
  for (const BagTopic& theirs : part.reader->topics()) {
    const auto same = [&](const BagTopic& t) { return t.name == theirs.name && t.type == theirs.type; };
    const auto it = std::find_if(topics_.begin(), topics_.end(), same);
    part.topic_of.push_back(static_cast<std::size_t>(it - topics_.begin()));
    if (it == topics_.end())
      topics_.push_back(theirs);
    else if (it->messages >= 0 && theirs.messages >= 0)
      it->messages += theirs.messages;
  }
  parts_.push_back(std::move(part));
  return {};
}

Status FolderReader::select(const std::vector<std::size_t>& topics) {
  for (Part& part : parts_) {
    std::vector<std::size_t> theirs;
    for (std::size_t i = 0; i < part.topic_of.size(); ++i)
      if (std::find(topics.begin(), topics.end(), part.topic_of[i]) != topics.end()) theirs.push_back(i);
    if (auto status = part.reader->select(theirs); !status) return status;
  }
  return {};
}

Expected<bool> FolderReader::next(BagMessage& message) {
  for (; current_ < parts_.size(); ++current_) {
    const Part& part = parts_[current_];
    const auto more = part.reader->next(message);
    if (!more) return more.error();
    if (!*more) continue;
    message.topic = part.topic_of[message.topic];
    return true;
  }
  return false;
}

Status FolderReader::rewind() {
  for (Part& part : parts_)
    if (auto status = part.reader->rewind(); !status) return status;
  current_ = 0;
  return {};
}

Status FolderReader::go_to_last(std::size_t topic) {
  if (auto status = rewind(); !status) return status;
  BagMessage message;
  for (std::size_t i = parts_.size(); i-- > 0;) {
    const auto& ours = parts_[i].topic_of;
    const auto it = std::find(ours.begin(), ours.end(), topic);
    if (it == ours.end()) continue;
    BagReader& reader = *parts_[i].reader;
    const auto theirs = static_cast<std::size_t>(it - ours.begin());
    if (auto status = reader.go_to_last(theirs); !status) return status;
    // Does it hold one at all?
    while (true) {
      const auto more = reader.next(message);
      if (!more) return more.error();
      if (!*more) break;
      if (message.topic != theirs) continue;
      current_ = i;
      return reader.go_to_last(theirs);
    }
    if (auto status = reader.rewind(); !status) return status;
  }
  return {};
}

Status FolderReader::count_messages() {
  for (BagTopic& topic : topics_) topic.messages = 0;
  for (Part& part : parts_) {
    if (auto status = part.reader->count_messages(); !status) return status;
    for (std::size_t i = 0; i < part.topic_of.size(); ++i)
      topics_[part.topic_of[i]].messages += part.reader->topics()[i].messages;
  }
  return {};
}

}  // namespace

Expected<std::unique_ptr<BagReader>> open_rosbag2_folder(const std::string& path) {
  Metadata metadata;
  if (fs::exists(fs::path(path) / "metadata.yaml")) {
    auto read = read_metadata(path);
    if (!read) return read.error();
    metadata = *std::move(read);
  } else {
    metadata.files = storage_files(path);
    if (metadata.files.empty())
      return Error{path, "is a folder without metadata.yaml and without .db3 or .mcap files", "name a bag"};
    log_warning(path +
                ": no metadata.yaml, the recording was not closed: its files are read in order of name");
  }
  auto reader = std::make_unique<FolderReader>();
  for (const std::string& file : metadata.files) {
    auto part = metadata.messages_are_zstd ? open_rosbag2_sqlite(file, true) : open_bag(file);
    if (!part) return part.error();
    if (auto status = reader->add(*std::move(part)); !status) return status.error();
  }
  return std::unique_ptr<BagReader>(std::move(reader));
}

}  // namespace evpose
